"""Laws of the 2D table that its backends share."""

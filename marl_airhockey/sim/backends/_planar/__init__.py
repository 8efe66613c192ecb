"""Physics of the 2D table that the 2D backends share."""

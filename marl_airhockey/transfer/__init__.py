"""Other physics: how policies do there, and what it is."""

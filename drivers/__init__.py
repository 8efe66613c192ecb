"""Drivers of paddles, one per file; a file is found by its name."""

"""Drivers, one per file. A driver has the name of its file."""

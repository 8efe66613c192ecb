"""One file, one driver of a paddle. A file here is found by its name."""

"""Compiler of NumPy functions into loops over worlds, its cache, and threads."""

"""Datasets of other libraries: recordings written as theirs, and theirs read."""

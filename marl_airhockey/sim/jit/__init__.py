"""Compiler: numpy functions traced once and compiled over worlds; threads."""

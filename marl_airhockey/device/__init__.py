"""Worlds on a GPU: the code of the CPU, one thread for each world."""

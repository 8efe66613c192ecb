"""Suites of set pieces: situations with a task, on which drivers are compared."""

"""Command line ``airhockey``."""

"""Recordings and datasets: writing, reading, checking, relabelling and conversion."""

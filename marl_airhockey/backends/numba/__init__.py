"""The 2D table for thousands of worlds."""

from marl_airhockey.backends.numba.backend import make

__all__ = ["make"]

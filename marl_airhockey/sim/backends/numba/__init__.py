"""Numba backend: the 2D table in one compiled loop."""

from marl_airhockey.sim.backends.numba.backend import make

__all__ = ["make"]

"""Pymunk backend: the 2D table in Chipmunk, a reference that is easy to read."""

from marl_airhockey.sim.backends.pymunk.backend import make

__all__ = ["make"]

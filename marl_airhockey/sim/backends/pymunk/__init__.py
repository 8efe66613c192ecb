"""Pymunk backend: the 2D table on Chipmunk, the readable reference."""

from marl_airhockey.sim.backends.pymunk.backend import make

__all__ = ["make"]

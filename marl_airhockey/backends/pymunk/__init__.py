"""The 2D table on Chipmunk."""

from marl_airhockey.backends.pymunk.backend import make

__all__ = ["make"]

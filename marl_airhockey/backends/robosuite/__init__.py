"""A UR5e a seat, in MuJoCo."""

from marl_airhockey.backends.robosuite.backend import make

__all__ = ["make"]

"""Robosuite backend: one UR5e for each seat, in MuJoCo."""

from marl_airhockey.sim.backends.robosuite.backend import make

__all__ = ["make"]

"""Robosuite backend: one UR5e per seat, in MuJoCo."""

from marl_airhockey.sim.backends.robosuite.backend import make

__all__ = ["make"]

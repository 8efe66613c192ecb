"""Toolkit: the names that files of scenarios and drivers import."""

from __future__ import annotations

from marl_airhockey.sim.contracts.driver import Driver, PrescribedMotion, View
from marl_airhockey.sim.contracts.mark import Caption, Mark
from marl_airhockey.sim.contracts.observable import Observable
from marl_airhockey.sim.contracts.scenario import GoalScenario, Scenario, Transition
from marl_airhockey.sim.contracts.units import (
    Degrees,
    Latency,
    Metres,
    Pucks,
    Seconds,
    Share,
    Speed,
    Weight,
)
from marl_airhockey.sim.core.errors import require, unknown_name
from marl_airhockey.sim.core.geometry import clip, length, products
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.sim.core.scene import GoalLine, Scene
from marl_airhockey.sim.core.seat import Seat
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.core.table import Obstacle, Table
from marl_airhockey.sim.jit.elementary import cos, exp, expm1, hypot, log, log1p, sin
from marl_airhockey.toolkit.serves import ServingScenario
from marl_airhockey.types import Array, Memory

__all__ = [
    "Array",
    "Caption",
    "Degrees",
    "Driver",
    "GoalLine",
    "GoalScenario",
    "Latency",
    "Mark",
    "Memory",
    "Metres",
    "Observable",
    "Obstacle",
    "PrescribedMotion",
    "Pucks",
    "RandomStreams",
    "Scenario",
    "Scene",
    "Seat",
    "Seconds",
    "ServingScenario",
    "Share",
    "Speed",
    "State",
    "Table",
    "Transition",
    "View",
    "Weight",
    "clip",
    "cos",
    "exp",
    "expm1",
    "hypot",
    "length",
    "log",
    "log1p",
    "products",
    "require",
    "sin",
    "unknown_name",
]

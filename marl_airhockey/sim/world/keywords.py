"""Keywords that all environments share: their names and types."""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Integral, Real
from pathlib import Path
from types import NoneType
from typing import Any, TypedDict

from marl_airhockey.sim.core.errors import UnknownKeywordError, unknown_keyword
from marl_airhockey.sim.core.physics import Given

OTHER_NAMES = {
    **dict.fromkeys(("num_envs", "n_envs", "batch_size"), "num_worlds"),
    **dict.fromkeys(("max_episode_steps", "max_steps", "horizon"), "max_cycles"),
    **dict.fromkeys(("camera", "camera_name"), "viewpoint"),
}
"""Keyword of this library for names that other libraries use."""


KINDS: dict[str, tuple[str, type | tuple[type, ...]]] = {
    "backend": ("the name of a backend", str),
    "drivers": ("a dict of drivers by agent", Mapping),
    "seats": ("a kind of seats", str),
    "profile": ("the name or file of a profile", (str, Path)),
    "observe": ("an observation type", str),
    "goals": ('"flat" or "dict"', str),
    "physics": (
        "a preset, a TOML file or a dict of parameters",
        (str, Path, Mapping, NoneType),
    ),
    "control_dt": ("a time in seconds", Real),
    "substeps": ("a whole number above 0", (Integral, NoneType)),
    "max_cycles": ("a whole number above 0", (Integral, NoneType)),
    "options": ("a dict of fields of the scenario", Mapping),
    "rig": ("the file of a rig", (str, Path)),
}
"""Description of each keyword for messages, and its types."""


class Keywords(TypedDict, total=False):
    """Keywords that all environments share; `make.parallel_env` explains them."""

    backend: str
    drivers: Mapping[str, Any]
    seats: str
    profile: str
    observe: str
    goals: str
    physics: Given
    control_dt: float
    substeps: int
    max_cycles: int
    options: Mapping[str, Any]
    rig: str


def check_keywords(keywords: Mapping[str, Any]) -> None:
    """Check the names of keywords and the types of their values.

    Raises:
        UnknownKeywordError: A keyword is unknown; the message suggests a known one.
        ValueError: A value has a wrong type.
    """
    for name, value in keywords.items():
        if name in OTHER_NAMES:
            raise UnknownKeywordError(
                f"unexpected keyword argument {name!r}; use {OTHER_NAMES[name]!r}"
            )
        if name not in Keywords.__annotations__:
            raise UnknownKeywordError(
                unknown_keyword(name, Keywords.__annotations__)
                + "; set fields of the scenario with options={...}"
            )
        what, kinds = KINDS[name]
        if isinstance(value, bool) or not isinstance(value, kinds):
            raise ValueError(f"{name}: {value!r} is not {what}")

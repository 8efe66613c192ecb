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
"""Names of keywords in other libraries, with ours"""


KINDS: dict[str, tuple[str, type | tuple[type, ...]]] = {
    "backend": ("name of a backend", str),
    "drivers": ("dict of drivers by agent", Mapping),
    "seats": ("kind of seats", str),
    "profile": ("name or file of a profile", (str, Path)),
    "observe": ("type of observations", str),
    "goals": ('"flat" or "dict"', str),
    "physics": (
        "preset, TOML file or dict of parameters",
        (str, Path, Mapping, NoneType),
    ),
    "control_dt": ("time in seconds", Real),
    "substeps": ("whole number above 0", (Integral, NoneType)),
    "max_cycles": ("whole number above 0", (Integral, NoneType)),
    "options": ("dict of fields of the scenario", Mapping),
    "rig": ("file of a rig", (str, Path)),
}
"""What a keyword is, and its types"""


class Keywords(TypedDict, total=False):
    """Keywords of every environment; see `build_world` for meanings."""

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
    """Refuse keywords that no environment has, and values of another type.

    Raises:
        UnknownKeywordError: An unknown keyword, with the one that was meant.
        ValueError: A value of another type.
    """
    for name, value in keywords.items():
        if name in OTHER_NAMES:
            raise UnknownKeywordError(
                f"unexpected keyword argument {name!r}; here it is "
                f"{OTHER_NAMES[name]!r}"
            )
        if name not in Keywords.__annotations__:
            raise UnknownKeywordError(
                unknown_keyword(name, Keywords.__annotations__)
                + "; fields of the scenario go into options={...}"
            )
        what, kinds = KINDS[name]
        if isinstance(value, bool) or not isinstance(value, kinds):
            raise ValueError(f"{name}: {value!r} is no {what}")

"""Profiles: what a kind of robot senses and how far its physics may lie from ours.

Every number has a source: two real tables, measured over 37 minutes of play (see the
documentation's page on physics), the gantry that played there, and a UR5e with a
60 frames/s camera. Profiles change sensing, lag and the spread of physics, not seats.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.sim.core.checks import build, check_fields
from marl_airhockey.sim.core.errors import unknown_name
from marl_airhockey.sim.core.parameters import parameter_range
from marl_airhockey.types import Array

Range = tuple[float, float]
SUFFIX = ".toml"
"""Ending of the names of files of profiles"""


@dataclass(frozen=True)
class CorrelatedParameter:
    """Parameter whose value follows another's along a line, within a spread."""

    other: str
    """Name of a parameter that comes before it"""
    at: tuple[float, float]
    """Two values of the other"""
    values: tuple[float, float]
    """Its own values there; constant beyond them"""
    spread: float
    """Half-width of the range about the line"""

    def at_value(self, other: Array, unit: Array) -> Array:
        """Return values (W,) for those of the other, given numbers in [0, 1)."""
        line = np.interp(other, self.at, self.values)
        return np.asarray(line + self.spread * (2.0 * unit - 1.0))

    @property
    def range(self) -> Range:
        """Lowest and highest value."""
        return min(self.values) - self.spread, max(self.values) + self.spread


@dataclass(frozen=True)
class Profile:
    """Ranges from which the parameters of an episode are drawn, by name."""

    what: str
    """The profile in a few words"""
    ranges: Mapping[str, Range] = field(default_factory=dict)
    """Values in the units of the parameters"""
    shares: Mapping[str, Range] = field(default_factory=dict)
    """Multiples of what scenario and table say"""
    follows: Mapping[str, CorrelatedParameter] = field(default_factory=dict)
    """Parameters that are not drawn alone"""


UNMEASURED = dict.fromkeys(
    (
        *("puck_restitution", "puck_friction", "block_restitution", "puck_mass"),
        *("block_mass", "block_friction", "arm_stiffness", "arm_force", "arm_payload"),
    ),
    (0.85, 1.15),
)
"""Multiples of what could not be measured on the tables: within 15 %."""

RAILS = CorrelatedParameter("wall_restitution", (0.65, 0.88), (0.08, 0.01), 0.01)
SLOPES = {"wall_restitution_slope": RAILS}
"""Lively rails lose little with speed: the wooden table and the professional one."""

TABLES: dict[str, Range] = {
    # Both tables lie inside: quadratic drag 0.0205 and 0.0267 1/m, no linear one.
    "puck_drag": (0.015, 0.035),
    "puck_damping": (0.0, 0.0),
    # Rails: 0.852 and 0.674 at 1 m/s, friction 0.115 and 0.29.
    "wall_restitution": (0.65, 0.88),
    "wall_friction": (0.08, 0.32),
    # Paddles: 0.45 .. 0.50 and 0.59 .. 0.65; their friction is not identifiable.
    "paddle_restitution": (0.44, 0.66),
    "paddle_friction": (0.03, 0.15),
    # About those laws from bounce to bounce: professional .. wooden.
    "wall_restitution_scatter": (0.013, 0.04),
    "wall_exit_scatter": (0.035, 0.10),
    "paddle_restitution_scatter": (0.05, 0.05),
    # After a hit the first rail shows 1.2 .. 1.4 m/s at shots of 5.5 .. 7 m/s.
    "spin_scatter": (0.2, 0.2),
    # 0.04 m/s2: 0.058 along and 0.017 across on the wooden table, 0.007 on the other.
    "slope": (0.234, 0.234),
}
"""Laws that span both tables."""

TILT = {"tilt": (0.733, 1.021)}
"""Pull of the tilted table: 0.69 .. 0.96 m/s2, as three sources differ, of 0.94."""

CAMERA_60 = {
    # Exposure, transfer and vision: one or two frames and 3 ms to two dozen more.
    "observation_delay": (0.025, 0.045),
    # A frame is up to a period old when it is asked for.
    "observation_jitter": (0.0167, 0.0167),
    # 0.4 .. 0.65 mm with printed tags; a map of 1 .. 10 mm from edge to edge.
    "position_noise": (0.0004, 0.00065),
    "calibration_error": (0.001, 0.004),
    # 5 .. 10 % of all frames under the arm; near it, three times as many.
    "occlusion": (0.15, 0.30),
    # Not known for this camera; that of the gantry's.
    "false_detection": (0.0003, 0.002),
}

PROFILES: dict[str, Profile] = {
    "ideal": Profile("no delay, no noise, the laws as they are given"),
    "ur5e": Profile(
        "a UR5e at 20 Hz under a camera of 60 frames/s, on tables as measured",
        {
            **TABLES,
            **CAMERA_60,
            # Dead time of a command on its way, then a servo that was derived from
            # 34 ms at a look-ahead of 0.03 s on its relatives: look-aheads 0.05 .. 0.1.
            "action_delay": (0.004, 0.010),
            "servo_time": (0.050, 0.100),
        },
        {**TILT, **UNMEASURED},
        SLOPES,
    ),
    "ur5e-authors": Profile(
        "the same with the gains and the vision that the paper's authors published",
        {
            **TABLES,
            **CAMERA_60,
            # 23 .. 70 ms of vision, 4 mm quantised, look-ahead 0.2 s: 250 .. 350 ms.
            "observation_delay": (0.045, 0.075),
            "position_noise": (0.0012, 0.0012),
            "calibration_error": (0.001, 0.010),
            "action_delay": (0.025, 0.035),
            "servo_time": (0.180, 0.225),
        },
        {**TILT, **UNMEASURED},
        SLOPES,
    ),
    "gantry": Profile(
        "a core-XY gantry under a camera of 120 frames/s, as measured in play",
        {
            **TABLES,
            # Round trip by a lamp, 995 trials: 13.4 ms and a camera's period.
            "observation_delay": (0.0134, 0.0134),
            "observation_jitter": (0.0083, 0.0083),
            # 0.05 .. 0.16 mm in flight, a map of 1.0 .. 1.2 mm.
            "position_noise": (0.00005, 0.00016),
            "calibration_error": (0.0010, 0.0012),
            # 0.7 .. 2.2 % of all frames, at the beam and at the far rail.
            "occlusion": (0.02, 0.06),
            "false_detection": (0.0003, 0.002),
            # Lag of the tuned loop behind its plan.
            "servo_time": (0.0, 0.003),
        },
        {**TILT, **UNMEASURED},
        SLOPES,
    ),
}
"""Profiles by name."""


def find_profile(name: str) -> Profile:
    """Return a profile by its name, or that of a TOML file.

    A file has ``base``, the name of a profile, ``what``, and a table ``ranges`` of
    [low, high] by parameter, which replace those of the base: see `load_profile`.

    Raises:
        ValueError: an unknown name, or a file that makes no sense.
    """
    if name in PROFILES:
        return PROFILES[name]
    if name.endswith(SUFFIX):
        return load_profile(Path(name))
    raise ValueError(unknown_name("profile", name, PROFILES))


@dataclass(frozen=True)
class _ProfileFile:
    """Content of a profile's file."""

    base: str = "ideal"
    what: str = ""
    ranges: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_fields(self)
        if self.base not in PROFILES:
            raise ValueError(unknown_name("base", self.base, PROFILES))


def load_profile(path: Path) -> Profile:
    """Read a profile from a TOML file, such as ``airhockey fit-table`` writes.

    Raises:
        ValueError: no such file, an unknown base or parameter, or a range that is none.
    """
    try:
        given = tomllib.loads(path.read_text())
    except (OSError, tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"profile {path}: {error}") from error
    if not given:
        raise ValueError(f"profile {path}: there is nothing in the file")
    try:
        file = build(_ProfileFile, given)
        ranges = {k: parameter_range(k, v, k) for k, v in file.ranges.items()}
    except ValueError as error:
        raise ValueError(f"profile {path}: {error}") from error
    base = PROFILES[file.base]
    return Profile(
        file.what or path.stem,
        {**base.ranges, **ranges},
        {k: v for k, v in base.shares.items() if k not in ranges},
        {k: v for k, v in base.follows.items() if k not in ranges},
    )


RAMP = 0.025
"""Time in which a seat at its highest acceleration makes half of a velocity change of
half its top speed, s; robot and arcade seats need 0.1 s to their top speed"""


def delay_of(profile: Profile) -> Range:
    """Return the least and the longest time from an event to half of the answer, s.

    It is the sum of the age of the frame, the dead time of the command, the servo and
    `RAMP`. `scripts/reproduce/answer_times.py` measures it.
    """
    names = "observation_delay", "action_delay", "servo_time"
    ends = [profile.ranges.get(name, (0.0, 0.0)) for name in names]
    longest = profile.ranges.get("observation_jitter", (0.0, 0.0))[1]
    least, most = (RAMP + sum(pair[end] for pair in ends) for end in (0, 1))
    return least, most + longest

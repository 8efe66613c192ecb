"""Profiles: sensing and actuation of a kind of robot, and variation of the physics.

Every number has a source: two real tables that were measured over 37 minutes of play
(see docs/physics.md), the gantry that played there, and a UR5e with a camera of
60 frames/s. Profiles change sensing, lag and the variation of physics, but not seats.
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
from marl_airhockey.sim.core.geometry import interpolate
from marl_airhockey.sim.core.parameters import parameter_range
from marl_airhockey.types import Array

Range = tuple[float, float]
SUFFIX = ".toml"
"""Suffix of profile files."""


@dataclass(frozen=True)
class CorrelatedParameter:
    """Parameter that depends linearly on another parameter, within a spread."""

    other: str
    """Name of the other parameter, which precedes this one in `PARAMETERS`."""
    at: tuple[float, float]
    """Two values of the other parameter."""
    values: tuple[float, float]
    """Values of this parameter there; constant beyond them."""
    spread: float
    """Half-width of the range around the line."""

    def at_value(self, other: Array, unit: Array) -> Array:
        """Return values (W,), given the other parameter and numbers in [0, 1)."""
        line = interpolate(other, self.at, self.values)
        return np.asarray(line + self.spread * (2.0 * unit - 1.0))

    @property
    def range(self) -> Range:
        """Lowest and highest value of this parameter."""
        return min(self.values) - self.spread, max(self.values) + self.spread


@dataclass(frozen=True)
class Profile:
    """Ranges from which the parameters of an episode are sampled, by name."""

    what: str
    """Short description of the profile."""
    ranges: Mapping[str, Range] = field(default_factory=dict)
    """Ranges in the units of the parameters."""
    shares: Mapping[str, Range] = field(default_factory=dict)
    """Ranges of factors for the values of scenario and table."""
    follows: Mapping[str, CorrelatedParameter] = field(default_factory=dict)
    """Parameters that depend on another parameter."""


UNMEASURED = dict.fromkeys(
    (
        *("puck_restitution", "puck_friction", "block_restitution", "puck_mass"),
        *("block_mass", "block_friction", "arm_stiffness", "arm_force", "arm_payload"),
    ),
    (0.85, 1.15),
)
"""Factors for parameters that could not be measured on the tables: within 15 %."""

RAILS = CorrelatedParameter("wall_restitution", (0.65, 0.88), (0.08, 0.01), 0.01)
SLOPES = {"wall_restitution_slope": RAILS}
"""Rails with a high restitution lose little of it with speed. The two ends of the line
are the wooden and the professional table."""

TABLES: dict[str, Range] = {
    # Both tables are inside: quadratic drag 0.0205 and 0.0267 1/m, no linear drag.
    "puck_drag": (0.015, 0.035),
    "puck_damping": (0.0, 0.0),
    # Rails: 0.852 and 0.674 at 1 m/s, friction 0.115 and 0.29.
    "wall_restitution": (0.65, 0.88),
    "wall_friction": (0.08, 0.32),
    # Paddles: 0.45 .. 0.50 and 0.59 .. 0.65; their friction is not identifiable.
    "paddle_restitution": (0.44, 0.66),
    "paddle_friction": (0.03, 0.15),
    # Contact noise: professional .. wooden.
    "wall_restitution_scatter": (0.013, 0.04),
    "wall_exit_scatter": (0.035, 0.10),
    "paddle_restitution_scatter": (0.05, 0.05),
    # The first bounce after a hit shows an edge speed of 1.2 .. 1.4 m/s at shots of
    # 5.5 .. 7 m/s.
    "spin_scatter": (0.2, 0.2),
    # 0.04 m/s2: 0.058 along and 0.017 across on the wooden table, 0.007 on the other.
    "slope": (0.234, 0.234),
}
"""Ranges of parameters that include both tables."""

TILT = {"tilt": (0.733, 1.021)}
"""Factors of the tilt, which accelerates pucks by 0.94 m/s2 by default. Three sources
differ and give 0.69 .. 0.96 m/s2."""

CAMERA_60 = {
    # Exposure, transfer and vision: one or two frames, and 3 ms to two dozen ms more.
    "observation_delay": (0.025, 0.045),
    # A frame is up to a period old when it is requested.
    "observation_jitter": (0.0167, 0.0167),
    # Noise of 0.4 .. 0.65 mm with printed tags. Calibration errors of 1 .. 10 mm from
    # edge to edge.
    "position_noise": (0.0004, 0.00065),
    "calibration_error": (0.001, 0.004),
    # The arm hides the puck in 5 .. 10 % of all frames. Near the arm the share is three
    # times as high.
    "occlusion": (0.15, 0.30),
    # Unknown for this camera. This is the value of the gantry's camera.
    "false_detection": (0.0003, 0.002),
}

UR5E = {
    **TABLES,
    **CAMERA_60,
    # Dead time of a command, then a servo. The servo was derived from 34 ms at a
    # look-ahead of 0.03 s on related arms, for look-aheads of 0.05 .. 0.1 s.
    "action_delay": (0.004, 0.010),
    "servo_time": (0.050, 0.100),
}

PROFILES: dict[str, Profile] = {
    "ideal": Profile("no latency, no noise, physics as given"),
    "ur5e": Profile(
        "UR5e at 20 Hz with a camera of 60 frames/s, on tables as measured",
        UR5E,
        {**TILT, **UNMEASURED},
        SLOPES,
    ),
    "ur5e-calibrated": Profile(
        "as ur5e, with a calibrated camera, a marked puck, and a table that was fitted",
        {
            **UR5E,
            # Ten cameras, calibrated by tags and edges: `scripts/bench/camera_map.py`.
            "calibration_error": (0.00014, 0.00056),
            # A bar that is seen in the lab: `scripts/bench/vision.py --marked`.
            "angle_noise": (0.02, 0.02),
            "angle_dropout": (0.016, 0.016),
            # The middle of `ur5e`, with the intervals that 4 to 6 minutes of play leave
            # in three labs: `scripts/reproduce/fitted_tables.py`.
            "puck_drag": (0.0236, 0.0264),
            "wall_restitution": (0.735, 0.795),
            "paddle_restitution": (0.51, 0.59),
            "slope": (0.0025, 0.0025),
        },
        {"tilt": (0.8758, 0.8782), **UNMEASURED},
        SLOPES,
    ),
    "ur5e-authors": Profile(
        "as ur5e, with the gains and the vision that the paper's authors published",
        {
            **TABLES,
            **CAMERA_60,
            # Vision of 23 .. 70 ms, quantised to 4 mm. With a look-ahead of 0.2 s:
            # 250 .. 350 ms.
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
        "core-XY gantry with a camera of 120 frames/s, as measured in play",
        {
            **TABLES,
            # Round trip with a lamp, 995 trials: 13.4 ms and a period of the camera.
            "observation_delay": (0.0134, 0.0134),
            "observation_jitter": (0.0083, 0.0083),
            # Noise of 0.05 .. 0.16 mm in flight, calibration errors of 1.0 .. 1.2 mm.
            "position_noise": (0.00005, 0.00016),
            "calibration_error": (0.0010, 0.0012),
            # Hidden in 0.7 .. 2.2 % of all frames, at the beam and at the far rail.
            "occlusion": (0.02, 0.06),
            "false_detection": (0.0003, 0.002),
            # Lag of the tuned controller behind its planned trajectory.
            "servo_time": (0.0, 0.003),
        },
        {**TILT, **UNMEASURED},
        SLOPES,
    ),
}
"""Profiles by name."""


def find_profile(name: str) -> Profile:
    """Return the profile with a name, or the profile of a TOML file.

    A file has ``base``, the name of a profile, ``what``, a description, and a table
    ``ranges`` of [low, high] by parameter. They replace the ranges of the base, see
    `load_profile`.

    Raises:
        ValueError: The name is unknown, or the file is not valid.
    """
    if name in PROFILES:
        return PROFILES[name]
    if name.endswith(SUFFIX):
        return load_profile(Path(name))
    raise ValueError(unknown_name("profile", name, PROFILES))


@dataclass(frozen=True)
class _ProfileFile:
    """Content of a profile file."""

    base: str = "ideal"
    what: str = ""
    ranges: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_fields(self)
        if self.base not in PROFILES:
            raise ValueError(unknown_name("base", self.base, PROFILES))


def load_profile(path: Path) -> Profile:
    """Read a profile from a TOML file, as ``airhockey fit-table`` writes it.

    Raises:
        ValueError: The file does not exist, a base or parameter is unknown, or a range
            is not valid.
    """
    try:
        given = tomllib.loads(path.read_text())
    except (OSError, tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"profile {path}: {error}") from error
    if not given:
        raise ValueError(f"profile {path}: the file is empty")
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
"""Time to 50 % of a velocity step of half the top speed at the largest acceleration, s.
Robot and arcade seats need 0.1 s to reach their top speed."""


def delay_of(profile: Profile) -> Range:
    """Return the shortest and the longest end-to-end latency, s.

    It is the time from an event to 50 % of a velocity step of the paddle: the sum of
    observation latency, action latency, servo time and `RAMP`.
    `scripts/reproduce/answer_times.py` measures it.
    """
    names = "observation_delay", "action_delay", "servo_time"
    ends = [profile.ranges.get(name, (0.0, 0.0)) for name in names]
    longest = profile.ranges.get("observation_jitter", (0.0, 0.0))[1]
    least, most = (RAMP + sum(pair[end] for pair in ends) for end in (0, 1))
    return least, most + longest

"""Fit of the physics parameters of a real table to tracks of its puck, with intervals.

Drag and slope are fitted to free flights, restitution to bounces, and friction to
shallow bounces, which slide unless the puck spins along. Intervals are 95 % intervals
of a bootstrap over flights and bounces. A parameter that the tracks do not determine is
omitted, and the reason is given.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

import numpy as np

from marl_airhockey.sim.core.parameters import SLOWEST_BOUNCE
from marl_airhockey.sim.core.table import GRAVITY, Table
from marl_airhockey.system_id.track import Contacts, Flights, Track, cut
from marl_airhockey.types import Array

LONGEST = 0.15
"""Least duration of a flight that is used for drag and slope, s."""
FEWEST = 20
"""Least number of flights or bounces from which a parameter is fitted."""
RESAMPLES = 200
WIDEST = {
    "puck_drag": 0.015,
    "tilt": 0.3,
    "cross_tilt": 0.3,
    "wall_restitution": 0.05,
    "wall_restitution_slope": 0.05,
    "wall_friction": 0.06,
    "paddle_restitution": 0.08,
}
"""Largest half-width of the interval of a parameter that counts as identified."""
SLIDES = 1.2
"""Least ratio of the tangential speed to the one at which a bounce without spin would
stick, for bounces that are used for friction."""


@dataclass(frozen=True)
class Estimate:
    """Estimate of a parameter with its 95 % interval."""

    value: float
    low: float
    high: float
    count: int
    """Number of flights or bounces."""


@dataclass(frozen=True)
class FittedTable:
    """Fitted parameters of a table."""

    found: dict[str, Estimate]
    """Estimates of the identified parameters, by name."""
    by_side: dict[int, Estimate]
    """Restitution at 1 m/s, by side of the table."""
    missing: dict[str, str]
    """Reasons why other parameters are not identifiable, by name."""

    def to_toml(self) -> str:
        """Return the text of a file for ``--physics FILE``."""
        lines = ["# value  # 95 % interval, number of flights or bounces"]
        lines.append("puck_damping = 0.0")
        for name, e in self.found.items():
            lines.append(
                f"{name} = {e.value:.5g}  # {e.low:.4g} .. {e.high:.4g}, {e.count}"
            )
        for side, e in self.by_side.items():
            lines.append(
                f"# wall_restitution at side {side}: {e.value:.4g}  "
                f"({e.low:.4g} .. {e.high:.4g}, {e.count})"
            )
        lines += [f"# {name}: {why}" for name, why in self.missing.items()]
        return "\n".join(lines) + "\n"


def fit_table(tracks: list[Track], table: Table) -> FittedTable:
    """Fit the physics parameters of a table to tracks of its puck."""
    cuts = [cut(track, table) for track in tracks]
    flights = Flights(*(np.concatenate(x) for x in _columns(f for f, _ in cuts)))
    contacts = Contacts(*(np.concatenate(x) for x in _columns(c for _, c in cuts)))
    found: dict[str, Estimate] = {}
    missing: dict[str, str] = {
        "paddle_friction": "not identifiable: a hit's normal is not known well enough",
        "puck_friction": "not identifiable: one puck was recorded",
        "puck_restitution": "not identifiable: one puck was recorded",
    }
    rng = np.random.default_rng(0)

    def add(
        names: tuple[str, ...], rows: Array, law: Callable[[Array], Array], what: str
    ) -> None:
        if len(rows) < FEWEST:
            for name in names:
                missing[name] = f"not identifiable: {len(rows)} {what}, {FEWEST} needed"
            return
        for name, e in zip(names, _estimates(rng, rows, law), strict=True):
            if (e.high - e.low) / 2 > WIDEST[name]:
                wide = f"{e.low:.3g} .. {e.high:.3g}"
                missing[name] = f"not identifiable: {wide} from {e.count} {what}"
            else:
                found[name] = e

    long = np.flatnonzero(flights.seconds >= LONGEST)
    add(
        ("puck_drag", "tilt", "cross_tilt"),
        long,
        lambda rows: _flight_law(flights, rows),
        f"flights of {LONGEST} s or more",
    )
    e = contacts.after[:, 0] / np.maximum(contacts.before[:, 0], 1e-9)
    sound = (contacts.before[:, 0] >= SLOWEST_BOUNCE) & (e > 0.0) & (e < 1.2)
    banks = np.flatnonzero(sound & (contacts.side >= 0))
    add(
        ("wall_restitution", "wall_restitution_slope"),
        banks,
        lambda rows: _restitution_law(contacts.before[rows, 0], e[rows]),
        "bounces off walls",
    )
    by_side = {}
    if "wall_restitution" in found:
        slope = _restitution_law(contacts.before[banks, 0], e[banks])[1]
        for side in range(len(table.vertices)):
            rows = banks[contacts.side[banks] == side]
            if len(rows) >= FEWEST:
                at_one = e + slope * np.log(np.maximum(contacts.before[:, 0], 1e-9))
                (by_side[side],) = _estimates(rng, rows, partial(_median, at_one))
    add(
        ("wall_friction",),
        _sliding(contacts, banks, e),
        lambda rows: _median(_rubbing(contacts), rows),
        "bounces shallow enough to slide",
    )
    hits = np.flatnonzero(sound & (contacts.side < 0))
    add(
        ("paddle_restitution",),
        hits,
        lambda rows: _median(e, rows),
        "hits of a recorded paddle (columns paddle_x, paddle_y)",
    )
    return FittedTable(found, by_side, missing)


def _estimates(
    rng: np.random.Generator, rows: Array, law: Callable[[Array], Array]
) -> list[Estimate]:
    """Return the estimates of a fit to some rows, with intervals by a bootstrap."""
    best = law(rows)
    draws = np.array([law(rng.choice(rows, len(rows))) for _ in range(RESAMPLES)])
    low, high = np.quantile(draws, (0.025, 0.975), axis=0)
    numbers = zip(best.tolist(), low.tolist(), high.tolist(), strict=True)
    return [Estimate(*row, len(rows)) for row in numbers]


def _median(values: Array, rows: Array) -> Array:
    return np.array([np.median(values[rows])])


def _columns(parts: Iterable[Flights | Contacts]) -> Iterable[tuple[Array, ...]]:
    return zip(*(vars(part).values() for part in parts), strict=True)


def _flight_law(flights: Flights, rows: Array) -> Array:
    """Return drag (1/m), tilt and slope to the side (deg): a = g - b |v| v."""
    v, a, t = flights.velocity[rows], flights.acceleration[rows], flights.seconds[rows]
    speed = np.hypot(*v.T)[:, None]
    one, none = np.ones(len(rows)), np.zeros(len(rows))
    matrix = np.concatenate(
        [
            np.stack([-speed[:, 0] * v[:, 0], one, none], 1),
            np.stack([-speed[:, 0] * v[:, 1], none, one], 1),
        ]
    )
    # The precision of the curvature grows as the duration to the power of 2.5.
    known = np.concatenate([t, t]) ** 2.5
    wanted, weight = a.T.ravel(), known
    for _ in range(5):
        found, *_ = np.linalg.lstsq(
            matrix * weight[:, None], wanted * weight, rcond=None
        )
        off = np.abs(matrix @ found - wanted) * known
        scale = 3.0 * max(float(np.median(off)), 1e-12)
        weight = known * np.minimum(1.0, scale / np.maximum(off, 1e-12))
    angles = np.degrees(np.arcsin(np.clip(-found[1:] / GRAVITY, -1.0, 1.0)))
    return np.array([max(found[0], 0.0), *angles])


def _restitution_law(speed: Array, e: Array) -> Array:
    """Return e1 and k of e = e1 - k ln v, by a robust line."""
    x = np.log(speed)
    matrix, weight = np.stack([np.ones_like(x), -x], 1), np.ones_like(x)
    found = np.zeros(2)
    for _ in range(10):
        found, *_ = np.linalg.lstsq(matrix * weight[:, None], e * weight, rcond=None)
        off = np.abs(matrix @ found - e)
        scale = 2.0 * max(float(np.median(off)), 1e-6)
        weight = np.sqrt(np.minimum(1.0, scale / np.maximum(off, 1e-12)))
    return found


def _rubbing(contacts: Contacts) -> Array:
    """Return the lost tangential speeds as shares of the normal impulses."""
    before, after = contacts.before, contacts.after
    lost = (before[:, 1] - after[:, 1]) * np.sign(before[:, 1])
    return np.asarray(lost / np.maximum(before[:, 0] + after[:, 0], 1e-9))


def _sliding(contacts: Contacts, banks: Array, e: Array) -> Array:
    """Return the bounces so shallow that a puck without spin slides to their end."""
    # Start with a low value: bounces that stick have less friction, and are excluded as
    # the estimate grows.
    rows, friction = banks, 0.03
    for _ in range(30):
        before = contacts.before[banks]
        # A bounce sticks if a third of the slip is less than friction can stop.
        needed = 3.0 * friction * (1.0 + e[banks]) * before[:, 0]
        rows = banks[np.abs(before[:, 1]) > SLIDES * needed + 0.2]
        if len(rows) < FEWEST:
            break
        friction = max(float(_median(_rubbing(contacts), rows)[0]), friction)
    return rows

"""Fit the 2D table's physics to what was seen elsewhere: in 3D, or on a real table.

Stretches of recorded play are replayed on the batched 2D table from the same states by
the same commands; the parameters are those with which pucks and paddles end nearest to
where they were seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from marl_airhockey.contracts.backend import Command
from marl_airhockey.contracts.driver import Driver
from marl_airhockey.core.errors import require
from marl_airhockey.core.physics import PARAMETERS, PUCK_SPEED_CAP
from marl_airhockey.core.scene import Scene
from marl_airhockey.evaluation.evaluate import seat_world
from marl_airhockey.evaluation.recordings import read
from marl_airhockey.registry import find_backend, make_scenario
from marl_airhockey.toolkit.starts import first_state
from marl_airhockey.types import Array
from marl_airhockey.world.build import Keywords

FITTED = ("tilt", "puck_damping", "wall_restitution", "paddle_restitution")
"""Parameters that are looked for, and the delay with which paddles follow."""
AROUND = ((-3.0, 3.0), (-0.15, 1.0), (-0.4, 0.1), (-0.4, 0.15))
"""How far from where it begins each of `FITTED` is looked for."""
LIMITS = np.array([(PARAMETERS[n].low, PARAMETERS[n].high) for n in FITTED])
STRETCH = 0.25
"""s of a stretch."""
APART = 0.1
"""m; an error counts no more than this: after an odd bounce all is possible."""
JUMP = 1.5 * PUCK_SPEED_CAP
"""m/s: what is faster than this has been moved by hand."""
FEWEST = 50
"""Stretches that a fit needs."""


@dataclass(frozen=True)
class Play:
    """Recorded play of one scene, an episode after the other."""

    scene: Scene
    control_dt: float
    position: Array
    """(T, N, 2) m, after each step"""
    velocity: Array
    """(T, N, 2) m/s"""
    command: Array
    """(T, seats, 2) m/s, that led there"""
    follows: Array
    """(T,) whether a row comes a step after the one before"""

    def stretches(self, steps: int) -> Array:
        """(W,) rows from which at least ``steps`` rows follow, none overlapping.

        A row in which something has jumped, say a puck that was served, follows none.
        """
        way = np.diff(self.position, axis=0, prepend=self.position[:1])
        jumped = np.hypot(way[..., 0], way[..., 1]).max(-1) > JUMP * self.control_dt
        run, found = 0, []
        for row, follows in enumerate(self.follows & ~jumped):
            run = run + 1 if follows else 0
            if run == steps + 1:
                found.append(row - steps)
                run = 0
        return np.array(found, np.int64)


def play(
    scenario: str, driver: Driver, steps: int, seed: int, keywords: Keywords
) -> Play:
    """Let a driver play some steps, to be fitted to."""
    world = seat_world(driver, scenario, 1, keywords)
    world.reset(seed)
    nothing = np.zeros((1, 0, 2))
    rows: list[tuple[Array, Array, Array, bool]] = []
    fresh = True
    for _ in range(steps):
        step = world.step(nothing)
        place, speed = world.state.position[0].copy(), world.state.velocity[0].copy()
        rows.append((place, speed, world.command[0].copy(), not fresh))
        fresh = bool(step.terminated[0] or step.truncated[0])
        if fresh:
            world.reset()
    scene, dt = world.scene, world.control_dt
    world.close()
    position, velocity, command, follows = (
        np.array(c) for c in zip(*rows, strict=True)
    )
    return Play(scene, dt, position, velocity, command, follows)


def recorded(paths: Sequence[Path]) -> Play:
    """Play from recordings of ``airhockey play --record``.

    Raises:
        ValueError: none, or several scenarios.
    """
    parts: list[tuple[Array, ...]] = []
    names = set()
    for path in paths:
        meta, steps, _ = read(path)
        names.add(meta["match"]["scenario"])
        scenario = make_scenario(meta["match"]["scenario"], **meta["options"])
        rows = np.array(
            [row["paddles"] + [p[:2] for p in row["pucks"]] for row in steps]
        )
        speeds = np.array(
            [row["paddle_velocities"] + [p[2:] for p in row["pucks"]] for row in steps]
        )
        follows = np.arange(len(steps)) > 0
        command = np.array([row["command"] for row in steps])
        parts.append((rows, speeds, command, follows))
    if len(names) != 1:
        found = ", ".join(sorted(names)) or "no recordings (.jsonl files)"
        raise ValueError(f"recordings of one scenario are needed, there are: {found}")
    joined = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Play(scenario.scene, meta["control_dt"], *joined)


@dataclass(frozen=True)
class Fit:
    """Physics that were found, and how far off the 2D table is with it and without."""

    physics: dict[str, float]
    """`FITTED` and action_delay, s"""
    before: tuple[float, float]
    """m, mean error of pucks and of paddles after a stretch, with the usual values"""
    after: tuple[float, float]
    """m, with those that were found"""
    stretches: int

    @property
    def closed(self) -> float:
        """Share of the pucks' error that is gone."""
        return 1.0 - self.after[0] / self.before[0]

    def to_toml(self) -> str:
        """A preset, for ``--physics FILE``."""
        lines = [
            f"# {self.stretches} stretches of {STRETCH} s; pucks off by "
            f"{1000 * self.before[0]:.1f} mm before, {1000 * self.after[0]:.1f} mm now"
        ]
        lines += [f"{name} = {value:.5g}" for name, value in self.physics.items()]
        return "\n".join(lines) + "\n"


def fit(seen: Play) -> Fit:
    """Find the physics of the 2D table that explain recorded play best.

    Args:
        seen: play.

    Raises:
        ValueError: too little play, or a scene with blocks.
        RuntimeError: scipy is missing, with the line that installs it.
    """
    require("scipy", "robosuite")
    from scipy.optimize import differential_evolution, minimize, minimize_scalar

    if seen.scene.blocks:
        raise ValueError("fit: blocks are not fitted; take another scenario")
    model = _Model(seen)
    usual = {n: p.default for n, p in PARAMETERS.items()} | seen.scene.defaults
    first = np.array([*(usual[name] for name in FITTED), 0.0])
    # Paddles alone tell the delay; contacts that take time would look like one.
    delay = minimize_scalar(
        lambda x: model.errors(usual, np.array([*first[:-1], x]))[1].mean(),
        bounds=(0.0, seen.control_dt),
        method="bounded",
        options={"xatol": 1e-4},
    ).x

    def loss(chosen: Array) -> float:
        pucks, _ = model.errors(usual, np.append(chosen, delay))
        return float(np.minimum(pucks, APART).mean())

    # Bounces make the loss uneven, so that a search downhill alone gets stuck.
    around = np.clip(first[:-1] + np.array(AROUND).T, *LIMITS.T)
    rough = differential_evolution(
        loss, list(zip(*around, strict=True)), seed=0, popsize=10, maxiter=30, tol=1e-4
    )
    fine = minimize(
        loss, rough.x, method="Nelder-Mead", bounds=list(zip(*around, strict=True))
    )
    best = np.append(fine.x, delay)
    physics = dict(zip((*FITTED, "action_delay"), best.tolist(), strict=True))
    return Fit(
        physics,
        model.mean(usual, first),
        model.mean(usual, best),
        len(model.rows),
    )


class _Model:
    """The 2D table at the beginning of all stretches at once."""

    def __init__(self, seen: Play) -> None:
        self._seen, self._steps = seen, max(round(STRETCH / seen.control_dt), 2)
        rows = seen.stretches(self._steps)
        self.rows = rows[_clear(seen, rows)]
        if len(self.rows) < FEWEST:
            raise ValueError(
                f"fit: {len(self.rows)} stretches of {STRETCH} s are too few; at least "
                f"{FEWEST} are needed: play longer (--steps)"
            )
        kind = find_backend("numba")
        self._backend = kind(
            seen.scene, len(self.rows), seen.control_dt, kind.default_substeps
        )

    def errors(self, usual: dict[str, float], values: Array) -> tuple[Array, Array]:
        """(W, pucks) and (W, seats) distances at the end, m."""
        seen, count = self._seen, len(self.rows)
        physics = {**usual, **dict(zip(FITTED, values, strict=False))}
        every = np.arange(count)
        rows = {name: np.full(count, value) for name, value in physics.items()}
        self._backend.set_physics(rows, every)
        state = first_state(seen.scene, count)
        movers = seen.position.shape[1]
        state.position[:, :movers] = seen.position[self.rows]
        state.velocity[:, :movers] = seen.velocity[self.rows]
        self._backend.start(state, every)
        share = values[-1] / seen.control_dt
        for k in range(1, self._steps + 1):
            now, before = seen.command[self.rows + k], seen.command[self.rows + k - 1]
            goal = (1 - share) * now + share * before
            state = self._backend.step(Command(goal))
        off = state.position[:, :movers] - seen.position[self.rows + self._steps]
        away = np.hypot(off[..., 0], off[..., 1])
        seats = len(seen.scene.seats)
        return away[:, seats:], away[:, :seats]

    def mean(self, usual: dict[str, float], values: Array) -> tuple[float, float]:
        pucks, paddles = self.errors(usual, values)
        return float(np.minimum(pucks, APART).mean()), float(paddles.mean())


def _clear(seen: Play, rows: Array) -> Array:
    """(W,) whether no puck touches anything where a stretch begins.

    Contacts take time elsewhere, but not on the 2D table.
    """
    table, seats = seen.scene.table, len(seen.scene.seats)
    place = seen.position[rows]
    pucks, paddles = place[:, seats:], place[:, :seats]
    away = np.hypot(*np.moveaxis(pucks[:, :, None] - paddles[:, None], -1, 0))
    apart = (away > table.paddle_radius + table.puck_radius).all((1, 2))
    room = np.einsum("wpd,kd->wpk", pucks, table.normals) + table.offsets
    return np.asarray(apart & (room > table.puck_radius).all((1, 2)))

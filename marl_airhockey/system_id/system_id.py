"""Identification of the 2D table's physics from play in 3D or on a real table.

Short segments of recorded play are simulated again on the 2D table (backend "numba")
from the same states with the same commands. The fit finds the parameters with which
pucks and paddles end nearest to their recorded positions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from marl_airhockey.registry import find_backend
from marl_airhockey.sim.contracts.backend import Command
from marl_airhockey.sim.core.errors import require
from marl_airhockey.sim.core.parameters import PARAMETERS
from marl_airhockey.system_id.recorded_play import RecordedPlay
from marl_airhockey.types import Array

FITTED = ("tilt", "puck_damping", "wall_restitution", "paddle_restitution")
"""Parameters that are fitted; the delay of paddles (action_delay) is fitted first."""
SEARCH_RANGE = ((-3.0, 3.0), (-0.15, 1.0), (-0.4, 0.1), (-0.4, 0.15))
"""Lowest and highest change of each of `FITTED` from its usual value."""
LIMITS = np.array([(PARAMETERS[n].low, PARAMETERS[n].high) for n in FITTED])
SEGMENT_SECONDS = 0.25
"""Duration of a segment, s."""
MAX_ERROR = 0.1
"""Largest value that a puck's error counts with, m; after an irregular bounce the puck
may be anywhere."""
MIN_SEGMENTS = 50
"""Least number of segments from which parameters are fitted."""


@dataclass(frozen=True)
class FittedPhysics:
    """Fitted parameters, and the error of the 2D table before and after the fit."""

    physics: dict[str, float]
    """Values of `FITTED` and of action_delay, s, by name."""
    before: tuple[float, float]
    """Mean error of pucks and of paddles after a segment with the usual values, m."""
    after: tuple[float, float]
    """Mean error of pucks and of paddles after a segment with the fitted values, m."""
    segments: int

    @property
    def error_reduction(self) -> float:
        """Share of the pucks' error that the fit removed."""
        return 1.0 - self.after[0] / self.before[0]

    def to_toml(self) -> str:
        """Return the text of a file for ``--physics FILE``."""
        lines = [
            f"# {self.segments} segments of {SEGMENT_SECONDS} s; error of pucks "
            f"{1000 * self.before[0]:.1f} mm before the fit, "
            f"{1000 * self.after[0]:.1f} mm after it"
        ]
        lines += [f"{name} = {value:.5g}" for name, value in self.physics.items()]
        return "\n".join(lines) + "\n"


def fit_physics(play: RecordedPlay) -> FittedPhysics:
    """Find the physics parameters of the 2D table that fit recorded play best.

    Raises:
        ValueError: There are too few segments, or the scene has blocks.
        RuntimeError: scipy is missing. The message contains the command to install it.
    """
    require("scipy", "robosuite")
    if play.scene.blocks:
        raise ValueError(
            "fit: the scenario has blocks, which are not fitted; choose another "
            "scenario"
        )
    model = _SegmentModel(play)
    usual = {n: p.default for n, p in PARAMETERS.items()} | play.scene.defaults
    first = np.array([*(usual[name] for name in FITTED), 0.0])
    delay = _fit_delay(model, usual, first)
    best = _fit_parameters(model, usual, first, delay)
    physics = dict(zip((*FITTED, "action_delay"), best.tolist(), strict=True))
    return FittedPhysics(
        physics,
        model.mean_errors(usual, first),
        model.mean_errors(usual, best),
        len(model.rows),
    )


def _fit_delay(model: _SegmentModel, usual: dict[str, float], first: Array) -> float:
    """Return the action delay, s, that explains the paddles' motion best.

    Only paddles are used, as contacts that take time would look like a delay.
    """
    from scipy.optimize import minimize_scalar

    found = minimize_scalar(
        lambda x: model.errors(usual, np.array([*first[:-1], x]))[1].mean(),
        bounds=(0.0, model.control_dt),
        method="bounded",
        options={"xatol": 1e-4},
    )
    return float(found.x)


def _fit_parameters(
    model: _SegmentModel, usual: dict[str, float], first: Array, delay: float
) -> Array:
    """Return `FITTED` with the smallest error of pucks, and ``delay``."""
    from scipy.optimize import differential_evolution, minimize

    def loss(values: Array) -> float:
        pucks, _ = model.errors(usual, np.append(values, delay))
        return float(np.minimum(pucks, MAX_ERROR).mean())

    # Bounces give the loss many local minima, so a local search alone fails.
    low_high = np.clip(first[:-1] + np.array(SEARCH_RANGE).T, *LIMITS.T)
    bounds = list(zip(*low_high, strict=True))
    rough = differential_evolution(
        loss, bounds, seed=0, popsize=10, maxiter=30, tol=1e-4
    )
    fine = minimize(loss, rough.x, method="Nelder-Mead", bounds=bounds)
    return np.append(fine.x, delay)


class _SegmentModel:
    """Simulation of all segments in one batch, with one world of the 2D table for each.

    Args:
        play: Recorded play.

    Raises:
        ValueError: There are too few segments.
    """

    def __init__(self, play: RecordedPlay) -> None:
        self._play, self.control_dt = play, play.control_dt
        self._steps = max(round(SEGMENT_SECONDS / play.control_dt), 2)
        rows = play.segment_starts(self._steps)
        self.rows = rows[_free_pucks(play, rows)]
        """First row of each segment (W,)."""
        if len(self.rows) < MIN_SEGMENTS:
            raise ValueError(
                f"fit: {len(self.rows)} segments of {SEGMENT_SECONDS} s are too few; "
                f"at least {MIN_SEGMENTS} are needed: record more steps (--steps), or "
                "pass more recordings"
            )
        kind = find_backend("numba")
        self._backend = kind(play.scene, len(self.rows), play.control_dt)

    def errors(self, usual: dict[str, float], values: Array) -> tuple[Array, Array]:
        """Return the distances (W, pucks) and (W, seats) from the recorded end, m.

        Args:
            usual: Default values of all parameters, by name.
            values: Values (5,) of `FITTED` and of the action delay, s.
        """
        play, count = self._play, len(self.rows)
        physics = {**usual, **dict(zip(FITTED, values, strict=False))}
        worlds = np.arange(count)
        columns = {name: np.full(count, value) for name, value in physics.items()}
        self._backend.set_physics(columns, worlds)
        state = play.scene.still_state(count)
        movers = play.position.shape[1]
        state.position[:, :movers] = play.position[self.rows]
        state.velocity[:, :movers] = play.velocity[self.rows]
        self._backend.reset(state, worlds)
        share, still = values[-1] / play.control_dt, Command.still(play.scene, count)
        for k in range(1, self._steps + 1):
            now, before = play.command[self.rows + k], play.command[self.rows + k - 1]
            velocity = (1 - share) * now + share * before
            state = self._backend.step(still._replace(velocity=velocity))
        offset = state.position[:, :movers] - play.position[self.rows + self._steps]
        distance = np.hypot(offset[..., 0], offset[..., 1])
        seats = len(play.scene.seats)
        return distance[:, seats:], distance[:, :seats]

    def mean_errors(
        self, usual: dict[str, float], values: Array
    ) -> tuple[float, float]:
        """Return the mean errors of pucks (capped at `MAX_ERROR`) and paddles, m."""
        pucks, paddles = self.errors(usual, values)
        return float(np.minimum(pucks, MAX_ERROR).mean()), float(paddles.mean())


def _free_pucks(play: RecordedPlay, rows: Array) -> Array:
    """Return True for segments (W,) in which no puck touches anything at the start.

    Contacts may take time where the play was recorded; on the 2D table they do not.
    """
    table, seats = play.scene.table, len(play.scene.seats)
    position = play.position[rows]
    pucks, paddles = position[:, seats:], position[:, :seats]
    gap = np.hypot(*np.moveaxis(pucks[:, :, None] - paddles[:, None], -1, 0))
    apart = (gap > table.paddle_radius + table.puck_radius).all((1, 2))
    room = np.einsum("wpd,kd->wpk", pucks, table.normals) + table.offsets
    return np.asarray(apart & (room > table.puck_radius).all((1, 2)))

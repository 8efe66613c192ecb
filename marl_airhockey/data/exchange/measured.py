"""Recordings of measured positions of a puck and a paddle."""

from __future__ import annotations

import pathlib
from dataclasses import dataclass
from typing import Any

import numpy as np

from marl_airhockey.data.exchange.measured_events import Path, fill_events
from marl_airhockey.data.exchange.settings import ImportSettings
from marl_airhockey.data.writer import RecordingWriter
from marl_airhockey.registry import REAL, make_scenario
from marl_airhockey.rollouts.columns import SENSED, STATE, scenario_of
from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.core.physics import Physics
from marl_airhockey.sim.core.recording import Columns, Recording
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.sim.core.state import RESULTS, Kind
from marl_airhockey.types import Array

BEYOND = 0.1
"""Largest distance of a measured body beyond the table's edge, m."""


@dataclass(frozen=True)
class Measured:
    """Measured episode of T + 1 rows."""

    time: Array
    """Times (T + 1,), s."""
    puck: Array | None
    """Positions of the puck (T + 1, 2), table frame, m; nan where it was not detected.
    None for a puck that was not measured and stays at the far end of the table."""
    paddle: Array
    """Positions of the paddle (T + 1, 2), table frame, m."""
    paddle_velocity: Array | None = None
    """Velocities of the paddle (T + 1, 2), table frame, m/s; None to differentiate the
    positions."""
    action: Array | None = None
    """Requested actions (T, 2), fractions of the top speed, ego frame; None to compute
    them from the velocities."""


def scenario_for(settings: ImportSettings) -> Scenario:
    """Return the scenario of an import.

    Raises:
        ValueError: The scenario has other bodies than one paddle and one puck.
    """
    scenario = make_scenario(settings.scenario, **settings.options)
    bodies = scenario.scene.bodies
    if bodies.kind != (Kind.PADDLE, Kind.PUCK):
        raise ValueError(
            f"{scenario.name}: expected a scenario with one paddle and one puck, for "
            "example juggle or touch"
        )
    return scenario


def recorded_scenario(path: pathlib.Path, head: dict[str, Any]) -> Scenario:
    """Return the scenario of a recording, which must have a puck.

    Raises:
        ValueError: The scenario has no puck.
    """
    scenario = scenario_of(Recording(path, head, []))
    if not scenario.scene.bodies.pucks:
        raise ValueError(f"{path}: there is no puck in {scenario.name}")
    return scenario


def measured_head(settings: ImportSettings, control_dt: float) -> dict[str, object]:
    """Return the metadata of a recording of measured episodes."""
    scenario = scenario_for(settings)
    known = {"control_dt": control_dt, "backend": REAL}
    cycles = round(scenario.seconds / control_dt)
    return {**settings.head("measured", known), "max_cycles": cycles, "physics": None}


def write_measured(
    writer: RecordingWriter,
    scenario: Scenario,
    found: Measured,
    more: Columns,
    reason: str,
) -> None:
    """Write a measured episode.

    Positions of a puck that was not detected are interpolated and marked as not
    visible. Velocities and contacts are computed from the positions, see
    `measured_events`.

    Args:
        writer: Writer of the recording.
        scenario: Scenario with one paddle and one puck.
        found: Measured episode.
        more: Further columns (T + 1, ...).
        reason: Reason for the end of the episode.

    Raises:
        ValueError: There are fewer than two rows, times do not increase, a body is off
            the table, or the puck is never detected.
    """
    rows = len(found.time)
    if rows < 2:
        raise ValueError(f"{rows} rows: expected two or more")
    steps = np.diff(found.time)
    if (steps <= 0).any():
        k = int(np.argmax(steps <= 0))
        raise ValueError(
            f"times must increase, but {found.time[k + 1]} s follows {found.time[k]} s"
        )
    puck, seen = _puck(scenario, found)
    half = scenario.scene.table.size / 2 + BEYOND
    for name, position in (("puck", puck), ("paddle", found.paddle)):
        if (np.abs(position) > half).any():
            row = int(np.argmax((np.abs(position) > half).any(1)))
            raise ValueError(
                f"row {row}: the {name} at {position[row].round(3).tolist()} m is off "
                f"the table {scenario.table!r}; expected metres from the centre of the "
                "table, which --option table=... selects"
            )
    columns = _state_columns(scenario, found, puck, seen)
    action = found.action
    if action is None:
        action = action_of(scenario, columns[STATE + "velocity"][1:, 0])
    steps = np.arange(1, rows) == rows - 1
    zeros = np.zeros((rows - 1, 1))
    writer.begin(
        {name: value[0] for name, value in {**columns, **more}.items()},
        physics=_physics(scenario),
    )
    writer.add_rows(
        {
            **{name: value[1:] for name, value in {**columns, **more}.items()},
            "action": action[:, None],
            "reward": zeros,
            "returns": zeros,
            "success": zeros.astype(bool),
            "terminated": np.zeros(rows - 1, bool),
            "truncated": steps,
        }
    )
    writer.end(reason)


def action_of(scenario: Scenario, velocity: Array) -> Array:
    """Return the actions (T, 2) that request velocities (T, 2), table frame, m/s."""
    seat = scenario.scene.seats[0]
    ego = velocity @ scenario.scene.table.rotation(seat.side).T
    return np.asarray(np.clip(ego / seat.speed, -1.0, 1.0))


def _puck(scenario: Scenario, found: Measured) -> tuple[Array, Array]:
    """Return positions of the puck (T + 1, 2), and True where it was detected."""
    rows = len(found.time)
    if found.puck is None:
        far = scenario.scene.table.size[0] / 2 - scenario.scene.table.puck_radius
        return np.tile([far, 0.0], (rows, 1)), np.zeros(rows, bool)
    seen = np.asarray(np.isfinite(found.puck).all(1))
    if not seen.any():
        raise ValueError("the puck is never detected")
    return interpolated(found.time, found.puck, seen), seen


def interpolated(time: Array, position: Array, seen: Array) -> Array:
    """Return positions (T, 2), interpolated in time where a body was not detected."""
    known = time[seen], position[seen]
    return np.stack([np.interp(time, known[0], known[1][:, k]) for k in range(2)], 1)


def _state_columns(
    scenario: Scenario, found: Measured, puck: Array, seen: Array
) -> Columns:
    """Return the columns (T + 1, ...) of states and of detections."""
    rows, time = len(found.time), found.time - found.time[0]
    states = scenario.scene.still_state(rows)
    moving = found.paddle_velocity
    if moving is None:
        moving = np.gradient(found.paddle, time, axis=0)
    states.position[:] = np.stack([found.paddle, puck], 1)
    states.velocity[:, 0], states.time[:] = moving, time
    if seen.sum() > 1:
        sighted = Path(time[seen], puck[seen])
        fill_events(states, scenario.scene, sighted, Path(time, found.paddle))
    state = {name: np.array(getattr(states, name)) for name in RESULTS}
    last = np.maximum.accumulate(np.where(seen, time, -np.inf))
    age = np.where(np.isfinite(last), time - last, 0.0)
    return {
        **{STATE + name: value for name, value in state.items()},
        f"{SENSED}position": state["position"],
        f"{SENSED}velocity": state["velocity"],
        f"{SENSED}visible": seen[:, None],
        f"{SENSED}age": age[:, None],
    }


def _physics(scenario: Scenario) -> dict[str, float]:
    """Return nominal physics parameters; those of the table are unknown."""
    physics = Physics(scenario.scene.defaults, arms=True, real=True)
    streams = RandomStreams.keyed(np.zeros(1, np.uint64), np.zeros(1, int), "physics")
    values = physics.draw(streams)
    return {name: float(value[0]) for name, value in values.items()}

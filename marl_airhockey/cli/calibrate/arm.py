"""Command ``airhockey calibrate arm``."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.table import Table

from marl_airhockey.cli.calibrate.motion import moving_arm, summarize
from marl_airhockey.cli.environment import LabOption
from marl_airhockey.cli.options import AsJson, console
from marl_airhockey.sim.core.errors import require
from marl_airhockey.sim.core.servo import HALF
from marl_airhockey.types import Array

if TYPE_CHECKING:
    from marl_airhockey.hardware.calibration.arm import ArmTrial

NAMES = "action_delay", "servo_time", "lag"
"""Quantities that are measured: two parameters of profiles, and the servo's lag."""


def arm(
    rig: Annotated[
        Path | None,
        typer.Option(help="Rig file of a real table: its devices and calibration."),
    ] = None,
    repeats: Annotated[
        int,
        typer.Option(
            help="Number of repetitions of each of the four motions; one takes about "
            "10 s.",
            min=1,
        ),
    ] = 2,
    plot: Annotated[
        Path | None,
        typer.Option(help="PNG file to write with a plot of gain and phase."),
    ] = None,
    lab: LabOption = False,
    as_json: AsJson = False,
) -> None:
    """Measure the dead time and the lag of an arm by steps and chirps.

    The arm moves along both axes of the table, by up to 8 cm to each side and with up
    to 0.4 m/s.
    """
    from marl_airhockey.hardware.calibration.arm import measure_arm

    with moving_arm(lab, rig, 4 * repeats) as (known, _, tell):
        trials = measure_arm(known, repeats, tell)
    values = {
        name: summarize(np.array([getattr(trial, name) for trial in trials]))
        for name in NAMES
    }
    if plot is not None:
        _plot(trials, values, plot)
    if as_json:
        rows = [vars(trial) for trial in trials]
        console.print_json(json.dumps({**values, "trials": rows}))
        return
    table = Table(
        "motion", "axis", "dead time, ms", "time to 50 %, ms", "model error, mm"
    )
    for trial in trials:
        found = trial.action_delay, trial.servo_time, trial.misfit
        cells = (f"{1e3 * value:.1f}" for value in found[:2])
        table.add_row(trial.motion, trial.axis, *cells, f"{1e3 * found[2]:.2f}")
    console.print(table)
    console.print(_in_words(trials))
    console.print(f'in the rig file: "servo": {{"lag": {values["lag"]["mean"]:.3f}}}')


def _response(trials: Sequence[ArmTrial]) -> dict[float, Array]:
    """Return the mean gain and phase (deg) of all chirps, by frequency (Hz)."""
    chirps = [trial.response for trial in trials if trial.response]
    return {f: np.mean([chirp[f] for chirp in chirps], 0) for f in chirps[0]}


def _in_words(trials: Sequence[ArmTrial]) -> str:
    """Return a text with gain and phase at each frequency."""
    parts = [
        f"{f:g} Hz: {gain:.2f}, {phase:.0f} deg"
        for f, (gain, phase) in _response(trials).items()
    ]
    return "gain and phase at " + "; ".join(parts)


def _plot(trials: Sequence[ArmTrial], values: dict[str, Any], path: Path) -> None:
    """Write a PNG with the measured gain and phase and those of the model."""
    require("matplotlib", "train")
    from marl_airhockey.sim.render.charts import panels, save, series

    f = np.linspace(0.5, 5.0, 200)
    # Both poles of a critically damped lag are at this frequency.
    angle = 2 * np.pi * f * values["servo_time"]["mean"] / HALF
    phase = -2 * np.arctan(angle) - 2 * np.pi * f * values["action_delay"]["mean"]
    model = (1 / (1 + angle**2), np.degrees(phase))
    figure, (grid,) = panels(1, 2, (7, 3.2))
    seen = _response(trials)
    labels = ("gain", "phase, degrees")
    name = f"measured, mean of n = {sum(bool(t.response) for t in trials)} chirps"
    for k, (axes, curve, label) in enumerate(zip(grid, model, labels, strict=True)):
        axes.plot(f, curve, color=series(0).colour, label="dead time and lag, fitted")
        points = [row[k] for row in seen.values()]
        axes.plot(seen.keys(), points, "s", color=series(1).colour, label=name)
        axes.set(xlabel="frequency, Hz", ylabel=label)
    save(figure, path, "Response of the arm")

"""Command ``airhockey calibrate delay``."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer
from rich.table import Table

from marl_airhockey.cli.calibrate.motion import moving_arm, summarize
from marl_airhockey.cli.environment import LabOption
from marl_airhockey.cli.options import AsJson, console
from marl_airhockey.sim.core.errors import require

if TYPE_CHECKING:
    from marl_airhockey.hardware.calibration.delay import Delays

NAMES = "camera", "arm", "round trip"
"""Names of the delays that are measured."""


def delay(
    rig: Annotated[
        Path | None,
        typer.Option(help="Rig file of a real table: its devices and calibration."),
    ] = None,
    trials: Annotated[
        int, typer.Option(help="Number of trials of one second.", min=5)
    ] = 200,
    plot: Annotated[
        Path | None, typer.Option(help="PNG file to write with the histograms.")
    ] = None,
    lab: LabOption = False,
    as_json: AsJson = False,
) -> None:
    """Measure the latency of the camera and of the arm by movements of the arm.

    The arm moves back and forth by 9 cm. If the camera is a v4l2 device, its mean
    latency and the times of its frames are written to the rig file.
    """
    from marl_airhockey.hardware.calibration.delay import measure_delays

    with moving_arm(lab, rig, trials) as (known, path, tell):
        found = measure_delays(known, trials, tell)
        if known.camera.startswith("v4l2:"):
            measured = replace(
                known,
                latency=float(found.camera.mean()),
                period=found.period,
                dropped=found.dropped,
            )
            measured.save(path)
    parts = found.camera, found.arm, found.round_trip
    rows = {name: summarize(part) for name, part in zip(NAMES, parts, strict=True)}
    if plot is not None:
        _plot(found, plot)
    if as_json:
        frames = {"period": found.period, "dropped": found.dropped}
        count = len(found.camera)
        console.print_json(json.dumps({"trials": count, **rows, **frames}))
        return
    table = Table("delay, ms", "mean", "sd", "least", "most")
    for name, row in rows.items():
        table.add_row(name, *(f"{1e3 * value:.1f}" for value in row.values()))
    console.print(table)
    console.print(
        f"{len(found.camera)} of {trials} trials; a frame every "
        f"{1e3 * found.period:.1f} ms, {found.dropped:.1%} did not arrive"
    )


def _plot(found: Delays, path: Path) -> None:
    """Write a PNG with the histograms of the delays."""
    require("matplotlib", "train")
    from marl_airhockey.sim.render.charts import panels, save, series

    figure, (grid,) = panels(1, 3, (9, 3.2))
    parts = (found.camera, found.arm, found.round_trip)
    for k, (axes, name, values) in enumerate(zip(grid, NAMES, parts, strict=True)):
        axes.hist(1e3 * np.asarray(values), bins=24, color=series(0).colour)
        mean, sd = 1e3 * np.mean(values), 1e3 * np.std(values)
        style = {"color": series(1).colour, "linestyle": "--"}
        axes.axvline(mean, label="mean" if k == 0 else "", **style)
        axes.set(xlabel=f"{name}, ms", title=f"{mean:.1f} ms, sd {sd:.1f} ms")
    grid[0].set_ylabel("trials")
    save(figure, path, f"Delays, n = {len(found.camera)} trials")

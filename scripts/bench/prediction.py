"""Compare measured positions of pucks after 0.1 .. 1 s with predicted ones.

    python scripts/bench/prediction.py --data starts.npz

The file has states of real pucks that were measured in play. The frame has its origin
in a corner of the table. Errors are medians and 90 % quantiles in mm. The arrays of the
file are:

* ``table`` (N,): name of the table,
* ``source`` (N,): file that a state is from,
* ``p0`` and ``v0`` (N, 2): position, m, and velocity, m/s,
* ``romega`` (N,): radius times spin, counter-clockwise, m/s,
* ``target`` (N, 4, 4): x, y, an unused value and the number of wall bounces after 0.1,
  0.25, 0.5 and 1 s; nan where it is unknown,
* ``planes`` (tables, 4): ends of x and of y of the puck's centre, for the tables in
  alphabetical order.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.table import Table as RichTable

from marl_airhockey.registry import find_backend
from marl_airhockey.sim.contracts.backend import Command
from marl_airhockey.sim.core.physics import Given, Physics
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.seat import make_seat
from marl_airhockey.sim.core.table import Table
from marl_airhockey.types import Array

HORIZONS = (0.1, 0.25, 0.5, 1.0)
DT = 0.05
PUCKS = {"pro": 0.0413, "wood": 0.03145}
"""Radii of the pucks, m."""
USUAL = {"pro": "professional", "wood": "wooden"}
"""Preset of each table."""
OLD = {
    **{"wall_restitution_slope": 0.0, "wall_friction": 0.0, "puck_drag": 0.0},
    **{"puck_damping": 0.15, "wall_restitution": 0.9, "tilt": 0.0},
}
"""Simple model: linear drag, constant restitution, no friction and no spin."""
BEST = {
    "pro": {"puck_damping": 0.049, "wall_restitution": 0.836},
    "wood": {"puck_damping": 0.137, "wall_restitution": 0.625},
}
"""Constants with which the simple model predicts best."""
FITTED = (
    *("puck_drag", "wall_restitution", "wall_restitution_slope", "wall_friction"),
    *("tilt", "cross_tilt"),
)
SCALES = (0.005, 0.03, 0.02, 0.05, 0.1, 0.1)
"""Initial steps of the search for each of `FITTED`."""
MAX_ERROR = 0.1
"""Largest error that counts in a fit, m. After an unobserved contact errors have no
bound."""

Errors = dict[str, dict[str, dict[str, float]]]


@dataclass
class Starts:
    """Measured states of one table."""

    name: str
    source: Array
    position: Array
    velocity: Array
    edge: Array
    """Radius times spin, m/s, (N,)."""
    target: Array
    planes: Array

    @staticmethod
    def load(path: Path) -> list[Starts]:
        """Return the tables of a file."""
        with np.load(path) as file:
            data = {name: file[name] for name in file.files}
        found = []
        for row, name in enumerate(np.unique(data["table"]).tolist()):
            rows = data["table"] == name
            starts = Starts(
                name=name,
                source=data["source"][rows],
                position=data["p0"][rows],
                velocity=data["v0"][rows],
                edge=data["romega"][rows],
                target=data["target"][rows],
                planes=np.atleast_2d(data["planes"])[row],
            )
            found.append(starts)
        return found

    def take(self, rows: Array) -> Starts:
        """Return some of the states."""
        return replace(
            self,
            source=self.source[rows],
            position=self.position[rows],
            velocity=self.velocity[rows],
            edge=self.edge[rows],
            target=self.target[rows],
        )


class Predictor:
    """Simulation of all states of a table in one batch, with one world for each state.

    Args:
        starts: Measured states.
    """

    def __init__(self, starts: Starts) -> None:
        self._starts, (x0, x1, y0, y1) = starts, starts.planes
        radius, self._middle = PUCKS[starts.name], np.array([x0 + x1, y0 + y1]) / 2
        corners = Table.rectangle(x1 - x0 + 2 * radius, y1 - y0 + 2 * radius).vertices
        table = Table(corners, puck_radius=radius)
        self._scene = Scene(table, (make_seat("arcade", table, 0),), pucks=1)
        self._worlds = len(starts.position)
        self._backend = find_backend("numba")(self._scene, self._worlds, DT)

    def errors(self, physics: Given, spins: bool = True) -> Array:
        """Return the distances from the measured positions, m, (N, horizons).

        Args:
            physics: Physics parameters.
            spins: True to begin with the measured spin, False to begin without spin.
        """
        values = {
            n: v for n, (v, _) in Physics({"tilt": 0.0}, given=physics).ranges.items()
        }
        everywhere, starts = np.arange(self._worlds), self._starts
        columns = {n: np.full(self._worlds, v) for n, v in values.items()}
        self._backend.set_physics(columns, everywhere)
        state = self._scene.still_state(self._worlds)
        state.position[:, 0] = (0.0, 100.0)
        state.position[:, 1] = starts.position - self._middle
        state.velocity[:, 1] = starts.velocity
        state.spin[:, 1] = starts.edge / PUCKS[starts.name] * spins
        self._backend.reset(state, everywhere)
        still, found = Command.still(self._scene, self._worlds), []
        for step in range(1, round(HORIZONS[-1] / DT) + 1):
            state = self._backend.step(still)
            if any(abs(step * DT - horizon) < 1e-9 for horizon in HORIZONS):
                found.append(state.puck[:, 0] + self._middle)
        offset = np.stack(found, 1) - starts.target[..., :2]
        return np.asarray(np.hypot(offset[..., 0], offset[..., 1]))


def summarise(starts: Starts, errors: Array) -> Errors:
    """Return median, 90 % quantile (mm) and number of errors by kind and horizon."""
    banks = starts.target[..., 3]
    summary: Errors = {}
    for kind, rows in (("banked", banks > 0), ("free", banks == 0)):
        summary[kind] = {}
        for h, horizon in enumerate(HORIZONS):
            some = 1e3 * errors[rows[:, h] & np.isfinite(errors[:, h]), h]
            if len(some):
                summary[kind][f"{horizon:g}"] = {
                    "median_mm": float(np.median(some)),
                    "p90_mm": float(np.quantile(some, 0.9)),
                    "n": len(some),
                }
    return summary


def fit(starts: Starts) -> dict[str, float]:
    """Return the physics parameters that predict some states best."""
    from scipy.optimize import minimize

    predictor = Predictor(starts)
    usual = Physics({"tilt": 0.0}, given=USUAL[starts.name]).ranges
    first = np.array([usual[name][0] for name in FITTED])

    def physics(values: Array) -> dict[str, Any]:
        named = dict(
            zip(FITTED, np.maximum(values, (0, 0, -0.2, 0, -45, -45)), strict=True)
        )
        return {"preset": USUAL[starts.name], **{n: float(v) for n, v in named.items()}}

    def loss(values: Array) -> float:
        errors = predictor.errors(physics(values))[:, 1:3]
        return float(np.nanmean(np.minimum(errors, MAX_ERROR)))

    steps = np.vstack([first, first + np.diag(SCALES)])
    options = {"initial_simplex": steps, "maxfev": 300, "xatol": 1e-4, "fatol": 1e-7}
    found = minimize(loss, first, method="Nelder-Mead", options=options)
    return physics(found.x)


def cross_validated(starts: Starts) -> Array:
    """Return errors of states by physics fitted to the other half of the sources."""
    names = np.unique(starts.source)
    fold = np.isin(starts.source, names[::2])
    errors = np.full((len(fold), len(HORIZONS)), np.nan)
    for here in (fold, ~fold):
        errors[here] = Predictor(starts.take(here)).errors(fit(starts.take(~here)))
    return errors


def main(
    data: Annotated[Path, typer.Option(help="File of measured states, .npz.")],
    physics: Annotated[
        str | None,
        typer.Option(
            help="Preset or TOML file of the physics; by default that of the table."
        ),
    ] = None,
    fitted: Annotated[
        bool, typer.Option("--fit", help="Fit the physics in two folds by source.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Print errors of predictions, without --json also those of the simple model."""
    results: dict[str, Errors] = {}
    shown = RichTable(
        "", "kind", *(f"{h:g} s" for h in HORIZONS), title="mm, median / 90 %"
    )
    for starts in Starts.load(data):
        predictor, name = Predictor(starts), starts.name
        if fitted:
            rows = {"fitted to the other half": cross_validated(starts)}
        else:
            chosen = physics or USUAL[name]
            rows = {chosen: predictor.errors(chosen)}
        results[name] = summarise(starts, next(iter(rows.values())))
        if not as_json:
            rows["without initial spin"] = predictor.errors(
                physics or USUAL[name], False
            )
            rows["simple model, best constants"] = predictor.errors(OLD | BEST[name])
            rows["simple model, defaults"] = predictor.errors(OLD)
        for law, errors in rows.items():
            for kind, cells in summarise(starts, errors).items():
                numbers = [cells.get(f"{h:g}", {}) for h in HORIZONS]
                texts = [
                    f"{c['median_mm']:.1f} / {c['p90_mm']:.0f}" if c else ""
                    for c in numbers
                ]
                shown.add_row(f"{name}: {law}", kind, *texts)
    if as_json:
        print(json.dumps(results))
    else:
        Console(width=110).print(shown)


if __name__ == "__main__":
    typer.run(main)

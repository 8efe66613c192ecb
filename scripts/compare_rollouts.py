"""Compare rollouts of this tree with those of another checkout, number by number.

    python scripts/compare_rollouts.py CHECKOUT

plays 200 steps of 3 worlds of every scenario and profile with random actions, in a
process for each tree: numba must give the same bits, pymunk the same numbers to 1e-9.
The checkout is taken as of commit ec48060, whose backend of that kind was called
batched. Exits with 1 if anything differs.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

import marl_airhockey as ah

WORLDS, STEPS = 3, 200
PROFILES = ("ideal", "ur5e")
TOLERANCE = {"numba": 0.0, "pymunk": 1e-9}
ON_PURPOSE = {"free_for_all": 1e-15}
"""Paddles beside a retired one: their acceleration, and so a cost, is rounded anew."""
PLAY = """
import sys
import numpy as np
import marl_airhockey as ah

scenario, backend, profile, worlds, steps, path = sys.argv[1:]
if backend == "numba" and "batched" in ah.backend_names():
    backend = "batched"
world = ah.make_world(scenario, int(worlds), backend=backend, profile=profile)
rng, first = np.random.default_rng(0), world.reset(0)
found = {"observation": [first], "position": [world.state.position.copy()]}
for _ in range(int(steps)):
    step = world.step(rng.uniform(-1, 1, (int(worlds), len(world.open), 2)))
    rows = {name: getattr(step, name) for name in (
        "observation", "reward", "terminated", "truncated", "success", "cost")}
    rows |= {f"term {name}": term for name, term in step.terms.items()}
    state = world.state
    rows |= {"position": state.position, "velocity": state.velocity}
    memory = {{"met": "any_touch"}.get(k, k): v for k, v in world.memory.items()}
    rows |= {f"memory {name}": row for name, row in memory.items()}
    for name, row in rows.items():
        found.setdefault(name, []).append(np.array(row))
np.savez(path, **{name: np.stack(rows) for name, rows in found.items()})
"""


def play(
    tree: Path, scenario: str, backend: str, profile: str
) -> dict[str, np.ndarray]:
    """Return what a rollout in a tree gave, by name, (steps, worlds, ...) each."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rollout.npz"
        words = [scenario, backend, profile, str(WORLDS), str(STEPS), str(path)]
        environment = {**os.environ, "PYTHONPATH": str(tree)}
        command = [sys.executable, "-c", PLAY, *words]
        subprocess.run(command, check=True, cwd=folder, env=environment)
        with np.load(path) as file:
            return dict(file)


def difference(here: dict[str, np.ndarray], there: dict[str, np.ndarray]) -> float:
    """Return the largest difference of what both rollouts hold; inf if one has more."""
    if here.keys() != there.keys():
        return float("inf")
    worst = 0.0
    for name, mine in here.items():
        other = there[name]
        if mine.shape != other.shape:
            return float("inf")
        # Equal infinities and nans are no difference.
        same = (mine == other) | ((mine != mine) & (other != other))
        gap = np.abs(mine[~same].astype(float) - other[~same].astype(float))
        worst = max(worst, float(np.nan_to_num(gap, nan=np.inf).max(initial=0.0)))
    return worst


def main(checkout: Path, only: str = "") -> None:
    """Play both trees and print the largest difference of each rollout."""
    table = Table("scenario", *(f"{b}, {p}" for b in TOLERANCE for p in PROFILES))
    wrong, trees = 0, (Path(__file__).parents[1], checkout.resolve())
    for scenario in [s for s in ah.scenario_names() if only in s]:
        cells = []
        for backend, tolerance in TOLERANCE.items():
            for profile in PROFILES:
                one, two = (play(t, scenario, backend, profile) for t in trees)
                gap = difference(one, two)
                wrong += gap > max(tolerance, ON_PURPOSE.get(scenario, 0.0))
                cells.append("same bits" if gap == 0.0 else f"{gap:.1e}")
        table.add_row(scenario, *cells)
    Console(width=100).print(table)
    if wrong:
        raise SystemExit(f"{wrong} rollouts differ by more than they may")


if __name__ == "__main__":
    typer.run(main)

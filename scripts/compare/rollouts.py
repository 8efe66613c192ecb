"""Compare rollouts of this checkout with those of another one, number by number.

    python scripts/compare/rollouts.py CHECKOUT

The script plays 200 steps of 3 worlds of every scenario with random actions. It does so
in all profiles and observation types, with goals="dict", and with a driver of paddle_0
where the scenario supports it. Each checkout and scenario has a separate process. numba
must give the same bits, and pymunk the same numbers to 1e-9. The exit status is 1 if
anything differs.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

import marl_airhockey as ah
from marl_airhockey.sim.contracts.scenario import GoalScenario

WORLDS, STEPS = 3, 200
TOLERANCE = {"numba": 0.0, "pymunk": 1e-9}
CASES: dict[str, dict[str, Any]] = {
    "ideal": {},
    "history": {"observe": "history"},
    "ur5e": {"profile": "ur5e"},
    "ur5e estimate": {"profile": "ur5e", "observe": "estimate"},
    "calibrated estimate": {"profile": "ur5e-calibrated", "observe": "estimate"},
    "authors": {"profile": "ur5e-authors"},
    "gantry": {"profile": "gantry"},
    "pixels": {"profile": "ur5e", "observe": "pixels"},
    "ur5e driven": {"profile": "ur5e", "drivers": {"paddle_0": "random"}},
    "dict": {"goals": "dict"},
    "ur5e dict": {"profile": "ur5e", "goals": "dict"},
}
"""Keywords by name of the case."""
PLAY = """
import json, sys
import numpy as np
import marl_airhockey as ah

scenario, backend, cases, worlds, steps, path = sys.argv[1:]

def play(keywords):
    world = ah.make_world(scenario, int(worlds), backend=backend, **keywords)
    rng, first = np.random.default_rng(0), world.reset(0)
    found = {"position": [world.state.position.copy()]}
    def note(rows):
        for name, row in rows.items():
            found.setdefault(name, []).append(np.array(row))
    def seen(observation):
        if isinstance(observation, np.ndarray):
            return {"observation": observation}
        return {f"observation {k}": v for k, v in observation.items()}
    note(seen(first))
    for k in range(int(steps)):
        step = world.step(rng.uniform(-1, 1, (int(worlds), len(world.open), 2)))
        names = "reward", "terminated", "truncated", "success", "cost", "applied_action"
        note({name: getattr(step, name) for name in names})
        note(seen(step.observation))
        note({f"term {name}": term for name, term in step.terms.items()})
        state = world.state
        note({"position": state.position, "velocity": state.velocity})
        note({f"memory {name}": row for name, row in world.memory.items()})
        if k == int(steps) // 2:
            note(seen(world.set_state(*world.get_state())))
    return {name: np.stack(rows) for name, rows in found.items()}

rows = {}
for name, keywords in json.loads(cases).items():
    rows |= {f"{name}: {key}": array for key, array in play(keywords).items()}
np.savez(path, **rows)
"""


def cases_of(scenario: str) -> dict[str, dict[str, Any]]:
    """Return the cases that a scenario supports."""
    game, found = ah.make_scenario(scenario), dict(CASES)
    if not isinstance(game, GoalScenario):
        found = {name: words for name, words in found.items() if "goals" not in words}
    if len(game.scene.seats) == 1:
        del found["ur5e driven"]
    return found


def play(tree: Path, scenario: str, backend: str) -> dict[str, np.ndarray]:
    """Return the rollouts of a checkout, by case and name, (steps, worlds, ...)."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rollout.npz"
        cases = json.dumps(cases_of(scenario))
        words = [scenario, backend, cases, str(WORLDS), str(STEPS), str(path)]
        environment = {**os.environ, "PYTHONPATH": str(tree)}
        command = [sys.executable, "-c", PLAY, *words]
        subprocess.run(command, check=True, cwd=folder, env=environment)
        with np.load(path) as file:
            return dict(file)


def difference(here: dict[str, np.ndarray], there: dict[str, np.ndarray]) -> float:
    """Return the largest difference of two rollouts; inf if one has more arrays."""
    if here.keys() != there.keys():
        return float("inf")
    worst = 0.0
    for name, mine in here.items():
        other = there[name]
        if mine.shape != other.shape:
            return float("inf")
        # Equal infinities and nans do not differ.
        same = (mine == other) | ((mine != mine) & (other != other))
        gap = np.abs(mine[~same].astype(float) - other[~same].astype(float))
        worst = max(worst, float(np.nan_to_num(gap, nan=np.inf).max(initial=0.0)))
    return worst


def main(checkout: Path, only: str = "") -> None:
    """Play both checkouts and print the largest difference of each case."""
    wrong, trees = 0, (Path(__file__).parents[2], checkout.resolve())
    for backend, tolerance in TOLERANCE.items():
        table = Table(f"{backend}", *CASES)
        for scenario in [s for s in ah.scenario_names() if only in s]:
            one, two = (play(tree, scenario, backend) for tree in trees)
            cells = []
            for case in CASES:
                rows = [
                    {k: v for k, v in tree.items() if k.startswith(f"{case}: ")}
                    for tree in (one, two)
                ]
                gap = difference(*rows)
                wrong += gap > tolerance
                equal = "equal" if rows[0] else "-"
                cells.append(equal if gap == 0.0 else f"{gap:.1e}")
            table.add_row(scenario, *cells)
        Console(width=120).print(table)
    if wrong:
        raise SystemExit(f"{wrong} rollouts differ by more than the tolerance")


if __name__ == "__main__":
    typer.run(main)

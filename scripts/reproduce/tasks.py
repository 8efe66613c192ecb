"""Train every task with its preset over several seeds and save the rows.

    python scripts/reproduce/tasks.py --seeds 5 --jobs 2
    python scripts/reproduce/tasks.py --profile ur5e --seeds 3 --jobs 2
    python scripts/reproduce/tasks.py --profile ur5e --variant truth --seeds 2
    python scripts/reproduce/tasks.py --profile ur5e --variant 60hz --tasks juggle

A finished run adds a row to ``docs/data/tasks.csv`` and its curve to
``docs/data/curves.csv``. A run that has a row is not trained again unless its settings
have changed, so the script can be interrupted. ``--again`` trains all runs, for example
after a change of physics or rules. ``--rows FILE`` writes the rows to another file.
`task_tables.py` prints the tables of these rows.

Success is that of the last policy, without selection of a checkpoint, over the test
seeds, which training never uses. It is measured on the numba backend of the training,
on pymunk, with the arm of robosuite, and with an additional action latency of one
control step. The variant "truth" has the physics and the servo of a profile but
observes the true state. It shows the cost of sensing.
"""

from __future__ import annotations

import dataclasses
import hashlib
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from rows import DATA, Again, Book, Row, RowsFile, read, run_folder, write

from marl_airhockey.data.benchmark.catalogue import TASKS
from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.learn.ppo_config import PPOConfig, preset
from marl_airhockey.learn.train import run_training
from marl_airhockey.policies.load import load_policy
from marl_airhockey.sim.sensing.simulated_camera import SENSED
from marl_airhockey.sim.world.keywords import Keywords

EPISODES, SLOW_EPISODES = 2000, 200
"""Number of episodes that measure a policy, and of those on the slower backends."""
THRESHOLDS = (0.5, 0.9, 0.95)
"""Levels of success for which the CPU time is reported."""
VARIANTS: dict[str, dict[str, Any]] = {
    "": {},
    "truth": {"observe": "velocity", "physics": dict.fromkeys(SENSED, 0.0)},
    # The same horizon and the same time in a rollout as at 20 Hz.
    "60hz": {"control_dt": 1 / 60, "gamma": 0.9967, "gae_lambda": 0.983, "n_steps": 96},
}
"""Settings that replace those of a preset, by the name of the variant."""
KEY = ("task", "profile", "variant", "seed")
CURVE = {
    "steps": "steps",
    "cpu_seconds": "learning_cpu_seconds",
    "success": "success",
}
"""Columns of the committed curves, and of the ``evaluations.csv`` of a run."""
Rows = list[Row]


def config_of(task: str, profile: str, variant: str, seed: int) -> PPOConfig:
    """Return the preset of a task in a profile, with the changes of a variant."""
    changes = {"profile": profile, "seed": seed, **VARIANTS[variant]}
    if variant == "truth":  # There is no sensing, so the preset is that of ideal.
        return dataclasses.replace(preset(task), **changes)
    return preset(task, changes)


def recipe(config: PPOConfig) -> str:
    """Return a short name of all settings except the seed.

    Settings with their default are omitted. New settings and new defaults of unused
    settings therefore do not change the name.
    """
    usual = {f.name: _default(f) for f in dataclasses.fields(config)}
    settings = {
        name: value
        for name, value in dataclasses.asdict(config).items()
        if name != "seed" and value not in ({}, usual[name])
    }
    return hashlib.sha256(repr(sorted(settings.items())).encode()).hexdigest()[:8]


def _default(field: dataclasses.Field[Any]) -> Any:
    factory = field.default_factory
    return field.default if factory is dataclasses.MISSING else factory()


def train_seed(
    folder: Path, task: str, profile: str, variant: str, seed: int, name: str
) -> tuple[Row, Rows]:
    """Train one seed, measure its last policy; return its row and those of its curve.

    Args:
        folder: Folder of all runs. An interrupted run is resumed.
        task: Name of the task.
        profile: Name of the profile.
        variant: Name of the variant.
        seed: Seed of the run.
        name: Name of the settings, see `recipe`.
    """
    config = config_of(task, profile, variant, seed)
    folder /= "-".join(filter(None, (task, profile, variant, str(seed), name)))
    run_training(None if (folder / "config.toml").exists() else config, folder)
    values = config.scenario, config.profile, variant, config.seed
    key = dict(zip(KEY, values, strict=True))
    row: Row = {**key, "recipe": recipe(config), **measure(config, folder)}
    curve = read(folder / "evaluations.csv")
    row["cpu_minutes"] = round(float(curve[-1]["learning_cpu_seconds"]) / 60, 2)
    row["cpu_minutes_all"] = round(float(curve[-1]["cpu_seconds"]) / 60, 2)
    row["steps"] = int(curve[-1]["steps"])
    for level in THRESHOLDS:
        reached = [c for c in curve if float(c["success"]) >= level]
        times = [float(c["learning_cpu_seconds"]) for c in reached]
        row[f"cpu_seconds_to_{level}"] = round(times[0], 1) if times else ""
    points = [
        {n: round(float(c[column]), 3) for n, column in CURVE.items()} for c in curve
    ]
    return row, [{**key, **point} for point in points]


def measure(config: PPOConfig, folder: Path) -> Row:
    """Return the success of the last policy of a run in all cases, by column."""
    usual = config.keywords
    late: Keywords = {
        **usual,
        "physics": {**config.physics, "action_delay": config.control_dt},
    }
    cases: dict[str, tuple[bool, int, Keywords]] = {
        "success": (True, EPISODES, usual),
        "sampled": (False, EPISODES, usual),
        "pymunk": (True, SLOW_EPISODES, {**usual, "backend": "pymunk"}),
        "arm": (True, SLOW_EPISODES, {**usual, "backend": "robosuite"}),
        "delayed": (True, EPISODES, late),
    }
    row: Row = {}
    for name, (mean, episodes, keywords) in cases.items():
        policy = load_policy(folder / "last.npz", deterministic=mean)
        found = evaluate(
            policy,
            config.scenario,
            episodes=episodes,
            name=name,
            exact=True,
            **keywords,
        )
        row[name] = round(found.success, 4)
        if name == "success":
            row["first_shot"] = round(found.first_shot, 4)
    return row


BOOK = Book(DATA / "tasks.csv", (*KEY, "recipe"))


def run_of(row: Row) -> tuple[str, ...]:
    """Return the values that identify the run of a row."""
    return tuple(str(row[name]) for name in KEY)


def keep(path: Path, new: Rows) -> None:
    """Write rows into a file in place of those of the same runs, in order."""
    runs = {run_of(row) for row in new}
    rows = [row for row in read(path) if run_of(row) not in runs] + new
    # The sort is stable, so the points of a curve stay in order.
    write(path, sorted(rows, key=run_of))


def main(
    tasks: Annotated[
        str, typer.Option(help="Names of tasks, separated by commas.")
    ] = ",".join(TASKS),
    seeds: Annotated[int, typer.Option(help="Number of seeds, from 0.")] = 5,
    profile: Annotated[
        str, typer.Option(help="Name of the profile, such as ur5e.")
    ] = "ideal",
    variant: Annotated[
        str, typer.Option(help="Name of the variant: truth, 60hz, or none by default.")
    ] = "",
    jobs: Annotated[int, typer.Option(help="Number of processes.")] = 2,
    out: Annotated[Path, typer.Option(help="Folder of the runs.")] = Path("runs/tasks"),
    again: Again = False,
    rows: RowsFile = None,
) -> None:
    """Train tasks and save their rows and curves."""
    book = BOOK.at(rows)
    runs = [(n, profile, variant, s) for s in range(seeds) for n in tasks.split(",")]
    cells = [(*run, recipe(config_of(*run))) for run in runs]

    def kept(found: tuple[Row, Rows]) -> None:
        keep(book.path, [found[0]])
        curves = "curves.csv" if rows is None else f"{rows.stem}_curves.csv"
        keep(book.path.with_name(curves), found[1])

    work = partial(train_seed, run_folder(out, again))
    book.fill(book.missing(cells, again), work, jobs, kept)


if __name__ == "__main__":
    typer.run(main)

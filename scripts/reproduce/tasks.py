"""Train every task with its preset over several seeds, keep the rows.

    python scripts/reproduce/tasks.py --seeds 5 --jobs 2
    python scripts/reproduce/tasks.py --profile ur5e --seeds 5 --jobs 2
    python scripts/reproduce/tasks.py --profile ur5e --variant truth --seeds 2
    python scripts/reproduce/tasks.py --profile ur5e --variant 60hz --tasks juggle

Each run that ends adds a row to ``docs/data/tasks.csv`` and its curve to
``docs/data/curves.csv``. A run whose row is there is not trained again, unless its
settings have changed since, so the script can be stopped and started; ``--again``
trains all, as after a change of physics or rules, and ``--rows FILE`` keeps the rows
elsewhere. `task_tables.py` prints the tables of these rows.

Success is that of the last policy (no checkpoint is picked) over the test seeds, which
training never sees: on the numba backend that it was trained on, on pymunk, with the
arm of robosuite, and with one control step more of action delay. The variant "truth"
has a profile's physics and servo but observes the true state: what sensing costs.
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
"""Episodes by which a policy is measured, and on the slower backends"""
THRESHOLDS = (0.5, 0.9, 0.95)
"""Levels of success to which the CPU time is reported"""
VARIANTS: dict[str, dict[str, Any]] = {
    "": {},
    "truth": {"observe": "velocity", "physics": dict.fromkeys(SENSED, 0.0)},
    # The same horizon and the same time in a rollout as at 20 Hz.
    "60hz": {"control_dt": 1 / 60, "gamma": 0.9967, "gae_lambda": 0.983, "n_steps": 96},
}
"""Settings that replace a preset's, by the name of the variant"""
KEY = ("task", "profile", "variant", "seed")
CURVE = {
    "steps": "steps",
    "cpu_seconds": "learning_cpu_seconds",
    "success": "success",
}
"""Columns of the committed curves, and of a run's ``evaluations.csv``"""
Rows = list[Row]


def config_of(task: str, profile: str, variant: str, seed: int) -> PPOConfig:
    """Return the preset of a task in a profile, with what a variant changes."""
    changes = {"profile": profile, "seed": seed, **VARIANTS[variant]}
    if variant == "truth":  # Nothing is sensed, so the preset is that of ideal.
        return dataclasses.replace(preset(task), **changes)
    return preset(task, changes)


def recipe(config: PPOConfig) -> str:
    """Return a short name of all settings but the seed.

    Those at their defaults are left out, so that neither another setting nor another
    default of one that does not matter here changes a name.
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
        folder: Folder of all runs; one that was cut off is gone on with.
        task: Task.
        profile: Profile.
        variant: Name of what it changes.
        seed: Seed.
        name: Name of its settings, see `recipe`.
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
    """Return the success of a run's last policy in all cases, by the column's name."""
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
    """Return what tells the runs of rows apart."""
    return tuple(str(row[name]) for name in KEY)


def keep(path: Path, new: Rows) -> None:
    """Put rows into a file in place of those of the same runs, in order."""
    runs = {run_of(row) for row in new}
    rows = [row for row in read(path) if run_of(row) not in runs] + new
    write(path, sorted(rows, key=run_of))  # Stable: a curve's points stay in order.


def main(
    tasks: Annotated[str, typer.Option(help="Comma-separated tasks.")] = ",".join(
        TASKS
    ),
    seeds: Annotated[int, typer.Option(help="Number of seeds, from 0.")] = 5,
    profile: Annotated[str, typer.Option(help="ideal, ur5e, gantry.")] = "ideal",
    variant: Annotated[str, typer.Option(help="None, truth or 60hz.")] = "",
    jobs: Annotated[int, typer.Option(help="Number of processes.")] = 2,
    out: Annotated[Path, typer.Option(help="Folder of the runs.")] = Path("runs/tasks"),
    again: Again = False,
    rows: RowsFile = None,
) -> None:
    """Train tasks and keep their rows, and their curves beside them."""
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

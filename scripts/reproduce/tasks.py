"""Train every task with its preset over several seeds, keep the rows, print the table.

    python scripts/reproduce/tasks.py --seeds 5 --jobs 2
    python scripts/reproduce/tasks.py --profile ur5e --seeds 5 --jobs 2
    python scripts/reproduce/tasks.py --profile ur5e --variant truth --seeds 2
    python scripts/reproduce/tasks.py --profile ur5e --variant 60hz --tasks juggle

Each run that ends adds a row to ``docs/data/tasks.csv`` and its curve to
``docs/data/curves.csv``. A run whose row is there is not trained again, unless its
settings have changed since, so the script can be stopped and started; delete the rows
after a change of physics or rules. ``--seeds 0`` trains nothing and prints the table.

Success is that of the last policy (no checkpoint is picked) over the test seeds, which
training never sees: on the numba backend that it was trained on, on pymunk, with the
arm of robosuite, and with one control step more of action delay. The variant "truth"
has a profile's physics and servo but sees the true state: what sensing costs. The
paper's column is the row of Table I for RL in its 2D simulator (arXiv 2405.03113),
under the paper's own rules and physics.
"""

from __future__ import annotations

import csv
import dataclasses
import hashlib
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from marl_airhockey import make_agent
from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.evaluation.stats import interval
from marl_airhockey.learn.plots import plot_seed_curves
from marl_airhockey.learn.ppo_config import PPOConfig, preset
from marl_airhockey.learn.train import run_training
from marl_airhockey.policies.load import load_policy
from marl_airhockey.sensing.simulated_camera import SENSED
from marl_airhockey.world.build import Keywords

PAPER = {
    "reach": 1.0,
    "reach_velocity": 1.0,
    "touch": 1.0,
    "strike": 1.0,
    "strike_crowd": 1.0,
    "juggle": 1.0,
    "puck_velocity": 1.0,
    "move_block": 0.0,
    "hit_goal": 0.9,
    "hit_goal_velocity": 0.0,
}
"""Success of RL in the paper, by task"""
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
DATA = Path(__file__).parents[2] / "docs" / "data"
"""Folder of the committed rows"""
KEY = ("task", "profile", "variant", "seed")
HEADERS = (
    *("task", "success", "worst seed", "95 % interval", "sampled", "first shot"),
    *("on pymunk", "with the arm", "delayed", "CPU-min", "M steps"),
    *("CPU-s to .5 / .9 / .95", "still", "random", "sticky", "paper's RL"),
)
CURVE = {
    "steps": "steps",
    "cpu_seconds": "learning_cpu_seconds",
    "success": "success",
}
"""Columns of the committed curves, and of a run's ``evaluations.csv``"""
Row = dict[str, Any]
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


def train_seed(config: PPOConfig, variant: str, folder: Path) -> tuple[Row, Rows]:
    """Train one seed, measure its last policy; return its row and those of its curve.

    Args:
        config: of the run.
        variant: name of what it changes.
        folder: of the run; one that was cut off is gone on with.
    """
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


def read(path: Path) -> Rows:
    """Return the rows of a CSV file; none if there is no file."""
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def keep(path: Path, new: Rows) -> None:
    """Put rows into a CSV file in place of those of the same runs, in order."""
    runs = {run_of(row) for row in new}
    rows = [row for row in read(path) if run_of(row) not in runs] + new
    rows.sort(key=run_of)  # Stable: a curve's points stay in order.
    draft = path.with_suffix(".part")
    with draft.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(new[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    draft.replace(path)


def run_of(row: Row) -> tuple[str, ...]:
    """Return what tells the runs of rows apart."""
    return tuple(str(row[name]) for name in KEY)


def floors(task: str, keywords: Keywords) -> dict[str, float]:
    """Return the success of drivers without skill, by name."""
    return {
        name: evaluate(
            make_agent(name),
            task,
            episodes=EPISODES,
            seed=0,
            name=name,
            exact=True,
            **keywords,
        ).success
        for name in ("still", "random", "sticky")
    }


def main(
    tasks: Annotated[str, typer.Option(help="Comma-separated scenarios.")] = ",".join(
        PAPER
    ),
    seeds: Annotated[int, typer.Option(help="Seeds 0 .. n - 1; 0: print only.")] = 5,
    profile: Annotated[str, typer.Option(help="ideal, ur5e, gantry.")] = "ideal",
    variant: Annotated[str, typer.Option(help="None, truth or 60hz.")] = "",
    jobs: Annotated[int, typer.Option(help="Processes at once.")] = 2,
    out: Annotated[Path, typer.Option(help="Folder of the runs.")] = Path("runs/tasks"),
    markdown: Annotated[Path | None, typer.Option(help="Write the table here.")] = None,
    curves: Annotated[Path | None, typer.Option(help="Draw the curves here.")] = None,
) -> None:
    """Train tasks, keep their rows, print the table of all rows there are."""
    names, console = tasks.split(","), Console()
    configs = [config_of(n, profile, variant, s) for s in range(seeds) for n in names]
    kept = {(*run_of(row), row["recipe"]) for row in read(DATA / "tasks.csv")}
    DATA.mkdir(exist_ok=True)
    with ProcessPoolExecutor(jobs, max_tasks_per_child=1) as pool:
        futures = []
        for config in configs:
            run = (config.scenario, profile, variant, str(config.seed))
            if (*run, recipe(config)) not in kept:
                folder = out / "-".join([*filter(None, run), recipe(config)])
                futures.append(pool.submit(train_seed, config, variant, folder))
        for future in as_completed(futures):
            if future.exception() is not None:  # Do not wait for all the others.
                pool.shutdown(cancel_futures=True)
            row, curve = future.result()
            keep(DATA / "tasks.csv", [row])
            keep(DATA / "curves.csv", curve)
            console.print(row)
    rows = [row for row in read(DATA / "tasks.csv") if row["profile"] == profile]
    others = sorted({row["variant"] for row in rows} - {variant}) if not variant else []
    headers = (*HEADERS, *others)
    table = Table(*headers, title=f"{profile} profile {variant}, {EPISODES} episodes")
    lines = []
    for name in names:
        found = [of_variant(rows, name, v) for v in (variant, *others)]
        if found[0]:
            beside = (f"{mean(r, 'success'):.3f}" if r else "-" for r in found[1:])
            keywords = config_of(name, profile, variant, 0).keywords
            lines.append((*line(name, found[0], floors(name, keywords)), *beside))
            table.add_row(*lines[-1])
    console.print(table)
    if markdown is not None:
        ruled = [headers, ("---",) * len(headers), *lines]
        text = "".join(f"| {' | '.join(cells)} |\n" for cells in ruled)
        markdown.write_text(text)
    if curves is not None:
        points = [p for p in read(DATA / "curves.csv") if p["profile"] == profile]
        plot_seed_curves({n: runs_of(points, n, variant) for n in names}, curves)


def of_variant(rows: Rows, task: str, variant: str) -> Rows:
    """Return the rows of a task in a variant."""
    return [r for r in rows if (r["task"], r["variant"]) == (task, variant)]


def runs_of(points: Rows, task: str, variant: str) -> list[Rows]:
    """Return the curves of a task in a variant, one for each seed."""
    mine = of_variant(points, task, variant)
    seeds = sorted({point["seed"] for point in mine})
    return [[p for p in mine if p["seed"] == seed] for seed in seeds]


def mean(rows: Rows, column: str) -> float:
    """Return the mean of a column."""
    return float(np.mean([float(row[column]) for row in rows]))


def line(name: str, rows: Rows, floor: dict[str, float]) -> tuple[str, ...]:
    """Return the cells of a task: means over its seeds, and the floors."""

    def seconds_to(level: float) -> str:
        times = [row[f"cpu_seconds_to_{level}"] for row in rows]
        return "-" if "" in times else f"{np.mean([float(t) for t in times]):.0f}"

    low, high = interval(mean(rows, "success"), EPISODES * len(rows))
    return (
        name,
        f"{mean(rows, 'success'):.3f}",
        f"{min(float(row['success']) for row in rows):.3f}",
        f"{low:.3f}..{high:.3f}",
        *(f"{mean(rows, k):.3f}" for k in ("sampled", "first_shot", "pymunk", "arm")),
        f"{mean(rows, 'delayed'):.3f}",
        f"{mean(rows, 'cpu_minutes'):.1f}",
        f"{mean(rows, 'steps') / 1e6:.1f}",
        " / ".join(seconds_to(level) for level in THRESHOLDS),
        *(f"{floor[k]:.3f}" for k in ("still", "random", "sticky")),
        f"{PAPER[name]:.1f}" if name in PAPER else "-",
    )


if __name__ == "__main__":
    typer.run(main)

"""Train the games with their presets, print scores of the policies, plot curves.

    python scripts/reproduce/games.py --seeds 3 --jobs 2 --out runs/games

A run that exists is not trained again. A score is the share of whole games that are
won, where a draw counts half (a quarter in free_for_all, with four players). Intervals
are 95 %, and ends alternate. For cooperative games the script prints the mean return of
an episode and the success, for three kinds of pairs: of one seed, of two seeds, and of
scripts.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from marl_airhockey.cli.league import SCRIPTS
from marl_airhockey.evaluation.crossplay import crossplay
from marl_airhockey.evaluation.games import play_against
from marl_airhockey.evaluation.stats import interval
from marl_airhockey.learn.plots import BAND, plot_iqm
from marl_airhockey.learn.ppo_config import preset
from marl_airhockey.learn.self_play_config import OPPONENTS
from marl_airhockey.learn.train import run_training
from marl_airhockey.policies.load import load_policy
from marl_airhockey.registry import make_driver
from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.sim.render.charts import panels, save, series
from marl_airhockey.sim.world.keywords import Keywords

COOPERATIVE = ("rally", "team_juggle")
ON_NUMBA: Keywords = {"backend": "numba"}
GAMES, SEED = 400, 5_000_000


def train_seed(game: str, seed: int, folder: Path) -> None:
    """Train one seed, or resume its training."""
    begun = (folder / "config.toml").exists()
    run_training(None if begun else preset(game, {"seed": seed}), folder)


def checkpoint(folder: Path, share: float) -> Path:
    """Return the checkpoint of a run at a share of its training."""
    paths = sorted((folder / "checkpoints").glob("*.npz"))
    return paths[round(share * len(paths)) - 1]


def cpu_minutes(folder: Path) -> float:
    """Return the CPU-minutes of a run."""
    with (folder / "evaluations.csv").open() as file:
        return float(list(csv.DictReader(file))[-1]["cpu_seconds"]) / 60


def competitive_table(game: str, folders: Sequence[Path]) -> Table:
    """Return the scores of each seed against scripts and against its own checkpoint."""
    names = [*SCRIPTS, "itself at 1/10"]
    table = Table("against", "in training", *[f"seed {i}" for i in range(len(folders))])
    columns = []
    for folder in folders:
        opponents: list[Driver] = [make_driver(name) for name in SCRIPTS]
        opponents.append(load_policy(checkpoint(folder, 0.1)))
        policy = load_policy(folder / "last.npz")
        score, _ = play_against(game, policy, opponents, GAMES, SEED, ON_NUMBA)
        columns.append(score)
    for i, name in enumerate(names):
        cells = []
        for score in columns:
            low, high = interval(float(score[i]), GAMES)
            cells.append(f"{score[i]:.3f} ({low:.2f}..{high:.2f})")
        seen = name.removesuffix(":strength=strong") in OPPONENTS
        table.add_row(name, "yes" if seen else "no", *cells)
    minutes = [f"{cpu_minutes(folder):.1f}" for folder in folders]
    table.add_row("CPU-minutes of training", "", *minutes)
    return table


def cooperative_table(game: str, folders: Sequence[Path]) -> Table:
    """Return returns and success of pairs."""
    table = Table("pair", "return", "success")
    players: dict[str, Driver] = {str(f): load_policy(f / "last.npz") for f in folders}
    scripts = {name: make_driver(name) for name in ("striker", "allround")}
    learned = crossplay(
        game, players, episodes=GAMES, seed=SEED, exact=True, **ON_NUMBA
    )
    scripted = crossplay(
        game, scripts, episodes=GAMES, seed=SEED, exact=True, **ON_NUMBA
    )
    same = np.eye(len(players), dtype=bool)
    rows = {
        "of one seed": (learned.returns[same], learned.success[same]),
        "of two seeds": (learned.returns[~same], learned.success[~same]),
    }
    for i, name in enumerate(scripts):
        rows[f"two of {name}"] = scripted.returns[i, i], scripted.success[i, i]
    for name, (returns, success) in rows.items():
        table.add_row(name, f"{np.mean(returns):.1f}", f"{np.mean(success):.3f}")
    low, high = learned.gap_interval
    table.add_row("gap", f"{learned.gaps.mean():.1f} ({low:.1f}..{high:.1f})", "")
    return table


def plot_curves(game: str, folders: Sequence[Path], path: Path) -> None:
    """Plot scores against opponents over CPU-minutes of training, by `plot_iqm`."""
    runs = []
    for folder in folders:
        with (folder / "evaluations.csv").open() as file:
            runs.append(list(csv.DictReader(file)))
    length = min(map(len, runs))
    names = [key for key in runs[0][0] if key.startswith("score/")]
    figure, grid = panels(size=(7.2, 4.6))
    axes = grid[0, 0]
    cpu = np.mean([[float(r["cpu_seconds"]) for r in x[:length]] for x in runs], 0) / 60
    for k, name in enumerate(names):
        share = np.array([[float(r[name]) for r in x[:length]] for x in runs])
        plot_iqm(axes, cpu, share, series(k), f"against {name.partition('/')[2]}")
    axes.set(
        xlabel="CPU-minutes of training",
        ylabel="score: win + draw / 2",
        ylim=(-0.03, 1.03),
        xlim=(0, None),
    )
    many = f"{BAND}, n = {len(runs)}" if len(runs) > 1 else "n = 1 seed, no interval"
    save(figure, path, f"{game.replace('_', ' ')}\n{many}")


def main(
    games: Annotated[
        str, typer.Option(help="Names of games, separated by commas.")
    ] = "duel,rally",
    seeds: Annotated[int, typer.Option(help="Number of seeds, from 0.")] = 3,
    jobs: Annotated[int, typer.Option(help="Number of processes.")] = 2,
    out: Annotated[Path, typer.Option(help="Folder of the runs.")] = Path("runs/games"),
) -> None:
    """Train all games, measure the policies, print tables and plot curves."""
    console, names = Console(), games.split(",")
    folders = {
        name: [out / f"{name}-{seed}" for seed in range(seeds)] for name in names
    }
    with ProcessPoolExecutor(jobs) as pool:
        waiting = [
            pool.submit(train_seed, name, seed, folder)
            for name, rows in folders.items()
            for seed, folder in enumerate(rows)
        ]
        for k, done in enumerate(waiting, 1):
            done.result()
            print(f"{k} of {len(waiting)} runs are finished, in {out}", flush=True)
    for name, rows in folders.items():
        console.rule(name)
        if name in COOPERATIVE:
            console.print(cooperative_table(name, rows))
            continue
        console.print(competitive_table(name, rows))
        plot_curves(name, rows, out / f"{name}.png")


if __name__ == "__main__":
    typer.run(main)

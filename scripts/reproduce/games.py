"""Train the games with several seeds, play against scripts, plot the learning curves.

    python scripts/reproduce/games.py --jobs 2

A run, a curve or a row that exists is not computed again. A score is the share of whole
games that are won; a draw counts an equal share. Players that are not trained are rows,
too. In the cooperative games a player has copies of itself as partners, and the row has
the return and the success of an episode.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.table import Table
from rows import DATA, Again, Book, Cell, Row, RowsFile, read, write

from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.evaluation.games import play_against, teams_of
from marl_airhockey.evaluation.stats import bootstrap
from marl_airhockey.learn.plots import plot_iqm
from marl_airhockey.learn.ppo_config import preset
from marl_airhockey.learn.self_play_config import EVAL_OPPONENTS
from marl_airhockey.learn.train import run_training
from marl_airhockey.policies.load import load_policy
from marl_airhockey.registry import make_driver, make_scenario
from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.sim.render.charts import panels, save, series

OPPONENTS = ("still", *EVAL_OPPONENTS)
"""Opponents of every player, which are also players that are not trained."""
GAMES, SEED = 400, 5_000_000
FIELDS = ("game", "player", "opponent", "score", "return")
CURVE = ("game", "seed", "measure", "steps", "cpu_minutes", "value")
BOOK = Book(DATA / "games.csv", FIELDS[:3])
POINTS, IMAGE = "game_curves.csv", DATA.parent / "images" / "game_curves.png"


def folder_of(out: Path, game: str, seed: object) -> Path:
    """Return the folder of a run with the preset."""
    return out / f"{game}-{seed}"


def train(folder: Path, game: str, changes: dict[str, Any]) -> None:
    """Train a run, or resume its training."""
    begun = (folder / "config.toml").exists()
    run_training(None if begun else preset(game, changes), folder)


def train_all(
    runs: Sequence[tuple[Path, str, dict[str, Any]]], jobs: int
) -> Iterator[int]:
    """Train runs, each with a folder, a game and changes; yield the finished ones."""
    with ProcessPoolExecutor(jobs, max_tasks_per_child=1) as pool:
        waiting = [pool.submit(train, *run) for run in runs]
        for k, done in enumerate(waiting):
            done.result()
            yield k
            print(f"{k + 1} of {len(runs)} runs are finished: {runs[k][0]}", flush=True)


def cpu_minutes(folder: Path) -> float:
    """Return the CPU-minutes of a run."""
    with (folder / "evaluations.csv").open() as file:
        return float(list(csv.DictReader(file))[-1]["cpu_seconds"]) / 60


def is_cooperative(game: str) -> bool:
    """Return True if all seats of a game are in one team."""
    seats = make_scenario(game).scene.seats
    return len(set(teams_of([seat.team for seat in seats]))) == 1


def cells_of(game: str, seeds: int) -> list[Cell]:
    """Return the players of a game and their opponents."""
    players = [*map(str, range(seeds)), *OPPONENTS]
    if is_cooperative(game):
        return [(game, player, player) for player in players]
    return [(game, p, other) for p in players for other in OPPONENTS if p != other]


def measure(out: Path, game: str, player: str, opponent: str) -> Row:
    """Return the row of a player against an opponent, or with copies of itself."""

    def driver() -> Driver:
        if player in OPPONENTS:
            return make_driver(player)
        return load_policy(folder_of(out, game, player) / "last.npz")

    if is_cooperative(game):
        partners: dict[str, object] = {"paddle_1": driver()}
        found = evaluate(
            driver(), game, episodes=GAMES, seed=SEED, exact=True, drivers=partners
        )
        numbers = found.success, found.returns
    else:
        other = [make_driver(opponent)]
        score, margin = play_against(game, driver(), other, GAMES, SEED)
        numbers = float(score[0]), float(margin[0])
    values = game, player, opponent, round(numbers[0], 4), round(numbers[1], 3)
    return dict(zip(FIELDS, values, strict=True))


def curve_of(out: Path, game: str, seed: int) -> list[Row]:
    """Return the points of the learning curve of a run."""
    points = []
    for row in read(folder_of(out, game, seed) / "evaluations.csv"):
        names = [n for n in row if n.startswith("score/")] or ["return"]
        clock = int(float(row["steps"])), round(float(row["cpu_seconds"]) / 60, 3)
        for name in names:
            values = game, seed, name, *clock, round(float(row[name]), 4)
            points.append(dict(zip(CURVE, values, strict=True)))
    return points


def add_curves(
    out: Path, runs: Iterable[tuple[str, int]], points: Path, jobs: int
) -> None:
    """Train the runs of games and seeds that have no curve yet; add their curves."""
    known = {(row["game"], row["seed"]) for row in read(points)}
    missing = [(g, s) for g, s in runs if (g, str(s)) not in known]
    tasks = [(folder_of(out, g, s), g, {"seed": s}) for g, s in missing]
    for k in train_all(tasks, jobs):
        write(points, read(points) + curve_of(out, *missing[k]))


def plot_curves(points: Path, path: Path) -> None:
    """Plot the learning curves of all games, one panel each, by `plot_iqm`."""
    rows = read(points)
    games = list(dict.fromkeys(row["game"] for row in rows))
    figure, grid = panels(1, len(games), (2.3 * len(games) + 0.6, 3.2))
    for axes, game in zip(grid[0], games, strict=True):
        mine = [row for row in rows if row["game"] == game]
        for k, name in enumerate(dict.fromkeys(row["measure"] for row in mine)):
            seeds = dict.fromkeys(row["seed"] for row in mine)
            runs = [
                [r for r in mine if (r["measure"], r["seed"]) == (name, seed)]
                for seed in seeds
            ]
            length = min(map(len, runs))
            values, steps = (
                np.array([[float(r[column]) for r in run[:length]] for run in runs])
                for column in ("value", "steps")
            )
            kind, _, against = name.partition("/")
            label = f"score against {against}" if against else f"{kind} of a pair"
            look = series(k if against else len(EVAL_OPPONENTS))
            plot_iqm(axes, steps.mean(0) / 1e6, values, look, label)
        axes.set_title(f"{game.replace('_', ' ')}, n = {len(seeds)}", fontsize="small")
        axes.set(xlabel="steps, millions", xlim=(0, None), ylim=(-0.03, None))
    save(figure, path)


COLUMNS = ("game", "player", "n", *OPPONENTS, "copies of itself", "return")


def summary(rows: list[Row]) -> list[list[str]]:
    """Return the lines of the table: means over seeds and their 95 % intervals."""
    lines = []
    for game in dict.fromkeys(row["game"] for row in rows):
        mine = [row for row in rows if row["game"] == game]
        players = dict.fromkeys(row["player"] for row in mine)
        trained = [player for player in players if player not in OPPONENTS]
        groups = {"self-play": trained} | {p: [p] for p in players if p in OPPONENTS}
        for name, members in groups.items():
            line = [game, name, str(len(members))]
            for other in (*OPPONENTS, None):
                found = [
                    row
                    for row in mine
                    if row["player"] in members
                    and row["opponent"] == (other or row["player"])
                    and (other is None) == is_cooperative(game)
                ]
                line.append(shown([float(row["score"]) for row in found]))
            lines.append([*line, shown([float(row["return"]) for row in found])])
    return lines


def shown(values: list[float]) -> str:
    """Return the mean of values, and the interval of several ones."""
    if not values:
        return ""
    digits = 1 if max(values) > 2 else 2
    mean = f"{np.mean(values):.{digits}f}"
    if len(values) == 1:
        return mean
    low, high = bootstrap(np.array(values), lambda x: float(x.mean()))
    return f"{mean} ({low:.{digits}f}..{high:.{digits}f})"


def main(
    games: Annotated[
        str, typer.Option(help="Names of games, separated by commas.")
    ] = "duel,doubles,free_for_all,rally,team_juggle",
    seeds: Annotated[int, typer.Option(help="Number of seeds, from 0.")] = 3,
    jobs: Annotated[int, typer.Option(help="Number of processes.")] = 2,
    out: Annotated[Path, typer.Option(help="Folder of the runs.")] = Path("runs/games"),
    again: Again = False,
    rows: RowsFile = None,
) -> None:
    """Train the runs, measure the players that have no row, print table and curves."""
    book, names = BOOK.at(rows), games.split(",")
    missing = book.missing([c for name in names for c in cells_of(name, seeds)], again)
    if not missing:
        return
    points = book.path.with_name(f"{book.path.stem}_{POINTS}" if rows else POINTS)
    runs = dict.fromkeys((c[0], int(c[1])) for c in missing if c[1].isdigit())
    add_curves(out, runs, points, jobs)
    book.fill(missing, partial(measure, out), jobs)
    table = Table(*COLUMNS)
    for line in summary(read(book.path)):
        table.add_row(*line)
    Console(width=160).print(table)
    plot_curves(points, points.with_suffix(".png") if rows else IMAGE)


if __name__ == "__main__":
    typer.run(main)

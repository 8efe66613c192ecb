"""Make the suites of set pieces, and measure drivers on them; print a table.

    python scripts/reproduce/suites.py                  # the table
    python scripts/reproduce/suites.py --make defence-v1 --out pieces

A suite is made from random candidates. A piece is selected if a paddle at rest fails, a
random paddle fails in at least 4 of 5 plays (in rally, in all of them), and a search
finds actions that solve it. The search plays scripts, and policies with sampled
actions, and stores the first actions that succeed. It knows the puck when it is hidden.

The class of a piece is given by the share of plays of the population of the challenge
that solve it, whose players no table shows: the classes are equal ranges of this share,
up to that of the easiest pieces. In doubles, there is no population, and the levels of
the zoo replace it. A changed suite needs a new name, and its hash belongs in
`evaluation/suites/pieces.py`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from piece_search import play_actions
from piece_starts import (
    Starts,
    counters,
    passes,
    played,
    shots,
    slow_pucks,
)
from rows import DATA, Again, Book, Cell, Row, RowsFile, fill_and_print

from marl_airhockey.build import build_driven_world
from marl_airhockey.discovery import version_of
from marl_airhockey.evaluation.population import opponents
from marl_airhockey.evaluation.suites.pieces import (
    ARRAYS,
    CLASSES,
    Pieces,
    Task,
    suite_names,
)
from marl_airhockey.evaluation.suites.solution import Solution
from marl_airhockey.evaluation.suites.suite import Suite, load_suite
from marl_airhockey.registry import make_driver
from marl_airhockey.rollouts.rollout import play_episodes
from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.types import Array

CANDIDATES, EACH = 8000, 200
"""Candidates of a round, and pieces of a class."""
EASIEST = 0.98
"""Quantile of the share of plays that counts as that of the easiest pieces."""
TRIES = 4
"""Number of sampled plays of each player that gives the classes."""
SCRIPTS = ("goalkeeper", "striker", "allround")
LEVELS = {
    game: (*(f"zoo/{game}_{k}" for k in range(1, 5)), f"zoo/{game}")
    for game in ("duel", "doubles")
}
"""Levels of the zoo by game."""


@dataclass(frozen=True)
class Recipe:
    """Recipe of a suite: its task and its candidates."""

    task: Task
    starts: Callable[[np.random.Generator, int], Starts]
    hides: bool = False
    """True to hide the puck for 0.1 to 0.3 s of its flight."""
    lucky: int = 1
    """Number of 5 plays of a random paddle that may solve a piece."""


# Opponents are scripts: the last bits of a network's actions depend on the processor
# and on the number of worlds, and a solution must be the same everywhere.
RESTS, KEEPER = {"paddle_1": "still"}, {"paddle_1": "goalkeeper"}
TEAMS = {"paddle_1": "allround", "paddle_2": "goalkeeper", "paddle_3": "goalkeeper"}


def task_of(
    title: str, rule: str, seconds: float, drivers: dict[str, str], game: str = "duel"
) -> Task:
    """Return a task by the present rules of a game."""
    return Task(title, rule, seconds, drivers, game, version_of(game))


SHOT = "Stop a shot that would score."
HIDDEN = "Stop a shot although the puck is hidden for a time."
RECIPES = {
    "defence-v1": Recipe(task_of(SHOT, "keep", 2.0, RESTS), shots),
    "blackout-v1": Recipe(task_of(HIDDEN, "keep", 2.0, RESTS), shots, True),
    "attack-v1": Recipe(
        task_of("Score with a slow puck in reach.", "score", 4.0, KEEPER), slow_pucks
    ),
    "counter-v1": Recipe(
        task_of("Stop a puck and score.", "score", 4.0, KEEPER), counters
    ),
    "played-v1": Recipe(
        task_of("Concede no goal in a game.", "keep", 4.0, {"paddle_1": "allround"}),
        played,
    ),
    "rally-v1": Recipe(
        task_of("Return the puck to the other paddle.", "pass", 4.0, KEEPER),
        counters,
        lucky=0,
    ),
    "pass-v1": Recipe(
        task_of("Pass the puck to the teammate.", "pass", 4.0, TEAMS, "doubles"), passes
    ),
}
"""Recipes by name of the suite."""


# Selection of pieces


def candidates(recipe: Recipe, rng: np.random.Generator, path: Path) -> Suite:
    """Return a suite of candidates in which a paddle at rest fails."""
    position, velocity = recipe.starts(rng, CANDIDATES)
    n, longest = len(position), round(recipe.task.seconds / 0.05)
    hidden = np.zeros((n, 2))
    unknown = np.ones(n), np.zeros((n, longest, 2))
    found = Pieces(recipe.task, position, velocity, hidden, *unknown)
    suite = saved(found, path)
    suite = saved(suite.pieces.select(~suite.play("still").solved), path)
    if recipe.hides:
        suite = saved(with_hidden_pucks(suite, rng), path)
    solved = np.sum([suite.play("random", k).solved for k in range(5)], axis=0)
    return saved(suite.pieces.select(solved <= recipe.lucky), path)


def with_hidden_pucks(suite: Suite, rng: np.random.Generator) -> Pieces:
    """Return the pieces that last long enough, with times to hide the puck.

    It is hidden for 0.1 to 0.3 s before the goal that a paddle at rest concedes.
    """
    n, keywords = len(suite), Keywords(drivers=suite.drivers)
    world = build_driven_world(make_driver("still"), suite.scenario, n, keywords)
    played = play_episodes(world, n, 0, ("success",))
    goal = np.array([len(episode) * world.control_dt for episode in played])
    world.close()
    long = goal >= 0.3
    goal, shown = goal[long], suite.pieces.select(long)
    hidden = rng.uniform(0.1, 0.3, len(goal))
    begin = rng.uniform(0.0, goal - hidden)
    return replace(shown, hidden=np.stack([begin, begin + hidden], -1))


def saved(pieces: Pieces, path: Path) -> Suite:
    """Save pieces and return their suite."""
    pieces.save(path)
    return Suite(str(path))


def solved_pieces(
    recipe: Recipe, rng: np.random.Generator, path: Path
) -> tuple[Pieces, Array]:
    """Return the candidates of a round that the search solves.

    The second value is the share of the plays of the population that solve each (N,).
    """
    suite, clear = candidates(recipe, rng, path), path.with_name(f"clear_{path.name}")
    visible = replace(suite.pieces, hidden=np.zeros_like(suite.pieces.hidden))
    n, searched = len(suite), saved(visible, clear) if recipe.hides else suite
    solution, found = np.zeros_like(suite.pieces.solution), np.zeros(n, np.bool_)

    def search(player: Driver, number: int) -> Array:
        """Store new solutions of a play, and return the solved pieces (N,)."""
        solved, actions = play_actions(searched, player, number)
        new = solved & ~found
        solution[new], found[new] = actions[new], True
        return solved

    game = recipe.task.game
    for name in (*SCRIPTS, f"zoo/{game}"):
        search(make_driver(name), 0)
    shares = []
    ladder = opponents().values() if game == "duel" else LEVELS[game]
    for player in ladder:
        policy = make_driver(player, deterministic=False)
        for k in range(TRIES):
            solved = search(policy, k)
            shares.append(suite.play(policy, k).solved if recipe.hides else solved)
    print(f"  {n} candidates, {found.mean():.3f} of them solved", flush=True)
    task = replace(recipe.task, solvable=float(found.mean()))
    known = replace(suite.pieces, task=task, solution=solution).select(found)
    return known, np.mean(shares, axis=0)[found]


def make_suite(name: str, out: Path, seed: int) -> None:
    """Select the pieces of a suite and save them."""
    rng, parts, path = np.random.default_rng(seed), [], out / f"{name}.npz"
    out.mkdir(parents=True, exist_ok=True)
    room, easiest = np.full(CLASSES + 1, EACH), 0.0
    room[0] = 0
    while room.any():
        scratch = out / f"candidates-{name}.npz"
        new, easy = solved_pieces(RECIPES[name], rng, scratch)
        easiest = easiest or float(np.quantile(easy, EASIEST))
        steps = np.minimum((easy / easiest * CLASSES).astype(int), CLASSES - 1)
        classes = CLASSES - steps
        rank = np.array([(classes[:k] == c).sum() for k, c in enumerate(classes)])
        parts.append(replace(new, difficulty=classes).select(rank < room[classes]))
        room -= np.bincount(parts[-1].difficulty, minlength=CLASSES + 1)
        print(f"  {name}: easiest {easiest:.2f}, missing {room[1:]}", flush=True)
    arrays = [np.concatenate([getattr(part, n) for part in parts]) for n in ARRAYS]
    order = rng.permutation(len(arrays[0]))
    solvable = round(float(np.mean([part.task.solvable for part in parts])), 3)
    task = replace(RECIPES[name].task, solvable=solvable)
    Pieces(task, *(x[order] for x in arrays)).save(path)
    print(path, len(order), hashlib.sha256(path.read_bytes()).hexdigest())


# The table

VISIBLE = "blackout-v1, visible"
"""Name of a suite whose pucks are not hidden."""


def suite_of(name: str) -> Suite:
    """Return the suite of a row."""
    return load_suite(name.split(",")[0], hide=name != VISIBLE)


def players(suite: str) -> tuple[str, ...]:
    """Return the drivers that are measured in a suite."""
    levels = LEVELS[suite_of(suite).pieces.task.game]
    return ("still", "random", *SCRIPTS, *levels, "solution")


FIELDS = (
    *("suite", "driver", "pieces", "success"),
    *(f"class_{k + 1}" for k in range(CLASSES)),
    *("touched", "first_touch", "violations", "acceleration"),
)
BOOK = Book(
    DATA / "suites.csv",
    FIELDS[:2],
    lambda row: (row["suite"], players(row["suite"]).index(row["driver"])),
)


def measure(name: str, player: str) -> Row:
    """Return the row of a driver, or of the stored solutions, in a suite."""
    suite = suite_of(name)
    driver = Solution(suite.name) if player == "solution" else make_driver(player)
    found = suite.summarize(player, suite.play(driver))
    shares = found.success, *(share or 0.0 for share in found.by_class)
    more = found.touched, found.first_touch, found.violations, found.acceleration
    numbers = (round(x, 4) for x in (*shares, *more))
    values = name, player, len(suite), *numbers
    return dict(zip(FIELDS, values, strict=True))


def main(
    make: Annotated[
        str, typer.Option(help="Names of suites to make, separated by commas.")
    ] = "",
    out: Annotated[Path, typer.Option(help="Folder of new suites.")] = Path("runs"),
    seed: Annotated[int, typer.Option(help="Seed of the candidates.")] = 0,
    jobs: Annotated[int, typer.Option(help="Number of processes.")] = 2,
    again: Again = False,
    rows: RowsFile = None,
) -> None:
    """Make suites, or measure the drivers that have no row and print the table."""
    if make:
        with ProcessPoolExecutor(jobs, max_tasks_per_child=1) as pool:
            names = make.split(",")
            list(pool.map(partial(make_suite, out=out, seed=seed), names))
        return
    cells: list[Cell] = [
        (s, player) for s in (*suite_names(), VISIBLE) for player in players(s)
    ]
    fill_and_print(BOOK.at(rows), cells, measure, jobs, again)


if __name__ == "__main__":
    typer.run(main)

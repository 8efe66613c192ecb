"""Make the suites of set pieces, and measure drivers on them; print a table.

    python scripts/reproduce/suites.py                  # the table
    python scripts/reproduce/suites.py --make defence-v1 --out pieces

A suite is made from random candidates. A piece is selected if a paddle at rest fails, a
random paddle fails in at least 4 of 5 rounds, and a search finds actions that solve it.
The search plays scripts, and policies with sampled actions, and stores the first
actions that succeed. It knows the puck when it is hidden. The class of a piece is given
by the share of plays of the population of the challenge that solve it, whose players no
table shows: the classes are equal ranges of this share, up to that of the easiest
pieces. A changed suite needs a new name, and its hash belongs in
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
from piece_starts import Starts, counters, played, shots, slow_pucks
from rows import DATA, Again, Book, Cell, Row, RowsFile, fill_and_print

from marl_airhockey.build import build_driven_world
from marl_airhockey.discovery import version_of
from marl_airhockey.evaluation.population import opponents
from marl_airhockey.evaluation.suites.pieces import (
    ARRAYS,
    CLASSES,
    STEPS_OF_ACTIONS,
    Pieces,
    Task,
    load_pieces,
    suite_names,
)
from marl_airhockey.evaluation.suites.suite import Solution, Suite
from marl_airhockey.policies.load import load_policy
from marl_airhockey.registry import make_driver
from marl_airhockey.rollouts.rollout import play_episodes
from marl_airhockey.sim.contracts.driver import Driver, View
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.sim.core.seat import Seat
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.types import Array

CANDIDATES, EACH = 8000, 200
"""Candidates of a round, and pieces of a class."""
EASIEST = 0.98
"""Quantile of the share of plays that counts as that of the easiest pieces."""
TRIES = 4
"""Number of sampled plays of each player of the population."""
SCRIPTS = ("goalkeeper", "striker", "allround")
LEVELS = (*(f"zoo/duel_{k}" for k in range(1, 5)), "zoo/duel")


class Rounded(Driver):
    """Driver whose actions have the precision of stored ones."""

    def __init__(self, inner: Driver) -> None:
        self._inner, self.observe = inner, inner.observe
        self.trained_in = inner.trained_in

    def reset(self, seat: Seat, rng: RandomStreams, worlds: int) -> dict[str, Array]:
        """Return the memory of the inner driver."""
        return self._inner.reset(seat, rng, worlds)

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        """Return the rounded actions of the inner driver."""
        actions, memory = self._inner.act(view, memory)
        steps = np.rint(np.clip(actions, -1.0, 1.0) * STEPS_OF_ACTIONS)
        return steps / STEPS_OF_ACTIONS, memory


@dataclass(frozen=True)
class Recipe:
    """How a suite is made."""

    task: Task
    starts: Callable[[np.random.Generator, int], Starts]
    hides: bool = False
    """True to hide the puck for 0.1 to 0.3 s of its flight."""


RULES = version_of("duel")
# Opponents are scripts: the last bits of a network's actions depend on the processor
# and on the number of worlds, and a solution must be the same everywhere.
RESTS, AGAINST_KEEPER = {"paddle_1": "still"}, {"paddle_1": "goalkeeper"}
RECIPES = {
    "defence-v1": Recipe(
        Task("Stop a shot that would score.", "keep", 2.0, RESTS, RULES),
        shots,
    ),
    "blackout-v1": Recipe(
        Task(
            "Stop a shot although the puck is hidden for a time.",
            "keep",
            2.0,
            RESTS,
            RULES,
        ),
        shots,
        hides=True,
    ),
    "attack-v1": Recipe(
        Task("Score with a slow puck in reach.", "score", 4.0, AGAINST_KEEPER, RULES),
        slow_pucks,
    ),
    "counter-v1": Recipe(
        Task("Stop a puck and score.", "score", 4.0, AGAINST_KEEPER, RULES),
        counters,
    ),
    "played-v1": Recipe(
        Task(
            "Concede no goal in a game.", "keep", 4.0, {"paddle_1": "allround"}, RULES
        ),
        played,
    ),
}
"""Recipes by name of the suite."""


# Selection of pieces


def play_actions(suite: Suite, player: Driver, round_: int) -> tuple[Array, Array]:
    """Return the solved pieces (N,) and the actions (N, T, 2) of a play, rounded."""
    n, longest = len(suite), suite.pieces.solution.shape[1]
    keywords = Keywords(drivers=suite.drivers)
    world = build_driven_world(Rounded(player), suite.scenario, n, keywords)
    solved, actions = np.zeros(n, np.bool_), np.zeros((n, longest, 2))
    for k, each in enumerate(
        play_episodes(world, n, round_ * n, ("success", "action"))
    ):
        solved[k] = each.columns["success"][-1, 0] > 0
        actions[k, : len(each)] = each.columns["action"][:, 0]
    world.close()
    return solved, np.rint(actions * STEPS_OF_ACTIONS)


def candidates(recipe: Recipe, rng: np.random.Generator, path: Path) -> Suite:
    """Return a suite of candidates in which a paddle at rest fails."""
    position, velocity = recipe.starts(rng, CANDIDATES)
    n, longest = len(position), round(recipe.task.seconds / 0.05)
    hidden = np.zeros((n, 2))
    if recipe.hides:
        hidden[:, 0] = rng.uniform(0.05, 0.3, n)
        hidden[:, 1] = hidden[:, 0] + rng.uniform(0.1, 0.3, n)
    unknown = np.ones(n), np.zeros((n, longest, 2))
    found = Pieces(recipe.task, position, velocity, hidden, *unknown)
    suite = saved(found, path)
    suite = saved(suite.pieces.select(~suite.play("still").solved), path)
    by_chance = np.mean([suite.play("random", k).solved for k in range(5)], axis=0)
    return saved(suite.pieces.select(by_chance < 0.3), path)


def saved(pieces: Pieces, path: Path) -> Suite:
    """Save pieces and return their suite."""
    pieces.save(path)
    load_pieces.cache_clear()
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

    for name in (*SCRIPTS, "zoo/duel"):
        search(make_driver(name), 0)
    shares = []
    for player in opponents().values():
        policy = load_policy(Path(player), deterministic=False)
        for k in range(TRIES):
            solved = search(policy, k)
            shares.append(suite.play(policy, k).solved if recipe.hides else solved)
    print(f"  {n} candidates, {found.mean():.3f} of them solved", flush=True)
    task = replace(recipe.task, solvable=float(found.mean()))
    known = replace(suite.pieces, task=task, solution=solution).select(found)
    return known, np.mean(shares, axis=0)[found]


def make_suite(name: str, out: Path, seed: int) -> None:
    """Select the pieces of a suite and save them."""
    rng, kept, path = np.random.default_rng(seed), [], out / f"{name}.npz"
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
        kept.append(replace(new, difficulty=classes).select(rank < room[classes]))
        room -= np.bincount(kept[-1].difficulty, minlength=CLASSES + 1)
        print(f"  {name}: easiest {easiest:.2f}, missing {room[1:]}", flush=True)
    arrays = [np.concatenate([getattr(part, n) for part in kept]) for n in ARRAYS]
    order = rng.permutation(len(arrays[0]))
    solvable = round(float(np.mean([part.task.solvable for part in kept])), 3)
    task = replace(RECIPES[name].task, solvable=solvable)
    Pieces(task, *(x[order] for x in arrays)).save(path)
    print(path, len(order), hashlib.sha256(path.read_bytes()).hexdigest())


# The table

PLAYERS = ("still", "random", *SCRIPTS, *LEVELS, "solution")
FIELDS = (
    *("suite", "driver", "pieces", "success"),
    *(f"class_{k + 1}" for k in range(CLASSES)),
    *("touched", "first_touch", "violations"),
)
BOOK = Book(
    DATA / "suites.csv",
    FIELDS[:2],
    lambda row: (row["suite"], PLAYERS.index(row["driver"])),
)


def measure(name: str, player: str) -> Row:
    """Return the row of a driver, or of the stored solutions, in a suite."""
    suite = Suite(name)
    driver = Solution(name) if player == "solution" else make_driver(player)
    found = suite.summarize(player, suite.play(driver))
    shares = found.success, *found.by_class
    more = found.touched, found.first_touch, found.violations
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
    cells: list[Cell] = [(s, player) for s in suite_names() for player in PLAYERS]
    fill_and_print(BOOK.at(rows), cells, measure, jobs, again)


if __name__ == "__main__":
    typer.run(main)

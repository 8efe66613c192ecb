"""Play duels with several observation latencies: wins, level games, goals and shots.

    python scripts/reproduce/reaction.py
    python scripts/reproduce/reaction.py --home zoo/duel --far allround --reactions 0.15

A reaction is the latency with which seats observe pucks and the other paddle. Without
latency, a goalkeeper that predicts stops every shot. With latency, attack leads to
goals. The score is by goals alone: a level game, which shots on goal decide, counts as
half a win.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

import marl_airhockey as ah
from marl_airhockey.evaluation.stats import interval
from marl_airhockey.rollouts import play as episodes

HOME, FAR = (
    ["allround", "striker", "allround"],
    ["goalkeeper", "goalkeeper", "allround"],
)
SEED = 5_000_000


def play(
    home: str, far: str, reaction: float, games: int, control_dt: float, width: float
) -> tuple[str, ...]:
    """Play whole games of two players; return the last cells of their row.

    Args:
        home: Name of the driver at home.
        far: Name of the driver at the far end.
        reaction: Observation latency, s.
        games: Number of games.
        control_dt: Time between two actions, s.
        width: Width of the goals, m.
    """
    world = ah.make_world(
        "duel",
        games,
        drivers={"paddle_0": home, "paddle_1": far},
        options={"reaction": reaction, "goal_width": width},
        control_dt=control_dt,
    )
    world.autoreset = False
    world.reset(SEED)
    goals, shots = np.zeros((2, games, 2))
    minutes, banked, banks = np.zeros((3, games))
    before = world.memory["goals"].sum(-1)
    for step in episodes.play(world):
        state, now = world.state, world.memory["goals"].sum(-1)
        banked[state.touched.any((1, 2))] = 0.0
        banked += state.banked[:, 0, [1, 3]].sum(-1)
        scored, before = step.live & (now > before), now
        banks += scored & (banked > 0.0)
        banked[scored] = 0.0
        ended = step.ended
        goals[ended] = world.memory["goals"][ended]
        shots[ended] = goals[ended] + world.memory["stopped"][ended]
        minutes[ended] = state.time[ended] / 60.0
    world.close()
    level = float((goals[:, 0] == goals[:, 1]).mean())
    low, high = interval(level, games)
    return (
        f"{(goals[:, 0] > goals[:, 1]).mean() + level / 2:.2f}",
        f"{level:.2f} ({low:.2f}..{high:.2f})",
        " : ".join(f"{scored:.1f}" for scored in goals.mean(0)),
        f"{goals.sum() / minutes.sum():.1f}",
        f"{goals.sum() / max(shots.sum(), 1.0):.2f}",
        f"{banks.sum() / max(goals.sum(), 1.0):.2f}",
    )


def main(
    reactions: Annotated[
        str, typer.Option(help="Latencies, s, separated by commas.")
    ] = ("0,0.05,0.1,0.15,0.2"),
    home: Annotated[list[str], typer.Option(help="Driver at home, repeatable.")] = HOME,
    far: Annotated[
        list[str], typer.Option(help="Driver at the far end, one for each --home.")
    ] = FAR,
    games: Annotated[int, typer.Option(help="Number of games of each pair.")] = 200,
    control_dt: Annotated[
        float, typer.Option(help="Time between two actions, s.")
    ] = 0.05,
    width: Annotated[float, typer.Option(help="Width of the goals, m.")] = 0.30,
) -> None:
    """Print a row for each reaction and pair of players."""
    if len(home) != len(far):
        raise typer.BadParameter(
            f"{len(far)} given, but {len(home)} of --home", param_hint="--far"
        )
    table = Table(
        "reaction, s",
        "home",
        "far",
        "score",
        "level",
        "goals",
        "goals per minute",
        "goals per shot",
        "bank shots",
    )
    for reaction in map(float, reactions.split(",")):
        for players in zip(home, far, strict=True):
            cells = play(*players, reaction, games, control_dt, width)
            table.add_row(f"{reaction:g}", *players, *cells)
    Console(width=110).print(table)


if __name__ == "__main__":
    typer.run(main)

"""Learn to estimate which side scores the next goal of a duel, and test the estimate.

    python scripts/reproduce/next_goal.py

Policies of all levels and two scripts play each other with all handicaps of the browser
page, at its control rate. In addition, they play short games from random states, which
people can reach and policies rarely do. The input of the network is the true state of
paddles and puck at one time. It contains neither the players nor the score.

The network is tested on other games of the same players, on other random starts, and on
games of synthetic humans, which play no game of the training. It is written to
``marl_airhockey/zoo/values/duel.npz``, and the figures to ``docs/data/next_goal.csv``.
"""

from __future__ import annotations

import datetime
import time
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
import typer
from next_goal_samples import GAME, Samples, joined, sample_many
from rows import DATA, Row, write
from torch import nn

from marl_airhockey.build import scenario_of
from marl_airhockey.data.benchmark.synthetic import SyntheticHuman
from marl_airhockey.learn.networks import linear_layers
from marl_airhockey.play.handicap import HandicappedDriver
from marl_airhockey.play.ladder import RUNGS
from marl_airhockey.policies.next_goal import VALUES, NextGoal, scene_numbers
from marl_airhockey.policies.numpy_network import NumpyNetwork
from marl_airhockey.registry import make_driver
from marl_airhockey.types import Array

POLICIES = ("zoo/duel_1", "zoo/duel_2", "zoo/duel_3", "zoo/duel_4", "zoo/duel")
PLAYERS = (*POLICIES, "striker", "allround")
UNIT = np.array([0.5, 0.2, 1.0, 1.0, 0.5, 0.2, 1.0, 1.0, 0.5, 0.2, 1.4, 1.4])
"""Typical size of each element of a view, m and m/s."""
HIDDEN, EPOCHS, BATCH, RATE, DECAY = (64, 64, 64), 8, 4096, 4e-3, 1e-3


def fit(samples: Samples) -> list[tuple[Array, Array]]:
    """Return the weights and biases of a network that was fitted to samples."""
    torch.manual_seed(0)
    net = linear_layers([len(UNIT), *HIDDEN, 1], 0.1)
    inputs = torch.as_tensor(samples.views / UNIT.astype(np.float32))
    labels = torch.as_tensor(samples.scored, dtype=torch.float32)
    mirror = torch.tensor([1.0, -1.0] * (len(UNIT) // 2))
    optimizer = torch.optim.AdamW(net.parameters(), RATE, weight_decay=DECAY)
    batches = len(labels) // BATCH
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimizer, RATE, total_steps=EPOCHS * batches
    )
    for epoch in range(EPOCHS):
        total = 0.0
        order = torch.randperm(len(labels))
        for part in range(batches):
            rows = order[part * BATCH : (part + 1) * BATCH]
            x = inputs[rows]
            if torch.rand(()) < 0.5:  # Left and right are alike.
                x = x * mirror
            score = net(x)[..., 0]
            loss = nn.functional.binary_cross_entropy_with_logits(
                score[:, 0] - score[:, 1], labels[rows]
            )
            optimizer.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            optimizer.step()
            schedule.step()
            total += loss.item()
        print(f"epoch {epoch + 1}: log loss {total / batches:.4f}", flush=True)
    linear = [layer for layer in net if isinstance(layer, nn.Linear)]
    return [
        (layer.weight.detach().numpy(), layer.bias.detach().numpy()) for layer in linear
    ]


def measures(estimate: Array, samples: Samples) -> Row:
    """Return the figures of estimates (n,), as columns of a row.

    The standard error of the Brier score is that over games, because the states of a
    game are not independent.
    """
    scored, count = samples.scored, len(estimate)
    error = (estimate - scored) ** 2
    _, game = np.unique(samples.game, return_inverse=True)
    by_game = np.bincount(game, error - error.mean())
    logs = -np.log(np.where(scored, estimate, 1.0 - estimate))
    return {
        "games": len(by_game),
        "states": count,
        "estimate": f"{estimate.mean():.4f}",
        "scored": f"{scored.mean():.4f}",
        "brier": f"{error.mean():.4f}",
        "brier_error": f"{np.sqrt((by_game**2).sum()) / count:.4f}",
        "log_loss": f"{logs.mean():.4f}",
    }


def table(found: NextGoal, tests: Mapping[str, Samples]) -> list[Row]:
    """Return the rows of figures: each test, and parts of the first test."""
    rows = [
        {"part": part, "low": "", "high": "", **measures(found.chance(s.views), s)}
        for part, s in tests.items()
    ]
    test = next(iter(tests.values()))
    estimate = found.chance(test.views)
    bounds = {
        "estimate": (estimate, np.linspace(0.0, 1.0, 11).round(1)),
        "seconds until the goal": (
            test.seconds,
            np.array([0.0, 0.25, 0.5, 1.0, 2.0, 5.0, 60.0]),
        ),
    }
    for part, (value, edges) in bounds.items():
        for low, high in pairwise(edges):
            inside = (value >= low) & (value < high)
            few = Samples(*(array[inside] for array in test))
            if inside.any():
                figures = measures(estimate[inside], few)
                rows.append({"part": part, "low": low, "high": high, **figures})
    return rows


def main(
    games: Annotated[
        int,
        typer.Option(
            help="Number of games to learn from, and of pairs of short games."
        ),
    ] = 8000,
    test_games: Annotated[int, typer.Option(help="Number of games of a test.")] = 2000,
    out: Annotated[Path, typer.Option(help="Folder of the network.")] = VALUES,
    data: Annotated[Path, typer.Option(help="Folder of the CSV file.")] = DATA,
) -> None:
    """Play, fit, test, write the network and the figures."""
    torch.set_num_threads(1)
    began = time.process_time()
    drivers = [
        HandicappedDriver(make_driver(name), handicap)
        for name in PLAYERS
        for handicap in dict.fromkeys(handicap for _, _, handicap in RUNGS)
    ]
    people = [SyntheticHuman(make_driver(name)) for name in POLICIES]
    training = joined(
        [
            sample_many(drivers, games, 6_000_000),
            sample_many(drivers, 2 * games, 6_500_000, short=True),
        ]
    )
    layers = fit(training)
    tests = {
        "test": sample_many(drivers, test_games, 7_000_000),
        "random start": sample_many(drivers, test_games, 7_500_000, short=True),
        "unseen players": sample_many(people, test_games, 8_000_000),
    }
    game = scenario_of(GAME, {})
    card = {
        "scenario": GAME,
        "version": game.version,
        "scene": scene_numbers(game.scene),
        "command": "python scripts/reproduce/next_goal.py",
        "games": games,
        "states": len(training.scored),
        "date": datetime.date.today().isoformat(),
    }
    unit = UNIT.astype(np.float32)
    network = NumpyNetwork(layers, np.zeros_like(unit), unit, card=card)
    rows = table(NextGoal(network), tests)
    card |= {name: float(rows[0][name]) for name in ("brier", "log_loss")}
    card["cpu_minutes"] = round((time.process_time() - began) / 60, 1)
    out.mkdir(parents=True, exist_ok=True)
    network.save(out / f"{GAME}.npz")
    write(data / "next_goal.csv", rows)
    for row in rows:
        print(*row.values(), sep="\t")


if __name__ == "__main__":
    typer.run(main)

"""A first tour in five minutes: look, compare, train, measure, record, film.

    python scripts/tutorials/first_hour.py --out runs/first-hour

Each step prints what it does and what came of it. It needs the extras train and data.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import gymnasium
import numpy as np
import typer

import marl_airhockey as ah
from marl_airhockey.data.reader import read_recording
from marl_airhockey.data.record import record_episodes
from marl_airhockey.play.replay import one_episode
from marl_airhockey.rollouts.replay import Replay
from marl_airhockey.rollouts.watch import write_replay


def look() -> None:
    """Make tasks by three doors."""
    print("\n== One task by gymnasium, a game by PettingZoo, 1024 worlds at a time")
    env = gymnasium.make("marl_airhockey/Juggle-v0")
    seen, _ = env.reset(seed=0)
    labels = env.get_wrapper_attr("observation_labels")
    for name, value in zip(labels, seen, strict=True):
        print(f"{name:18s} {value: .3f}")
    duel = ah.parallel_env("duel")
    duel.reset(seed=0)
    actions = {agent: duel.action_space(agent).sample() for agent in duel.agents}
    rewards = duel.step(actions)[1]
    print("rewards of duel:", {agent: round(r, 3) for agent, r in rewards.items()})
    world, still = ah.make_world("juggle", 1024), np.zeros((1024, 1, 2))
    world.reset(seed=0)
    began = time.perf_counter()
    for _ in range(200):
        world.step(still)
    rate = 200 * 1024 / (time.perf_counter() - began)
    print(f"{rate:,.0f} steps of a world in a second")


def compare() -> None:
    """Measure what needs no training."""
    print("\n== What luck, a script and a trained policy are worth in juggle")
    for player in ("random", "striker", "zoo/juggle"):
        found = ah.evaluate(player, "juggle", episodes=200)
        print(f"{player:12s} success {found.success:.3f}, return {found.returns:.2f}")


def train(folder: Path) -> Path:
    """Train a policy, and measure it on two engines; return its run."""
    print("\n== Train touch, then play it on two engines")
    result = ah.train("touch", folder / "touch", total_steps=500_000)
    print(f"{result.steps:,} steps, {result.folder}")
    for backend in ("numba", "pymunk"):
        found = ah.evaluate(result.folder, episodes=200, backend=backend)
        low, high = found.success_interval
        print(f"{backend}: success {found.success:.3f} ({low:.3f} .. {high:.3f})")
    return result.folder


def keep(run: Path, folder: Path) -> None:
    """Record what a policy does, and film it."""
    print("\n== Record 20 episodes, and film the first")
    policy, path = ah.load_policy(run), folder / "recording"
    record_episodes(policy, "mine", "touch", 20, path, 0, {})
    steps = sum(len(episode) for episode in read_recording(path).episodes)
    write_replay(Replay(one_episode(path)), folder / "touch.gif")
    print(f"{path}: {steps} steps; {folder / 'touch.gif'}")


def main(
    out: Annotated[Path, typer.Option(help="New folder of all that is made.")] = Path(
        "runs/first-hour"
    ),
) -> None:
    """Do all steps."""
    began = time.perf_counter()
    look()
    compare()
    keep(train(out), out)
    print(
        f"\n{time.perf_counter() - began:.0f} s. Next: docs/own.md; airhockey play duel"
    )


if __name__ == "__main__":
    typer.run(main)

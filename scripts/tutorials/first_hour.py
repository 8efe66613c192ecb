"""First tour in five minutes: look, compare, train, measure, record, write a video.

    python scripts/tutorials/first_hour.py --out runs/first-hour

Each step prints its purpose and its result. The script needs the extras train and data.
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
    """Create environments with three APIs."""
    print("\n== A task with Gymnasium, a game with PettingZoo, a batch of 1024 worlds")
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
    print(f"{rate:,.0f} world-steps per second")


def compare() -> None:
    """Measure drivers without training."""
    print("\n== Success of random actions, a script and a trained policy in juggle")
    for player in ("random", "striker", "zoo/juggle"):
        found = ah.evaluate(player, "juggle", episodes=200)
        print(f"{player:12s} success {found.success:.3f}, return {found.returns:.2f}")


def train(folder: Path) -> Path:
    """Train a policy and measure it on two backends; return the folder of the run."""
    print("\n== Train touch, then measure it on two backends")
    result = ah.train("touch", folder / "touch", total_steps=500_000)
    print(f"{result.steps:,} steps, {result.folder}")
    for backend in ("numba", "pymunk"):
        found = ah.evaluate(result.folder, episodes=200, backend=backend)
        low, high = found.success_interval
        print(f"{backend}: success {found.success:.3f} ({low:.3f} .. {high:.3f})")
    return result.folder


def keep(run: Path, folder: Path) -> None:
    """Record episodes of a policy and write a video of the first one."""
    print("\n== Record 20 episodes, and write a video of the first one")
    policy, path = ah.load_policy(run), folder / "recording"
    record_episodes(policy, "mine", "touch", 20, path, 0, {})
    steps = sum(len(episode) for episode in read_recording(path).episodes)
    write_replay(Replay(one_episode(path)), folder / "touch.gif")
    print(f"{path}: {steps} steps; {folder / 'touch.gif'}")


def main(
    out: Annotated[Path, typer.Option(help="New folder of all files.")] = Path(
        "runs/first-hour"
    ),
) -> None:
    """Run all steps."""
    began = time.perf_counter()
    look()
    compare()
    keep(train(out), out)
    print(
        f"\n{time.perf_counter() - began:.0f} s. "
        "Next: docs/own_task.md; airhockey play duel"
    )


if __name__ == "__main__":
    typer.run(main)

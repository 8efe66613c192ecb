"""Train MAPPO, IPPO and MADDPG of BenchMARL on the games with teams; print a table.

    python -m venv .venv-benchmarl
    .venv-benchmarl/bin/pip install 'benchmarl==1.5.2' -e . plugins/benchmarl_airhockey
    .venv-benchmarl/bin/python scripts/reproduce/marl.py --seeds 3
    .venv-benchmarl/bin/python scripts/reproduce/marl.py --seeds 0      # the table

BenchMARL 1.5 needs a TorchRL below 0.12, and the extra ``ecosystem`` needs a later one.
It therefore has a separate environment. BenchMARL is not modified. The tasks are those
of the package `plugins/benchmarl_airhockey`, which steps all worlds in one call.

All policies of a team share a network. The critics of MAPPO and MADDPG observe the true
state. In doubles the team plays against two goalkeepers. A finished run adds a row to
``docs/data/marl.csv``. A run that has a row is not trained again. The final policy is
measured by its most likely actions, over episodes that training does not use.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Annotated

import torch
import typer
from benchmarl.algorithms import IppoConfig, MaddpgConfig, MappoConfig
from benchmarl.experiment import Experiment, ExperimentConfig
from benchmarl.models.mlp import MlpConfig
from benchmarl_airhockey import AirHockeyTask
from rich.console import Console
from rich.table import Table
from rows import DATA, Again, Book, Cell, Row, RowsFile, read
from torchrl.envs.utils import ExplorationType, set_exploration_type

import marl_airhockey as ah
from marl_airhockey.build import build_world
from marl_airhockey.envs.torchrl_env import AirHockeyTorchEnv
from marl_airhockey.evaluation.evaluate import TEST_SEED, evaluate

ALGORITHMS = {"mappo": MappoConfig, "ippo": IppoConfig, "maddpg": MaddpgConfig}
GAMES = {
    "rally": {},
    "team_juggle": {},
    "doubles": dict.fromkeys(("paddle_2", "paddle_3"), "goalkeeper"),
}
"""Drivers of the other team, by game."""
SCRIPTS = ("striker", "allround")
"""Drivers that are measured for comparison."""
WORLDS, EPISODES = 100, 500
FIELDS = ("game", "policy", "seed", "frames", "success", "team_return", "cpu_minutes")
BOOK = Book(DATA / "marl.csv", FIELDS[:3])


def settings(frames: int) -> ExperimentConfig:
    """Return the settings of all runs: one core, 100 worlds, no logs, no files."""
    config = ExperimentConfig.get_from_yaml()
    config.lr, config.share_policy_params = 3e-4, True
    config.on_policy_n_envs_per_worker = config.off_policy_n_envs_per_worker = WORLDS
    config.on_policy_collected_frames_per_batch = 100 * WORLDS
    config.on_policy_n_minibatch_iters, config.on_policy_minibatch_size = 10, 1000
    config.off_policy_collected_frames_per_batch = 20 * WORLDS
    config.off_policy_n_optimizer_steps = 100
    config.off_policy_train_batch_size = 256
    config.off_policy_init_random_frames = 100 * WORLDS
    config.max_n_frames, config.max_n_iters = frames, None
    config.evaluation, config.loggers, config.create_json = False, [], False
    config.save_folder = tempfile.mkdtemp()
    return config


def measure(experiment: Experiment, game: str) -> tuple[float, float]:
    """Return the success and the mean return of a team over whole episodes."""
    world = build_world(game, EPISODES, False, {"drivers": GAMES[game]})
    env = AirHockeyTorchEnv(world)
    env.set_seed(TEST_SEED)
    seen = env.reset()
    going = torch.ones(EPISODES, dtype=torch.bool)
    paid, succeeded = torch.zeros(EPISODES), torch.zeros(EPISODES, dtype=torch.bool)
    with torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC):
        while bool(going.any()):
            seen = env.step(experiment.policy(seen))["next"]
            paid += going * seen["team_0", "reward"][:, 0, 0]
            success = torch.as_tensor(world.episode.success[:, 0].copy())
            succeeded |= going & success
            going &= ~seen["done"][:, 0]
    env.close()
    return float(succeeded.float().mean()), float(paid.mean())


def train_cell(game: str, algorithm: str, seed: int, frames: int) -> Row:
    """Train one policy and return its row."""
    began = time.process_time()
    task = AirHockeyTask[game.upper()].get_from_yaml()
    if GAMES[game]:
        task.config["opponent"] = "goalkeeper"
    experiment = Experiment(
        task=task,
        algorithm_config=ALGORITHMS[algorithm].get_from_yaml(),
        model_config=MlpConfig.get_from_yaml(),
        critic_model_config=MlpConfig.get_from_yaml(),
        seed=seed,
        config=settings(frames),
    )
    experiment.run()
    minutes = (time.process_time() - began) / 60
    success, paid = measure(experiment, game)
    values = game, algorithm, seed, experiment.total_frames, success, paid, minutes
    return dict(zip(FIELDS, values, strict=True))


def play_script(game: str, name: str) -> Row:
    """Return the row of a team of scripts."""
    teammate = {"paddle_1": name, **GAMES[game]}
    result = evaluate(
        ah.make_driver(name),
        game,
        episodes=EPISODES,
        name=name,
        exact=True,
        drivers=teammate,
    )
    values = game, name, "", 0, result.success, result.returns, 0.0
    return dict(zip(FIELDS, values, strict=True))


def print_table(path: Path) -> None:
    """Print means over seeds, with the smallest and the largest values."""
    headers = "game", "policy", "seeds", "frames", "success", "return", "CPU-min a seed"
    table, rows = Table(*headers), read(path)
    for game, policy in dict.fromkeys((row["game"], row["policy"]) for row in rows):
        mine = [r for r in rows if (r["game"], r["policy"]) == (game, policy)]
        table.add_row(
            *(game, policy, str(len(mine)), mine[0]["frames"]),
            *(spread([float(r[name]) for r in mine]) for name in FIELDS[4:]),
        )
    Console(width=110).print(table)


def spread(values: list[float]) -> str:
    """Return a mean and, for several values, the smallest and the largest one."""
    mean = sum(values) / len(values)
    ends = f" ({min(values):.2f} .. {max(values):.2f})" if len(values) > 1 else ""
    return f"{mean:.2f}{ends}"


def main(
    games: Annotated[
        list[str] | None, typer.Argument(help="Names of games; by default all.")
    ] = None,
    seeds: Annotated[int, typer.Option(help="Number of runs of each algorithm.")] = 3,
    frames: Annotated[
        int, typer.Option(help="Number of steps of a run, summed over all worlds.")
    ] = 500_000,
    again: Again = False,
    rows: RowsFile = None,
) -> None:
    """Train the runs that have no row, then print the table."""
    torch.set_num_threads(1)
    chosen = games or list(GAMES)
    book = BOOK.at(rows)
    cells: list[Cell] = [(game, name, "") for game in chosen for name in SCRIPTS]
    cells += [
        (game, algorithm, seed)
        for seed in range(seeds)
        for game in chosen
        for algorithm in ALGORITHMS
    ]
    for game, policy, seed in book.missing(cells, again):
        scripted = policy in SCRIPTS
        row = (
            play_script(game, policy)
            if scripted
            else train_cell(game, policy, seed, frames)
        )
        row |= {k: round(v, 4) for k, v in row.items() if isinstance(v, float)}
        book.keep(row)
        print(row, flush=True)
    print_table(book.path)


if __name__ == "__main__":
    typer.run(main)

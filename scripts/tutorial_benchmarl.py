"""MAPPO with BenchMARL, on the games as TorchRL sees them.

    python -m venv .venv-benchmarl
    .venv-benchmarl/bin/pip install torch 'benchmarl==1.5.2' -e .
    .venv-benchmarl/bin/python scripts/tutorial_benchmarl.py duel rally

BenchMARL 1.5 wants a TorchRL below 0.12, the extra `ecosystem` a later one: so it has
an environment of its own. A task of BenchMARL's is a class that builds an environment
and tells its specs; all but the first is what its class for PettingZoo does.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from typing import Annotated, Any

import torch
import typer
from benchmarl.algorithms import MappoConfig
from benchmarl.environments.pettingzoo.common import PettingZooClass
from benchmarl.experiment import Experiment, ExperimentConfig
from benchmarl.models.mlp import MlpConfig
from torchrl.envs import EnvBase
from torchrl.envs.libs.pettingzoo import PettingZooWrapper

import marl_airhockey as ah


class AirHockey(PettingZooClass):  # type: ignore[misc]
    """Task of BenchMARL's: a game with a group for each team, and its true state."""

    def get_env_fun(
        self, num_envs: int, continuous_actions: bool, seed: int | None, device: Any
    ) -> Callable[[], EnvBase]:
        """Return what builds the environment."""

        def build() -> EnvBase:
            env = ah.parallel_env(self.name.lower(), **self.config)
            return PettingZooWrapper(
                env,
                group_map=env.group_map,
                return_state=True,
                categorical_actions=False,
                seed=seed,
                device=device,
            )

        return build

    def supports_continuous_actions(self) -> bool:
        """Return True: actions are velocities."""
        return True

    def supports_discrete_actions(self) -> bool:
        """Return False."""
        return False

    def has_state(self) -> bool:
        """Return True: the critic sees what no agent sees alone."""
        return True

    def has_render(self, env: EnvBase) -> bool:
        """Return False, as no pictures are asked for here."""
        return False

    @staticmethod
    def env_name() -> str:
        """Return the name under which results are filed."""
        return "marl_airhockey"


def train(game: str, iterations: int, frames: int, seed: int) -> None:
    """Train a policy for each team and print how it goes."""
    config = ExperimentConfig.get_from_yaml()
    config.sampling_device = config.train_device = config.buffer_device = "cpu"
    config.on_policy_collected_frames_per_batch = frames
    config.on_policy_n_envs_per_worker = 4
    config.on_policy_n_minibatch_iters, config.on_policy_minibatch_size = 4, 500
    config.max_n_frames, config.max_n_iters = None, iterations
    config.evaluation, config.loggers, config.create_json = False, [], False
    config.save_folder = tempfile.mkdtemp()
    config.share_policy_params = True
    experiment = Experiment(
        task=AirHockey(game.upper(), {"max_cycles": 200}),
        algorithm_config=MappoConfig.get_from_yaml(),
        model_config=MlpConfig.get_from_yaml(),
        critic_model_config=MlpConfig.get_from_yaml(),
        seed=seed,
        config=config,
    )
    began = time.perf_counter()
    experiment.run()
    seconds = time.perf_counter() - began
    done = experiment.total_frames
    print(f"{game}: {done:,} steps at {done / seconds:,.0f} per second")


def main(
    games: Annotated[list[str], typer.Argument(help="Games with two seats or more.")],
    iterations: Annotated[int, typer.Option(help="Policy updates.")] = 3,
    frames: Annotated[int, typer.Option(help="Steps between two updates.")] = 2000,
    seed: Annotated[int, typer.Option(help="Of networks and environments.")] = 0,
) -> None:
    """Train MAPPO on some games, one after the other."""
    torch.set_num_threads(1)
    for game in games:
        train(game, iterations, frames, seed)


if __name__ == "__main__":
    typer.run(main)

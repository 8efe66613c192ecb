"""Engine "rllib": PPO of Ray, with worlds stepped in any number of processes.

It runs on a local Ray, or on the cluster in ``RAY_ADDRESS``. Each env runner steps its
share of the worlds as one batch and returns chunks of episodes for each of its slots.
There are two differences from the engine "sb3": the learning rate falls on a fixed
schedule, and each runner has its own pool of the learner's snapshots.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from functools import partial
from pathlib import Path

import ray
import torch
from ray.rllib.algorithms.ppo import PPO
from ray.rllib.algorithms.ppo import PPOConfig as RLlibConfig
from ray.rllib.core import DEFAULT_MODULE_ID
from ray.rllib.core.rl_module.rl_module import RLModuleSpec

from marl_airhockey.envs.slots import SlotEnv
from marl_airhockey.learn.engine import evaluate_and_record
from marl_airhockey.learn.evaluate_policy import Metrics
from marl_airhockey.learn.logs import RunLog
from marl_airhockey.learn.ppo_config import PPOConfig
from marl_airhockey.learn.rllib_runner import RUNNER_CPU, BatchRunner, PolicyModule
from marl_airhockey.learn.run import TrainingRun
from marl_airhockey.learn.self_play import make_training_env
from marl_airhockey.policies.numpy_policy import NumpyPolicy
from marl_airhockey.policies.policy import policy_driver


def build_algorithm(config: PPOConfig, folder: Path, begun: bool = False) -> PPO:
    """Build the PPO of RLlib for a configuration; Ray must be running.

    Args:
        config: Configuration of the run.
        folder: Folder of the run.
        begun: True if the run is resumed, so that worlds have other seeds.
    """
    probe = make_training_env(config, 1 if not config.self_play else 2, folder / "pool")
    layout = probe.world.observer.layout
    model = {
        "centre": layout.centre.tolist(),
        "unit": layout.unit.tolist(),
        "hidden": config.hidden,
        "log_std_init": config.log_std_init,
        "card": config.card(layout.labels),
    }
    probe.close()
    rate = config.learning_rate
    settings = {"train": config, "folder": str(folder.resolve()), "begun": begun}
    return (
        RLlibConfig()
        .environment(env=SlotEnv, env_config=settings)
        .env_runners(
            env_runner_cls=BatchRunner,
            num_env_runners=config.num_env_runners,
            num_envs_per_env_runner=1,
            rollout_fragment_length=config.n_steps,
        )
        .learners(num_learners=0)
        .rl_module(rl_module_spec=RLModuleSpec(PolicyModule, model_config=model))
        .training(
            train_batch_size_per_learner=config.n_steps * config.slots,
            minibatch_size=config.batch_size,
            num_epochs=config.n_epochs,
            lr=[[0, rate], [config.total_steps, 0.1 * rate]],
            gamma=config.gamma,
            lambda_=config.gae_lambda,
            clip_param=config.clip_range,
            vf_clip_param=float("inf"),
            vf_loss_coeff=0.5,
            use_kl_loss=False,
            entropy_coeff=config.ent_coef,
            grad_clip=config.max_grad_norm,
        )
        .fault_tolerance(restart_failed_env_runners=True)
        .debugging(seed=config.seed, log_level="ERROR")
        .build_algo()
    )


def start_ray(runners: int) -> None:
    """Join the cluster in ``RAY_ADDRESS``, or start a small local Ray."""
    if ray.is_initialized():
        return
    if "RAY_ADDRESS" in os.environ:
        ray.init(log_to_driver=False)
        return
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    ray.init(
        address="local",
        # Each runner counts as a CPU, and there may be more runners than cores.
        num_cpus=max(os.cpu_count() or 1, runners + 1),
        include_dashboard=False,
        object_store_memory=400_000_000,
        log_to_driver=False,
        logging_level="ERROR",
        _temp_dir=tempfile.mkdtemp(prefix="ray-"),
    )


def _algorithm_state(run: TrainingRun[PPOConfig]) -> Path:
    """Return the folder of the algorithm's state at the steps in ``state.json``.

    Folders of other steps remain from a killed process.
    """
    return (run.folder / f"rllib-{run.progress.steps:012d}").resolve()


def train_with_rllib(run: TrainingRun[PPOConfig]) -> Metrics:
    """Train a run to its end, or resume it; return the last evaluation."""
    config, folder, progress = run.config, run.folder, run.progress
    torch.set_num_threads(config.torch_threads)
    start_ray(config.num_env_runners)
    algo = build_algorithm(config, folder, begun=progress.steps > 0)
    if progress.steps:
        algo.restore_from_path(_algorithm_state(run))

    def policy() -> NumpyPolicy:
        module: PolicyModule = algo.get_module(DEFAULT_MODULE_ID)
        return module.to_numpy()

    def save(name: str) -> None:
        policy().save(folder / f"{name}.npz")

    def advance() -> tuple[int, float]:
        sampled = algo.train().get("env_runners", {})
        if config.num_env_runners:  # The time of other processes is added.
            progress.learning_cpu_seconds += float(sampled.get(RUNNER_CPU, 0.0))
        steps = int(sampled.get("num_env_steps_sampled", 0))
        return progress.steps + steps, config.learning_rate

    def evaluate() -> Metrics:
        now, older = policy(), list(folder.glob("rllib-*"))
        algo.save_to_path(_algorithm_state(run))
        make = partial(policy_driver, now, "training")
        row = evaluate_and_record(run, make, log, save)
        for path in older:
            shutil.rmtree(path)
        if config.self_play:
            now.save(run.checkpoint_path)
        return row

    log = RunLog(folder, progress.steps)
    try:
        return run.train(advance, evaluate, log)
    finally:
        algo.stop()

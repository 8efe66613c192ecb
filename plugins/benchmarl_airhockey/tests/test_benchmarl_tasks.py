"""BenchMARL's own checks of a task package: configurations, algorithms, tasks."""

from types import SimpleNamespace

import pytest
from benchmarl.algorithms import IppoConfig, MasacConfig, algorithm_config_registry
from benchmarl.environments import task_config_registry
from benchmarl.experiment import Experiment, ExperimentConfig
from benchmarl.hydra_config import load_task_config_from_hydra
from benchmarl.models import MlpConfig
from benchmarl_airhockey import AirHockeyTask
from hydra import compose, initialize_config_module
from torch import nn
from torchrl.envs.utils import check_env_specs

CONTINUOUS = [
    config
    for config in algorithm_config_registry.values()
    if config.supports_continuous_actions()
]


@pytest.fixture
def settings(tmp_path):
    """Settings of a tiny experiment, with one evaluation."""
    config = ExperimentConfig.get_from_yaml()
    config.save_folder = str(tmp_path)
    config.max_n_iters, config.loggers, config.create_json = 2, [], False
    config.on_policy_collected_frames_per_batch = 40
    config.on_policy_n_envs_per_worker = config.off_policy_n_envs_per_worker = 4
    config.on_policy_n_minibatch_iters, config.on_policy_minibatch_size = 1, 10
    config.off_policy_collected_frames_per_batch = 40
    config.off_policy_n_optimizer_steps = 2
    config.off_policy_train_batch_size, config.off_policy_memory_size = 10, 100
    config.evaluation, config.render = True, True
    config.evaluation_interval, config.evaluation_episodes = 40, 2
    return config


def run(task, algorithm, settings):
    task.config["max_cycles"] = 5
    experiment = Experiment(
        task=task,
        algorithm_config=algorithm.get_from_yaml(),
        model_config=MlpConfig(
            num_cells=[8], activation_class=nn.Tanh, layer_class=nn.Linear
        ),
        seed=0,
        config=settings,
    )
    experiment.run()
    return experiment


@pytest.mark.parametrize("task", AirHockeyTask)
def test_hydra_and_yaml_give_the_same_task(task):
    name = f"airhockey/{task.name.lower()}"
    assert task_config_registry[name] is task
    with initialize_config_module("benchmarl.conf", version_base=None):
        chosen = compose(
            "config",
            overrides=[
                f"task={name}",
                "algorithm=mappo",
                "hydra.searchpath=[pkg://benchmarl_airhockey.conf]",
            ],
        )
    assert load_task_config_from_hydra(chosen.task, name) == task.get_from_yaml()


@pytest.mark.parametrize("task", AirHockeyTask)
def test_every_task_passes_torchrls_check(task):
    check_env_specs(task.get_from_yaml().get_env_fun(3, True, 0, "cpu")())


@pytest.mark.parametrize("algorithm", CONTINUOUS)
def test_every_algorithm_trains(algorithm, settings):
    run(AirHockeyTask.DUEL.get_from_yaml(), algorithm, settings)


@pytest.mark.parametrize("algorithm", [IppoConfig, MasacConfig])
@pytest.mark.parametrize("task", AirHockeyTask)
def test_every_task_trains(task, algorithm, settings):
    run(task.get_from_yaml(), algorithm, settings)


def test_an_evaluation_has_images():
    task = AirHockeyTask.RALLY.get_from_yaml()
    env = task.get_env_fun(2, True, 0, "cpu")()
    env.reset()
    image = task.render_callback(SimpleNamespace(task=task), env, None)
    assert image.shape[1:] == (440, 3)
    assert image.float().std() > 20


def test_an_opponent_leaves_one_team(settings):
    task = AirHockeyTask.DOUBLES.get_from_yaml()
    task.config["opponent"] = "goalkeeper"
    experiment = run(task, IppoConfig, settings)
    assert experiment.group_map == {"team_0": ["paddle_0", "paddle_1"]}


def test_an_unknown_field_is_named(tmp_path):
    (tmp_path / "duel.yaml").write_text("goals: 3\n")
    with pytest.raises(TypeError, match="goals"):
        AirHockeyTask.DUEL.get_from_yaml(str(tmp_path / "duel.yaml"))

"""Public names of the library, and the modules that define them."""

import types

from .evaluation.crossplay import crossplay as crossplay
from .evaluation.evaluate import evaluate as evaluate
from .evaluation.league import league as league
from .evaluation.suites.suite import load_suite as load_suite
from .learn.train import train as train
from .make import env as env
from .make import gym_env as gym_env
from .make import make_sb3_vec as make_sb3_vec
from .make import make_torchrl as make_torchrl
from .make import make_vec as make_vec
from .make import make_world as make_world
from .make import parallel_env as parallel_env
from .policies.load import load_policy as load_policy
from .registry import backend_names as backend_names
from .registry import driver_names as driver_names
from .registry import make_driver as make_driver
from .registry import make_scenario as make_scenario
from .registry import scenario_names as scenario_names
from .rollouts.rollout import rollout as rollout

__version__: str

# Type checkers do not use the finder of `from marl_airhockey import duel_v1`.
def __getattr__(name: str) -> types.ModuleType: ...

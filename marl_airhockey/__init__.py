"""Air hockey for robot learning and multi-agent reinforcement learning."""

import sys
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

_here = Path(__file__).parent
if not (_here / "scenarios").is_dir():
    # In a checkout scenarios/ and agents/ lie beside this package; in a wheel, in it.
    __path__.append(str(_here.parent))

from marl_airhockey.envs.registration import register_all  # noqa: E402
from marl_airhockey.evaluation.evaluate import evaluate  # noqa: E402
from marl_airhockey.evaluation.league import league  # noqa: E402
from marl_airhockey.learn.train import train  # noqa: E402
from marl_airhockey.make import (  # noqa: E402
    GameFinder,
    env,
    gym_env,
    make_sb3_vec,
    make_torchrl,
    make_vec,
    make_world,
    parallel_env,
)
from marl_airhockey.policies.load import load_policy  # noqa: E402
from marl_airhockey.registry import (  # noqa: E402
    agent_names,
    backend_names,
    make_agent,
    make_scenario,
    scenario_names,
)

register_all()
sys.meta_path.append(GameFinder())

__version__ = "0.1.0"
__all__ = [
    "agent_names",
    "backend_names",
    "env",
    "evaluate",
    "gym_env",
    "league",
    "load_policy",
    "make_agent",
    "make_sb3_vec",
    "make_scenario",
    "make_torchrl",
    "make_vec",
    "make_world",
    "parallel_env",
    "scenario_names",
    "train",
]

if TYPE_CHECKING:
    # Type checkers do not ask a finder for `from marl_airhockey import duel_v0`.
    def __getattr__(name: str) -> ModuleType: ...

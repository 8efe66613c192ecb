"""Build environments by name: the public face of the library.

What needs gymnasium, pettingzoo or stable-baselines3 is imported when it is built.
"""

from __future__ import annotations

import re
from functools import partial
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import TYPE_CHECKING, Any, Unpack

from marl_airhockey.contracts.scenario import Scenario
from marl_airhockey.core.errors import UnknownKeywordError, unknown_keyword
from marl_airhockey.registry import make_scenario, scenario_names
from marl_airhockey.world.world import World

if TYPE_CHECKING:
    from gymnasium.vector import AutoresetMode
    from pettingzoo.utils.env import AECEnv

    from marl_airhockey.envs.gymnasium_env import AirHockeySingleEnv
    from marl_airhockey.envs.gymnasium_vec_env import AirHockeyVectorEnv
    from marl_airhockey.envs.pettingzoo_env import AirHockeyEnv
    from marl_airhockey.envs.sb3_vec_env import AirHockeyVecEnv
    from marl_airhockey.envs.torchrl_env import AirHockeyTorchEnv
from marl_airhockey.world.build import Keywords, build_world


def make_world(
    scenario: str | Scenario, num_worlds: int = 1, **keywords: Unpack[Keywords]
) -> World:
    """Build B worlds as arrays: ``reset(seed)``, ``step(actions (B, open, 2))``."""
    return build_world(scenario, num_worlds, autoreset=True, keywords=keywords)


def parallel_env(
    scenario: str | Scenario,
    render_mode: str | None = None,
    viewpoint: str = "top",
    **keywords: Unpack[Keywords],
) -> AirHockeyEnv:
    """Build a PettingZoo ParallelEnv of a scenario; its open seats are the agents."""
    from marl_airhockey.envs.pettingzoo_env import AirHockeyEnv

    return AirHockeyEnv(scenario, render_mode, viewpoint, **keywords)


def env(
    scenario: str | Scenario,
    render_mode: str | None = None,
    viewpoint: str = "top",
    **keywords: Unpack[Keywords],
) -> AECEnv[str, Any, Any]:
    """Build the same as a PettingZoo AEC environment, with its usual wrappers."""
    from pettingzoo.utils.conversions import parallel_to_aec
    from pettingzoo.utils.wrappers import OrderEnforcingWrapper

    return OrderEnforcingWrapper(
        parallel_to_aec(parallel_env(scenario, render_mode, viewpoint, **keywords))
    )


def gym_env(
    scenario: str | Scenario,
    render_mode: str | None = None,
    viewpoint: str = "top",
    **keywords: Unpack[Keywords],
) -> AirHockeySingleEnv:
    """Build a gymnasium Env of a scenario with one open seat, a task of one's own too.

    ``gymnasium.make`` builds the same for the scenarios that come with the library.
    """
    from marl_airhockey.envs.gymnasium_env import make_single

    return make_single(scenario, render_mode, viewpoint, **keywords)


def make_vec(
    scenario: str | Scenario,
    num_worlds: int = 1,
    autoreset_mode: str | AutoresetMode = "NextStep",
    render_mode: str | None = None,
    **keywords: Unpack[Keywords],
) -> AirHockeyVectorEnv:
    """Build a gymnasium VectorEnv of a scenario with one open seat.

    Args:
        scenario: Name of the scenario, or a scenario object.
        num_worlds: Number of worlds, B.
        autoreset_mode: "NextStep", "SameStep" or "Disabled", see `AirHockeyVectorEnv`.
        render_mode: None or "rgb_array": a picture of each world.
        **keywords: See `build.build_world`.
    """
    from marl_airhockey.envs.gymnasium_vec_env import AirHockeyVectorEnv

    if "num_envs" in keywords:
        raise UnknownKeywordError(unknown_keyword("num_envs", ["num_worlds"]))
    modes = autoreset_mode, render_mode
    return AirHockeyVectorEnv(scenario, num_worlds, *modes, **keywords)


def make_sb3_vec(
    scenario: str | Scenario,
    num_worlds: int = 1,
    render_mode: str | None = None,
    **keywords: Unpack[Keywords],
) -> AirHockeyVecEnv:
    """Build a stable-baselines3 VecEnv of num_worlds x open seats.

    Args:
        scenario: Name of the scenario, or a scenario object.
        num_worlds: Number of worlds, B.
        render_mode: None or "rgb_array": pictures of all worlds, tiled.
        **keywords: See `build.build_world`.
    """
    from marl_airhockey.core.errors import require

    require("stable_baselines3", "train")
    from marl_airhockey.envs.sb3_vec_env import AirHockeyVecEnv
    from marl_airhockey.envs.slots import SlotEnv

    return AirHockeyVecEnv(SlotEnv(scenario, num_worlds, **keywords), render_mode)


def make_torchrl(
    scenario: str | Scenario,
    num_worlds: int = 1,
    device: str = "cpu",
    **keywords: Unpack[Keywords],
) -> AirHockeyTorchEnv:
    """Build a TorchRL EnvBase of batch size (num_worlds,), a group for each team."""
    from marl_airhockey.core.errors import require

    require("torchrl", "ecosystem")
    from marl_airhockey.envs.torchrl_env import AirHockeyTorchEnv

    return AirHockeyTorchEnv(scenario, num_worlds, device, **keywords)


VERSIONED = re.compile(r"([a-z]\w*)_v(\d+)")
"""Name of a scenario and its version."""


class GameFinder(MetaPathFinder, Loader):
    """Finder of modules as PettingZoo's own games are: ``duel_v0.parallel_env()``.

    They are found by ``from marl_airhockey import duel_v0`` and by
    ``import marl_airhockey.duel_v0``.
    """

    def find_spec(
        self, fullname: str, path: object, target: object = None
    ) -> ModuleSpec | None:
        """Return the spec of a scenario with a version; None for all else.

        Raises:
            ImportError: another version of a scenario.
        """
        package, _, name = fullname.rpartition(".")
        found = VERSIONED.fullmatch(name)
        if package != __package__ or not found or found[1] not in scenario_names():
            return None
        current = make_scenario(found[1]).version
        if int(found[2]) != current:
            raise ImportError(
                f"{name}: this release of marl_airhockey plays {found[1]}_v{current}"
            )
        return ModuleSpec(fullname, self, loader_state=found[1])

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """Return the module of a game."""
        module = ModuleType(spec.name, f"PettingZoo game {spec.loader_state}.")
        vars(module)["parallel_env"] = partial(parallel_env, spec.loader_state)
        vars(module)["env"] = partial(env, spec.loader_state)
        vars(module)["raw_env"] = module.env
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Do nothing: the module is whole."""

"""Build environments by name: the public face of the library.

What an environment needs is imported when it is built.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Unpack

if TYPE_CHECKING:
    from gymnasium.vector import AutoresetMode
    from pettingzoo.utils.env import AECEnv

    from marl_airhockey.envs.gymnasium_env import AirHockeySingleEnv
    from marl_airhockey.envs.gymnasium_vec_env import AirHockeyVectorEnv
    from marl_airhockey.envs.pettingzoo_env import AirHockeyEnv
    from marl_airhockey.envs.sb3_vec_env import AirHockeyVecEnv
    from marl_airhockey.envs.torchrl_env import AirHockeyTorchEnv
    from marl_airhockey.sim.contracts.scenario import Scenario
    from marl_airhockey.sim.world.keywords import Keywords
    from marl_airhockey.sim.world.world import World


def make_world(
    scenario: str | Scenario, num_worlds: int = 1, **keywords: Unpack[Keywords]
) -> World:
    """Build B worlds as arrays: ``reset(seed)``, ``step(actions (B, open, 2))``."""
    from marl_airhockey.build import build_world

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
    from marl_airhockey.sim.world.keywords import check_keywords

    check_keywords(keywords)
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
    from marl_airhockey.sim.core.errors import require

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
    from marl_airhockey.sim.core.errors import require

    require("torchrl", "ecosystem")
    from marl_airhockey.envs.torchrl_env import AirHockeyTorchEnv

    return AirHockeyTorchEnv(scenario, num_worlds, device, **keywords)

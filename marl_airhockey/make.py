"""Functions that create environments by name.

The packages that an environment needs are imported when it is created.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Unpack, overload

if TYPE_CHECKING:
    from gymnasium.vector import AutoresetMode
    from pettingzoo.utils.env import AECEnv

    from marl_airhockey.device.world import DeviceWorld
    from marl_airhockey.envs.gymnasium_env import AirHockeySingleEnv
    from marl_airhockey.envs.gymnasium_vec_env import AirHockeyVectorEnv
    from marl_airhockey.envs.pettingzoo_env import AirHockeyEnv
    from marl_airhockey.envs.sb3_vec_env import AirHockeyVecEnv
    from marl_airhockey.envs.torchrl_env import AirHockeyTorchEnv
    from marl_airhockey.sim.contracts.scenario import Scenario
    from marl_airhockey.sim.world.keywords import Keywords
    from marl_airhockey.sim.world.world import World


def parallel_env(
    scenario: str | Scenario,
    render_mode: str | None = None,
    viewpoint: str = "top",
    **keywords: Unpack[Keywords],
) -> AirHockeyEnv:
    """Create a PettingZoo ParallelEnv of a scenario.

    Args:
        scenario: Name of a scenario or of an installed plugin, code (``my_task.py`` or
            ``package.module:Task``), a class or an object.
        render_mode: "rgb_array" for images, "human" for a window, or None.
        viewpoint: Camera of images: "top", and with the backend "robosuite" also
            "frontview", "agentview" or "birdview".
        **keywords: Keywords that all environments share. All of them are optional.

            - backend (str, default "numba"): Physics engine: "numba", "pymunk",
              "robosuite", or "real" for a real table.
            - drivers (dict, default {}): Drivers by agent name, for the seats that are
              not agents. A driver is a name, the path of a policy, a function, a model
              or an object, see `registry.make_driver`.
            - seats (str, default of the scenario): Workspace and speed of the paddles:
              "robot" (limits of a UR5e) or "arcade".
            - profile (str or Path, default "ideal"): Sensing, actuation and variation
              of the physics: "ideal", "ur5e", "ur5e-calibrated", "ur5e-authors",
              "gantry", or a TOML file.
            - observe (str, default "velocity" with the profile "ideal", otherwise
              "history"): Observation type: "velocity", "estimate", "history",
              "pixels" or "camera", see `observable.OBSERVE`.
            - goals (str, default "flat"): Form of goals. With "dict", an observation is
              a dictionary with desired and achieved goal, and the reward is 0 or 1.
            - physics (dict, str or Path, default {}): Parameters by name, the name of a
              preset, or a TOML file. A number fixes a parameter. A pair (low, high)
              samples it uniformly for each episode. The key "preset" names a preset
              whose values the others change. Units are listed in docs/physics.md.
            - control_dt (float, default 0.05 s): Time between two actions, 0.001 to
              0.2 s.
            - substeps (int or None, default of the backend): Smallest number of physics
              steps in a control step. The defaults are steps of at most 5 ms ("pymunk")
              and 1 ms ("robosuite"). "numba" and "real" have no such steps.
            - max_cycles (int or None, default of the scenario): Largest number of
              control steps in an episode.
            - options (dict, default {}): Fields of the scenario by name. The page of
              the scenario lists their units.
            - rig (str or Path, default none): File with the devices of a real table and
              their calibration, only for the backend "real".

    Returns:
        Environment with one agent for each seat without a driver. Observations are
        float32 arrays in SI units, in the ego frame of the seat.

    Raises:
        UnknownKeywordError: A keyword is unknown. The error is a TypeError and a
            ValueError.
        ValueError: A name is unknown, or a value is not valid.
        RuntimeError: The backend cannot run here. The message states what to do.
    """
    from marl_airhockey.envs.pettingzoo_env import AirHockeyEnv

    return AirHockeyEnv(scenario, render_mode, viewpoint, **keywords)


def env(
    scenario: str | Scenario,
    render_mode: str | None = None,
    viewpoint: str = "top",
    **keywords: Unpack[Keywords],
) -> AECEnv[str, Any, Any]:
    """Create a PettingZoo AECEnv of a scenario, with PettingZoo's order check.

    Args:
        scenario: Name, code, class or object, see `registry.find_scenario`.
        render_mode: "rgb_array", "human" or None for no images.
        viewpoint: Camera of images, "top" or a viewpoint of the backend.
        **keywords: Shared keywords, which `parallel_env` explains: backend="numba",
            drivers={}, seats, profile="ideal", observe, goals="flat", physics={},
            control_dt=0.05 (s), substeps, max_cycles (steps), options={}, rig.

    Returns:
        Environment with one agent for each seat without a driver.
    """
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
    """Create a gymnasium Env of a scenario with one open seat.

    ``gymnasium.make`` creates the same environment for scenarios of this library. This
    function also accepts scenarios of users.

    Args:
        scenario: Name, code, class or object, see `registry.find_scenario`.
        render_mode: "rgb_array", "human" or None for no images.
        viewpoint: Camera of images, "top" or a viewpoint of the backend.
        **keywords: Shared keywords, which `parallel_env` explains: backend="numba",
            drivers={}, seats, profile="ideal", observe, goals="flat", physics={},
            control_dt=0.05 (s), substeps, max_cycles (steps), options={}, rig.

    Returns:
        Environment of the open seat.
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
    """Create a gymnasium VectorEnv of a scenario with one open seat.

    Args:
        scenario: Name, code, class or object, see `registry.find_scenario`.
        num_worlds: Number of worlds, B.
        autoreset_mode: Time of the reset of a world that ended: "NextStep", "SameStep"
            or "Disabled", see `AirHockeyVectorEnv`.
        render_mode: "rgb_array" for an image of each world, or None.
        **keywords: Shared keywords, which `parallel_env` explains: backend="numba",
            drivers={}, seats, profile="ideal", observe, goals="flat", physics={},
            control_dt=0.05 (s), substeps, max_cycles (steps), options={}, rig.

    Returns:
        Environment of B worlds.
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
    """Create a stable-baselines3 VecEnv with an environment for each open seat.

    Args:
        scenario: Name, code, class or object, see `registry.find_scenario`.
        num_worlds: Number of worlds, B.
        render_mode: "rgb_array" for one image with tiles of all worlds, or None.
        **keywords: Shared keywords, which `parallel_env` explains: backend="numba",
            drivers={}, seats, profile="ideal", observe, goals="flat", physics={},
            control_dt=0.05 (s), substeps, max_cycles (steps), options={}, rig.

    Returns:
        Environment whose ``num_envs`` is B times the number of open seats.

    Raises:
        RuntimeError: stable-baselines3 is not installed.
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
    """Create a TorchRL EnvBase of B worlds with a group of agents for each team.

    Args:
        scenario: Name, code, class or object, see `registry.find_scenario`. On a GPU,
            the name of a scenario.
        num_worlds: Number of worlds, B, which is the batch size (B,).
        device: "cpu", or the torch device of a GPU, such as "cuda", which computes the
            worlds, see `device.world.DeviceWorld`. To use worlds of the CPU with
            tensors on a GPU, call ``.to("cuda")`` of the environment.
        **keywords: Shared keywords, which `parallel_env` explains: backend="numba",
            drivers={}, seats, profile="ideal", observe, goals="flat", physics={},
            control_dt=0.05 (s), substeps, max_cycles (steps), options={}, rig.

    Returns:
        Environment of B worlds.

    Raises:
        RuntimeError: TorchRL is not installed.
    """
    from marl_airhockey.sim.core.errors import require

    require("torchrl", "ecosystem")
    from marl_airhockey.envs.torchrl_env import AirHockeyTorchEnv

    if device == "cpu":
        from marl_airhockey.build import build_world

        world = build_world(scenario, num_worlds, autoreset=False, keywords=keywords)
        return AirHockeyTorchEnv(world)
    from marl_airhockey.device.world import DeviceWorld

    more: dict[str, Any] = {"autoreset": False, "keywords": keywords}
    return AirHockeyTorchEnv(DeviceWorld(scenario, num_worlds, device, **more))


@overload
def make_world(
    scenario: str | Scenario, num_worlds: int = 1, **keywords: Unpack[Keywords]
) -> World: ...


@overload
def make_world(
    scenario: str | Scenario, num_worlds: int, device: str, **keywords: Unpack[Keywords]
) -> DeviceWorld: ...


def make_world(
    scenario: str | Scenario,
    num_worlds: int = 1,
    device: str = "cpu",
    **keywords: Unpack[Keywords],
) -> World | DeviceWorld:
    """Create B worlds with arrays: ``reset(seed)`` and ``step(actions)``.

    Args:
        scenario: Name, code, class or object, see `registry.find_scenario`. On a GPU,
            the name of a scenario.
        num_worlds: Number of worlds, B.
        device: "cpu" for NumPy arrays, or the torch device of a GPU, such as "cuda".
        **keywords: Shared keywords, which `parallel_env` explains: backend="numba",
            drivers={}, seats, profile="ideal", observe, goals="flat", physics={},
            control_dt=0.05 (s), substeps, max_cycles (steps), options={}, rig.

    Returns:
        Worlds. On the CPU, actions are arrays (B, open, 2), and results are a
        `StepResult`. `device.world.DeviceWorld` explains those of a GPU.
    """
    if device != "cpu":
        from marl_airhockey.sim.core.errors import require

        require("torch", "cuda")
        from marl_airhockey.device.world import DeviceWorld

        return DeviceWorld(scenario, num_worlds, device, keywords=keywords)
    from marl_airhockey.build import build_world

    return build_world(scenario, num_worlds, autoreset=True, keywords=keywords)

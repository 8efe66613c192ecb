"""Air hockey tasks as vector environments for LeRobot.

LeRobot calls `make_env`. In a repository of the Hub, this file is `env.py`.
"""

from __future__ import annotations

from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Dict
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv, VectorEnv

import marl_airhockey as ah
from marl_airhockey.data.exchange.lerobot import STATE, WIDTH, table_image
from marl_airhockey.envs.describe import what
from marl_airhockey.hardware.calibration.lab_rig import opened_rig
from marl_airhockey.hardware.rig import Rig
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.render.picture import Frame, draw
from marl_airhockey.sim.render.renderer import Renderer

TASK = "juggle"
"""Default task."""
CAMERA = "table"
"""Name of the camera, as in datasets that this library exports."""
OBSERVATIONS = {
    "pixels_agent_pos": ("pixels", "agent_pos"),
    "environment_state_agent_pos": ("environment_state", "agent_pos"),
}
"""Parts of an observation, by type."""
Vectors = dict[str, dict[int, VectorEnv]]
"""Vector environments by suite and number."""


class LeRobotTask(gymnasium.Env):
    """Air hockey task of one seat with the observations of LeRobot.

    - Observation: dictionary with ``agent_pos`` (D,) float32, the observation of the
      seat in SI units, and with ``pixels``, a dictionary with the image ``table``
      (H, W, 3) uint8 RGB, or ``environment_state`` (S,) float32, the true state.
    - Action: target velocity (2,), divided by the top speed, -1 to 1, ego frame.
    - Info: ``is_success`` of the episode so far, after every step and reset.

    Args:
        task: Name of a scenario with one open seat.
        obs_type: Type of observations, a key of `OBSERVATIONS`.
        width: Width of the image, pixels. The height follows from the table.
        **keywords: Keywords of `marl_airhockey.gym_env`.

    Raises:
        ValueError: The task or the type of observations is unknown.
    """

    def __init__(
        self,
        task: str = TASK,
        obs_type: str = "pixels_agent_pos",
        width: int = WIDTH,
        **keywords: Any,
    ) -> None:
        if obs_type not in OBSERVATIONS:
            known = ", ".join(OBSERVATIONS)
            raise ValueError(f"obs_type {obs_type!r}: expected one of {known}")
        self._open = ExitStack()
        if keywords.get("rig"):
            keywords["rig"] = str(self._open.enter_context(opened_rig(keywords["rig"])))
        self._env = ah.gym_env(task, "rgb_array", **keywords)
        self._open.callback(self._env.close)
        world = self._env.world
        self._renderer = Renderer(world, "rgb_array", task)
        self._width = width
        self.task = task
        self.task_description = what(world.scenario)
        self._max_episode_steps = int(world.limits[0])
        self.render_mode = "rgb_array"
        self.metadata = self._env.metadata
        self.action_space = self._env.action_space
        self.scene = world.scene
        shape = image_shape(width, keywords.get("rig"), self.scene)
        size = len(self.scene.bodies) * 6
        parts = {
            "pixels": Dict({CAMERA: Box(0, 255, shape, np.uint8)}),
            "environment_state": Box(-np.inf, np.inf, (size,), np.float32),
            "agent_pos": self._env.observation_space,
        }
        self._parts = OBSERVATIONS[obs_type]
        self.observation_space = Dict({name: parts[name] for name in self._parts})

    def _picture(self) -> Any:
        """Return the image (H, W, 3) uint8 RGB, without texts and trails."""
        world = self._env.world
        if world.live:
            return world.backend.photograph(0, "camera", (), self._width)
        return table_image(self._renderer, self._width)

    def _seen(self, observation: Any) -> dict[str, Any]:
        shown: dict[str, Any] = {"agent_pos": observation}
        if "pixels" in self._parts:
            shown["pixels"] = {CAMERA: self._picture()}
        else:
            state = self._env.world.state
            flat = [getattr(state, name)[0].reshape(-1) for name in STATE]
            shown["environment_state"] = np.concatenate(flat).astype(np.float32)
        return shown

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; the options of LeRobot have no effect."""
        own = {k: v for k, v in (options or {}).items() if not k.startswith("lerobot_")}
        super().reset(seed=seed)
        observation, info = self._env.reset(seed=seed, options=own or None)
        return self._seen(observation), info

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Move by one control step."""
        observation, *rest = self._env.step(action)
        return (self._seen(observation), *rest)

    def render(self) -> Any:
        """Return an image (H, W, 3) uint8 RGB with score and trails."""
        return self._env.render()

    def close(self) -> None:
        """Close the task, and the lab if this task opened one."""
        self._open.close()


def image_shape(width: int, rig: str | None, scene: Scene) -> tuple[int, ...]:
    """Return the shape (H, W, 3) of an image.

    Args:
        width: Width, pixels.
        rig: File of a real table, whose camera has the image; None for a simulation.
        scene: Scene of a simulation.
    """
    if rig is not None:
        across, down = Rig.load(Path(rig)).view.lens.size
        return round(width * down / across), width, 3
    empty = Frame(scene, scene.still_state(1).map(lambda x: x[0]))
    return draw(empty, width, bar=0).shape


def make_env(n_envs: int = 1, use_async_envs: bool = False, cfg: Any = None) -> Vectors:
    """Return vector environments of one or more tasks, for LeRobot.

    Args:
        n_envs: Number of environments of each task.
        use_async_envs: True for a process for each environment.
        cfg: Configuration with the tasks, separated by commas, and optional fields of
            `LeRobotTask`; None for the default task.

    Returns:
        Vector environments by task and number. They reset an environment in the step
        in which its episode ends, as LeRobot expects.

    Raises:
        ValueError: A task is unknown, tasks have observations of different shapes, or
            several environments are to share one real table.
    """
    tasks = [name.strip() for name in (getattr(cfg, "task", None) or TASK).split(",")]
    keywords = dict(getattr(cfg, "gym_kwargs", {}))
    if keywords.get("backend") == "real" and (n_envs > 1 or len(tasks) > 1):
        raise ValueError(
            "there is one real table; use --eval.batch_size=1 and one --env.task"
        )
    vectors: Vectors = {}
    for task in tasks:
        makers = [partial(LeRobotTask, task, **keywords)] * n_envs
        mode = AutoresetMode.SAME_STEP
        if use_async_envs and n_envs > 1:
            made = AsyncVectorEnv(makers, autoreset_mode=mode, context="forkserver")
        else:
            made = SyncVectorEnv(makers, autoreset_mode=mode)
        vectors[task] = {0: made}
    spaces = {t: one[0].single_observation_space for t, one in vectors.items()}
    if any(space != spaces[tasks[0]] for space in spaces.values()):
        sizes = {t: space["agent_pos"].shape for t, space in spaces.items()}
        raise ValueError(f"tasks with different observations: {sizes}; name one task")
    return vectors

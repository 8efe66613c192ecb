"""Environment of LeRobot with the type ``airhockey``."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any

from gymnasium.vector import VectorEnv
from lerobot.configs import FeatureType, PolicyFeature
from lerobot.envs.configs import EnvConfig
from lerobot.utils.constants import ACTION, OBS_ENV_STATE, OBS_IMAGES, OBS_STATE

from lerobot_env_airhockey.env import (
    CAMERA,
    TASK,
    WIDTH,
    LeRobotTask,
    image_shape,
    make_env,
)
from marl_airhockey.build import table_keywords
from marl_airhockey.hardware.calibration.lab_rig import opened_rig

KEYS = {
    ACTION: ACTION,
    "agent_pos": OBS_STATE,
    "environment_state": OBS_ENV_STATE,
    f"pixels/{CAMERA}": f"{OBS_IMAGES}.{CAMERA}",
}
"""Features of policies, by feature of the environment."""


@EnvConfig.register_subclass("airhockey")
@dataclass
class AirHockeyEnvConfig(EnvConfig):
    """Configuration of the air hockey tasks."""

    task: str | None = TASK
    """Task, or tasks separated by commas."""
    fps: int = 20
    """Control rate, steps/s."""
    obs_type: str = "pixels_agent_pos"
    """Type of observations, see `env.OBSERVATIONS`."""
    width: int = WIDTH
    """Width of the image, pixels."""
    profile: str = "ideal"
    """Profile of the simulation. A real table has its own."""
    backend: str = "numba"
    """Physics engine, or "real" for a real table."""
    rig: str = ""
    """File with the devices of a real table."""
    table: str = ""
    """Preset of the table; "" for that of the task."""
    features_map: dict[str, str] = field(default_factory=lambda: dict(KEYS))

    def __post_init__(self) -> None:
        """Fill the features from the spaces of the first task."""
        first = (self.task or TASK).split(",")[0].strip()
        # A real table would open its devices, so the spaces are of a simulation.
        with ExitStack() as stack:
            keywords = self.gym_kwargs
            rig = keywords.get("rig")
            if rig is not None:
                rig = keywords["rig"] = str(stack.enter_context(opened_rig(rig)))
                keywords = {**table_keywords(keywords), "backend": "numba"}
                del keywords["rig"]
            one = LeRobotTask(first, **keywords)
            stack.callback(one.close)
            image = image_shape(self.width, rig, one.scene)
        kinds = {"agent_pos": FeatureType.STATE, "environment_state": FeatureType.ENV}
        spaces = dict(one.observation_space.items())
        shapes = {ACTION: (FeatureType.ACTION, one.action_space.shape)}
        if spaces.pop("pixels", None) is not None:
            shapes[f"pixels/{CAMERA}"] = FeatureType.VISUAL, image
        shapes |= {name: (kinds[name], space.shape) for name, space in spaces.items()}
        self.features = {
            name: PolicyFeature(type=kind, shape=shape)
            for name, (kind, shape) in shapes.items()
        }

    @property
    def package_name(self) -> str:
        """Name of this package."""
        return __name__

    @property
    def gym_kwargs(self) -> dict[str, Any]:
        """Keywords of `LeRobotTask`."""
        return {
            "obs_type": self.obs_type,
            "width": self.width,
            "profile": self.profile,
            "backend": self.backend,
            "control_dt": 1.0 / self.fps,
            **({"rig": self.rig} if self.rig else {}),
            **({"options": {"table": self.table}} if self.table else {}),
        }

    def create_envs(
        self, n_envs: int, use_async_envs: bool = False
    ) -> dict[str, dict[int, VectorEnv]]:
        """Return the vector environments of the tasks."""
        return make_env(n_envs, use_async_envs, self)

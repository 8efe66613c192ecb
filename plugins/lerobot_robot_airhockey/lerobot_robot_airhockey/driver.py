"""Driver of this library as a teleoperator of LeRobot."""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any

import numpy as np
from lerobot.teleoperators import Teleoperator

from lerobot_robot_airhockey.config import AirHockeyDriverConfig
from lerobot_robot_airhockey.device import VelocityDevice
from lerobot_robot_airhockey.paddle import AirHockeyPaddle
from marl_airhockey.policies.policy import Policy
from marl_airhockey.registry import make_driver
from marl_airhockey.sim.contracts.driver import View
from marl_airhockey.sim.core.rng import RandomStreams

ONE = np.zeros(1, np.int64)


class AirHockeyDriver(VelocityDevice, Teleoperator):
    """Driver that moves the paddle which is connected in the same process.

    Args:
        config: Name and seed of the driver.
    """

    config_class = AirHockeyDriverConfig
    name = "airhockey_driver"

    def __init__(self, config: AirHockeyDriverConfig) -> None:
        super().__init__(config)
        self.config = config
        self._open = ExitStack()
        self._driver: Any = None
        self._memory: dict[str, Any] | None = None

    @property
    def feedback_features(self) -> dict[str, type]:
        """Types of the feedback: there is none."""
        return {}

    @property
    def is_connected(self) -> bool:
        """True while the driver is open."""
        return self._driver is not None

    def connect(self, calibrate: bool = True) -> None:
        """Open the driver.

        Raises:
            ValueError: The driver is unknown, must not move a real arm, or needs the
                observations of a task.
        """
        driver = make_driver(self.config.driver)
        if isinstance(driver, Policy):
            self._read(None)
        if driver.erratic or driver.commands_device or driver.measured() is not None:
            raise ValueError(f"driver {self.config.driver!r} cannot move a real arm")
        self._driver = self._open.enter_context(driver)
        self._memory = None
        # One stream for all steps: a driver must not get the same numbers each time.
        seeds = np.array([self.config.seed])
        self._rng = RandomStreams.keyed(seeds, ONE, "lerobot")

    def get_action(self) -> dict[str, float]:
        """Return the action of the driver for the robot's last observation.

        Raises:
            RuntimeError: No paddle is connected.
        """
        paddle = AirHockeyPaddle.connected
        if self._driver is None or paddle is None:
            raise RuntimeError("airhockey_driver: no airhockey_paddle is connected")
        seat = paddle.scene.seats[0]
        if self._memory is None:
            self._memory = self._driver.reset(seat, self._rng, 1)
        view = View(
            scene=paddle.scene,
            state=paddle.state,
            read=self._read,
            labels=(),
            top_speed=np.array([paddle.top_speed]),
            reach=np.asarray(seat.reach),
            rng=self._rng,
            seat=0,
            control_dt=1.0 / paddle.config.fps,
        )
        action, self._memory = self._driver.act(view, self._memory)
        x, y = np.clip(action[0], -1.0, 1.0)
        return {"x": float(x), "y": float(y)}

    def _read(self, state: Any) -> Any:
        raise ValueError(
            f"driver {self.config.driver!r} needs the observations of a task; evaluate "
            "it with airhockey evaluate --backend real"
        )

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Do nothing: a driver has no feedback."""

    def disconnect(self) -> None:
        """Close the driver."""
        self._driver = None
        self._open.close()

"""Paddle of a real air hockey table, or of the virtual lab, as a robot of LeRobot."""

from __future__ import annotations

import time
from contextlib import ExitStack
from functools import cached_property
from typing import Any

import numpy as np
from lerobot.robots import Robot

import marl_airhockey as ah
from lerobot_robot_airhockey.config import AirHockeyPaddleConfig
from lerobot_robot_airhockey.device import VelocityDevice
from marl_airhockey.hardware.calibration.lab_rig import opened_rig
from marl_airhockey.hardware.robot import RobotError
from marl_airhockey.hardware.table.backend import RealBackend
from marl_airhockey.sim.core.state import State

MOTION = ("x", "y", "vx", "vy")
FEATURES = (
    *(f"own.{name}" for name in MOTION),
    *(f"puck.{name}" for name in MOTION),
    *("sent.x", "sent.y"),
    *("frame.age", "frame.delay", "command.age", "period"),
)
"""Numbers of an observation, see `AirHockeyPaddle`."""
CAMERA = "table"
"""Name of the camera, as in datasets that this library exports."""
RESTS, WAITING = 0.05, 1.0
"""Speed of a puck below which it rests, m/s, and time after which the lab re-serves
it, s."""
STALE = 0.15
"""Age of an observation after which LeRobot did something else than control, s."""
FRESH = 1.0
"""Longest time until a new frame arrives after that, s."""


class AirHockeyPaddle(VelocityDevice, Robot):
    """Paddle that an arm moves, with the camera over the table.

    Actions are ``x`` and ``y``, the target velocity as a fraction of the top speed, -1
    to 1, in the table frame, like actions of the environments.

    Observations are numbers and the image ``table`` of the camera:

    - ``own.*``: position, m, and velocity, m/s, of the paddle, as the arm reports it.
    - ``puck.*``: estimated position, m, and velocity, m/s, of the puck.
    - ``sent.*``: last command after all limits, fraction of the top speed.
    - ``frame.age``: time since the exposure of the newest frame, s; ``frame.delay``:
      time from its exposure until it was received, s.
    - ``command.age``: time since the arm began to execute the newest action, s.
    - ``period``: time since the last observation, s; 0 for the first one.

    `connect` sets up puck and paddle. On a real table, a person confirms this at the
    terminal before the arm moves. If the robot or the camera stops, `get_observation`
    raises an error and the paddle brakes. There is no automatic recovery.

    Args:
        config: Configuration of table and camera.
    """

    config_class = AirHockeyPaddleConfig
    name = "airhockey_paddle"
    connected: AirHockeyPaddle | None = None
    """Paddle of this process that is connected, for `driver.AirHockeyDriver`."""

    def __init__(self, config: AirHockeyPaddleConfig) -> None:
        super().__init__(config)
        self.config = config
        self._open = ExitStack()
        self._env: Any = None
        self._moment, self._rests = 0.0, 0.0

    @cached_property
    def _image(self) -> tuple[int, ...]:
        """Shape (H, W, 3) of the image."""
        from marl_airhockey.hardware.rig import Rig

        with opened_rig(self.config.rig) as path:
            across, down = Rig.load(path).view.lens.size
        return round(self.config.width * down / across), self.config.width, 3

    @property
    def observation_features(self) -> dict[str, Any]:
        """Types of the numbers, and the shape of the image."""
        image = {CAMERA: self._image} if self.config.width else {}
        return {**dict.fromkeys(FEATURES, float), **image}

    @property
    def cameras(self) -> dict[str, Any]:
        """Cameras by name, whose number LeRobot reads."""
        return {CAMERA: None} if self.config.width else {}

    @property
    def is_connected(self) -> bool:
        """True while table and robot are open."""
        return self._env is not None

    def connect(self, calibrate: bool = True) -> None:
        """Open table and robot, and have puck and paddle set up.

        Raises:
            RuntimeError: A device does not respond, or there is no confirmation.
            ValueError: The rig or the task is unknown.
        """
        if self.is_connected:
            raise RobotError("airhockey_paddle: it is already connected")
        try:
            rig = self._open.enter_context(opened_rig(self.config.rig))
            self._env = ah.gym_env(
                self.config.task,
                backend="real",
                rig=str(rig),
                control_dt=1.0 / self.config.fps,
            )
            self._open.callback(self._env.close)
            self._env.reset(seed=0)
        except BaseException:
            self.disconnect()
            raise
        self.scene = self._env.world.scene
        """Scene on the table."""
        self.state: State = self._env.world.state.map(np.copy)
        """State of the table at the last observation."""
        self.top_speed = float(self._env.physics["paddle_speed"])
        """Speed of an action of norm 1, m/s."""
        self._start = self.state.puck[0, 0].copy() if self.scene.pucks else None
        self._moment = self._rests = 0.0
        AirHockeyPaddle.connected = self

    @property
    def _table(self) -> RealBackend:
        """Backend of the table.

        Raises:
            RobotError: The robot is not connected.
        """
        if self._env is None:
            raise RobotError("airhockey_paddle: call connect() first")
        return self._env.world.backend

    def get_observation(self) -> dict[str, Any]:
        """Return the present observation.

        Raises:
            RobotError: The robot or the camera has stopped. The paddle brakes.
        """
        table, state = self._table, self.state
        if time.monotonic() - self._moment > STALE:
            # LeRobot was writing a dataset, so that no frame may have been received.
            newest = table.camera.newest
            table.camera.next(-1 if newest is None else newest.number, FRESH)
        table.look(state)
        if table.interruption:
            raise RobotError(
                f"{table.interruption}; inspect the table and connect again"
            )
        report = table.telemetry()
        since, self._moment = self._moment, report["moment"]
        numbers = [*state.paddle[0, 0], *state.paddle_velocity[0, 0]]
        puck = np.full(4, np.nan)
        if self.scene.pucks:
            puck[:] = *state.puck[0, 0], *state.puck_velocity[0, 0]
            self._serve_again(puck)
        numbers += [*np.nan_to_num(puck), *(np.array(report["sent"]) / self.top_speed)]
        applied = report["applied"] or self._moment
        numbers += [
            self._moment - report["captured"],
            report["received"] - report["captured"],
            self._moment - applied,
            self._moment - since if since else 0.0,
        ]
        seen: dict[str, Any] = dict(
            zip(FEATURES, (float(number) for number in numbers), strict=True)
        )
        if self.config.width:
            seen[CAMERA] = table.photograph(0, "camera", (), self.config.width)
        return seen

    def _serve_again(self, puck: np.ndarray) -> None:
        """Have the lab serve a puck that rests; at a real table a person does it."""
        reach = np.min(self.scene.seats[0].reach, 0)[0]
        if np.hypot(*puck[2:]) > RESTS or puck[0] > reach:
            self._rests = self._moment
        elif (
            self._moment - self._rests > WAITING
            and self._table.rig.operator != "person"
        ):
            self._table.serve(self._start, np.zeros(2))
            self._rests = self._moment

    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        """Command a velocity; return the one that was sent to the arm.

        Raises:
            ValueError: The action has other names.
        """
        if set(action) != set(self.action_features):
            raise ValueError(f"action {sorted(action)}: expected x and y")
        table = self._table
        asked = np.array([float(action["x"]), float(action["y"])])
        if np.isfinite(asked).all():
            asked = np.clip(asked, -1.0, 1.0)
        sent = table.send(asked * self.top_speed) / self.top_speed
        return {"x": float(sent[0]), "y": float(sent[1])}

    def disconnect(self) -> None:
        """Brake and close table and robot."""
        self._env = None
        AirHockeyPaddle.connected = None
        self._open.close()

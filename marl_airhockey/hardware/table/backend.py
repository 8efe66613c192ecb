"""Backend of a real table: state from camera and robot, steps in real time."""

from __future__ import annotations

import logging
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from marl_airhockey.hardware.camera import Camera
from marl_airhockey.hardware.rig import Rig
from marl_airhockey.hardware.robot import Robot, RobotError
from marl_airhockey.hardware.table.block_tracker import BlockTracker
from marl_airhockey.hardware.table.devices import TableDevices
from marl_airhockey.hardware.table.overlay import cropped, scaled
from marl_airhockey.hardware.table.placing import Placing
from marl_airhockey.hardware.table.report import device_report
from marl_airhockey.hardware.table.tracker import Tracker
from marl_airhockey.hardware.table.troubles import trouble_of
from marl_airhockey.hardware.vision.rectifier import Rectifier
from marl_airhockey.sim.contracts.backend import Command, LiveBackend
from marl_airhockey.sim.contracts.camera_model import CameraModel
from marl_airhockey.sim.contracts.mark import Mark
from marl_airhockey.sim.core.physics import Physics
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.core.table import TABLES
from marl_airhockey.sim.jit.pipeline import Stage
from marl_airhockey.types import Array

log = logging.getLogger("marl_airhockey.real")
PROFILE = "ur5e"
"""Profile of the table's robot."""
LATE = 0.02
"""Time from the end of a step to the next command beyond which it is logged, s."""


class RealBackend(LiveBackend):
    """Backend of one real table: a camera observes the puck, an arm moves the paddle.

    A step sends a command, waits for the end of the step and returns the state. The arm
    reports the paddle's state. A filter with the table's physics estimates the puck
    from all frames so far. If the robot stops, or no frame or puck arrives for too
    long, the paddle brakes and `interruption` gives the reason.

    Args:
        scene: Scene on the table.
        control_dt: Time of a step, s.
        devices: Devices of the table, which the backend closes.
        tracker: Tracker of the puck.
    """

    instant_contacts: ClassVar[bool] = False
    tracks_commands: ClassVar[bool] = False
    timestep: ClassVar[float | None] = None
    viewpoints: ClassVar[tuple[str, ...]] = ("table", "rectified", "camera")

    def __init__(
        self,
        scene: Scene,
        control_dt: float,
        devices: TableDevices,
        tracker: Tracker,
    ) -> None:
        super().__init__(scene, 1, control_dt)
        self._devices, self._tracker = devices, tracker
        self._block = BlockTracker()
        self.placing = Placing(devices, scene)
        self._reason = ""
        self._due = 0.0
        self._moment = self._served = 0.0
        self._frame: tuple[float | None, float | None] = None, None
        self._overruns = 0
        self._commanded = np.zeros(2)

    def __getstate__(self) -> dict[str, Any]:
        raise TypeError("a real table cannot be copied or sent to another process")

    @classmethod
    def supports(cls, scene: Scene) -> str | None:
        if len(scene.seats) != 1:
            return (
                "the real table has one arm, and people must stay out of its "
                "workspace; play games for more seats in simulation"
            )
        if scene.blocks > 1 or scene.obstacles:
            return "the real table has one block and no obstacles; use a simulation"
        if scene.blocks and scene.block_shape != "disc":
            return "the block of the real table is a disc; use shape=disc"
        if scene.pucks > 1:
            return f"there is one puck on the real table, not {scene.pucks}"
        if scene.physics.get("tilt") == 0.0:
            return "the real table is tilted, but this task needs a flat one"
        if scene.table not in TABLES.values():
            return "the table is not one of the presets"
        return None

    @classmethod
    def table_and_profile(cls, rig: str) -> tuple[str, str]:
        return Rig.load(Path(rig)).table, PROFILE

    @classmethod
    def open(
        cls, scene: Scene, control_dt: float, rig: str, physics: Physics
    ) -> RealBackend:
        if not rig:
            raise ValueError(
                'backend "real": no rig was given; pass its file, rig= or --rig '
                "(airhockey calibrate writes it), or use the virtual lab, --lab"
            )
        known, tracker = Rig.load(Path(rig)), Tracker(scene, physics)
        return cls(scene, control_dt, TableDevices(scene, known), tracker)

    def set_physics(self, values: dict[str, Array], worlds: Array) -> None:
        """Do nothing: the physics of a real table cannot be set."""

    @property
    def rig(self) -> Rig:
        """Description of the devices."""
        return self._devices.rig

    @property
    def robot(self) -> Robot:
        """Robot that moves the paddle."""
        return self._devices.robot

    @property
    def camera(self) -> Camera:
        """Camera over the table."""
        return self._devices.camera

    @property
    def rectifier(self) -> Rectifier:
        """Rectifier of the camera's frames to the table from above."""
        return self._devices.rectifier

    @property
    def interruption(self) -> str:
        return self._reason

    def arrange(self, state: State) -> State:
        self._reason, begun = "", self.scene.still_state(1)
        self._tracker.forget()
        try:
            seen = self.placing.place(state)
        except RobotError as error:
            raise RuntimeError(str(error)) from error
        self.robot.enable()
        began = self._due = time.monotonic()
        if seen:
            self._tracker.begin(seen)
        if self.placing.seen_block is not None:
            self._block.begin(self.placing.seen_block)
        self._fill(begun, began, began)
        begun.time[:] = 0.0
        return begun

    def stage(self, command: Command, before: State, after: State) -> Stage:
        return Stage(self._move, (command, before, after))

    def _move(self, command: Command, before: State, after: State) -> None:
        """Send the command, wait for the end of the step and fill ``after``."""
        self._report_lateness(time.monotonic())
        self.send(command.velocity[0, 0])
        self._due += self.control_dt
        left = self._due - time.monotonic()
        if left > 0:
            time.sleep(left)
        else:
            self._overruns += 1
            if left < -2 * self.control_dt:
                # Missed time is not made up for by shorter steps.
                self._due = time.monotonic()
        self.look(after)
        after.time[:] = before.time + self.control_dt

    def send(self, velocity: Array) -> Array:
        """Command a velocity (2,), table frame, m/s; return the one that was sent."""
        self._commanded = velocity.copy()
        return self.robot.send_action(self._commanded, self.control_dt)

    def look(self, state: State) -> None:
        """Fill a state with the present one and the contacts of the last control step.

        If an episode cannot continue, the paddle brakes, and `interruption` gives the
        reason.

        Args:
            state: State of one world.
        """
        now = time.monotonic()
        for name in ("touched", "banked", "crossed", "crossed_velocity", "lifted"):
            getattr(state, name)[:] = 0
        state.touched_at[:] = np.nan
        self._fill(state, now, now - self.control_dt)
        self._reason = self._reason or trouble_of(self._devices, self._tracker, now)
        if self._reason:
            self.robot.disable()

    def serve(self, puck: Array, velocity: Array) -> None:
        """Have the operator release the puck elsewhere, while the paddle continues.

        Args:
            puck: Position (2,), table frame, m.
            velocity: Velocity (2,), table frame, m/s.
        """
        self.placing.operator.place(puck, velocity, None)
        self.placing.operator.release()
        self._tracker.forget()
        self._served = time.monotonic()

    def _report_lateness(self, began: float) -> None:
        """Log a warning if the command of a step is late.

        Args:
            began: Time at which the step began, s.
        """
        took = began - self._moment
        if took > LATE:
            log.warning(
                "real table: a command is late: policy, observation and recording "
                "took %.0f ms since the last step",
                1e3 * took,
            )

    def _fill(self, state: State, now: float, since: float) -> None:
        """Fill a state with present positions and velocities, and with new contacts.

        Args:
            state: State of the one world.
            now: Time of the state, s.
            since: Time at which the step began, s.
        """
        self._moment = now
        watcher = self._devices.watcher
        self._frame = watcher.looked_at, watcher.arrived_at
        status = self.robot.get_observation()
        state.position[0, 0] = status.x, status.y
        state.velocity[0, 0] = status.vx, status.vy
        if self.scene.pucks:
            seen = [s for s in watcher.take() if s.taken > self._served]
            if seen and self._tracker.last is None:
                self._tracker.begin(seen)
            self._tracker.fill(state, seen, self.robot.track, now, since)
        if self._devices.block_watcher is not None:
            self._block.fill(state, self._devices.block_watcher.take())

    def sight(self) -> Array:
        return self._tracker.sight(self._devices.watcher.looked_at)

    @property
    def camera_model(self) -> CameraModel:
        return self.rig.camera_model

    def frame(self, size: int) -> Array:
        window = self.camera_model.window(self.scene.table)
        return cropped(self._image, window, size)[..., ::-1]

    @property
    def _image(self) -> Array:
        """Newest image of the camera (H, W, 3) uint8, blue, green, red."""
        frame = self.camera.newest
        if frame is None:
            raise RuntimeError(self.camera.trouble or "camera: no frame yet")
        return frame.image

    def telemetry(self) -> dict[str, Any]:
        return {
            "moment": self._moment,
            **dict(zip(("captured", "received"), self._frame, strict=True)),
            "asked": [round(float(x), 4) for x in self._commanded],
            "overruns": self._overruns,
            **device_report(self._devices, self._tracker),
        }

    def photograph(
        self, world: int, viewpoint: str, marks: Sequence[Mark], width: int
    ) -> Array:
        if viewpoint == "rectified":
            return self.rectifier.rectify(self._image, width)[..., ::-1]
        if viewpoint == "camera":
            return scaled(self._image, width)[..., ::-1]
        status = self.robot.get_observation()
        paddle = np.array([status.x, status.y])
        bodies = paddle, self._tracker.estimate, self._block.position
        return self._devices.overlay.draw(self._image, *bodies, marks, width)

    def close(self) -> None:
        self._devices.close()

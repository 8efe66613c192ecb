"""Real backend: the state comes from camera and robot, steps run in real time."""

from __future__ import annotations

import logging
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from marl_airhockey.hardware.camera import Camera, open_source
from marl_airhockey.hardware.rig import Rig
from marl_airhockey.hardware.robot import DriverState, Fault, Robot, RobotError
from marl_airhockey.hardware.robot.supervisor import LATCHED
from marl_airhockey.hardware.table.operator import make_operator
from marl_airhockey.hardware.table.overlay import Overlay
from marl_airhockey.hardware.table.tracker import Tracker
from marl_airhockey.hardware.vision import Detector, Sighting
from marl_airhockey.hardware.vision.calibration import view_trouble
from marl_airhockey.hardware.vision.rectifier import Rectifier
from marl_airhockey.hardware.vision.watcher import Watcher
from marl_airhockey.sim.contracts.backend import Backend, Command
from marl_airhockey.sim.contracts.mark import Mark
from marl_airhockey.sim.core.physics import Physics
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.core.table import TABLES
from marl_airhockey.sim.jit.pipeline import Stage
from marl_airhockey.types import Array

log = logging.getLogger("marl_airhockey.real")
PROFILE = "ur5e"
"""Profile of the table's robot"""
FIRST_FRAME = 10.0
"""Longest time from opening a camera to its first frame, s"""
BLIND = 0.3
"""Time without a camera frame after which an episode ends, s"""
DELAYED = 0.15
"""Time from an exposure until its frame arrives after which an episode ends, s"""
LATE = 0.02
"""Time from the end of a step to the next command above which it is logged, s"""
LOST = 2.0
"""Time for which a puck may be unseen, s"""
FIRST = 3
"""Number of sightings from which the first estimate is made"""
PLACING = 30.0
"""Longest time until a placed puck is seen, s"""
APART = 0.08
"""Largest accepted distance of a placed puck from its target position, m"""


class RealBackend(Backend):
    """Backend of one real table: a camera sees the puck, an arm moves the paddle.

    A step sends a command, waits for the end of the step and returns the state. The arm
    reports the paddle. A filter with the table's physics estimates the puck from all
    frames so far. If the robot stops, or no frame or puck arrives for too long, the
    paddle brakes and `interruption` gives the reason.
    """

    instant_contacts: ClassVar[bool] = False
    tracks_commands: ClassVar[bool] = False
    senses_itself: ClassVar[bool] = True
    timestep: ClassVar[float | None] = None
    viewpoints: ClassVar[tuple[str, ...]] = ("table", "rectified")

    def __init__(
        self,
        scene: Scene,
        num_worlds: int,
        control_dt: float,
        substeps: int | None = None,
    ) -> None:
        if num_worlds != 1:
            raise ValueError(
                f"num_worlds: {num_worlds}; expected 1, as there is one real table"
            )
        super().__init__(scene, num_worlds, control_dt, substeps)
        self._devices = ExitStack()
        self._robot: Robot | None = None
        self._reason = ""
        self._due = 0.0
        self._began = self._moment = 0.0
        self._overruns = 0
        self._commanded = np.zeros(2)
        self._allowed = False

    def __getstate__(self) -> dict[str, Any]:
        raise TypeError("a real table cannot be copied or sent to another process")

    @classmethod
    def supports(cls, scene: Scene) -> str | None:
        if len(scene.seats) != 1:
            return (
                "the real table has one arm, and people must stay out of its "
                "workspace; play games for more seats in simulation"
            )
        if scene.blocks or scene.obstacles:
            return "there are no blocks on the real table; use a simulation"
        if scene.pucks > 1:
            return f"there is one puck on the real table, not {scene.pucks}"
        if scene.path:
            return "the task needs the puck's path between two camera frames"
        if scene.physics.get("tilt") == 0.0:
            return "the real table is tilted, but this task needs a flat one"
        if scene.table not in TABLES.values():
            return "the table is not one of the presets"
        return None

    @classmethod
    def table_and_profile(cls, rig: str) -> tuple[str, str] | None:
        return Rig.load(Path(rig)).table, PROFILE

    def connect(self, rig: str) -> None:
        if not rig:
            raise ValueError(
                'backend "real": no rig was given; pass its file, rig= or --rig '
                "(airhockey calibrate writes it), or use the virtual lab, --lab"
            )
        self.rig = Rig.load(Path(rig))
        table = TABLES[self.rig.table]
        if self.scene.table != table:
            raise ValueError(
                f"the scenario's table is not the rig's {self.rig.table!r}; pass "
                f'options={{"table": "{self.rig.table}"}} or --option '
                f"table={self.rig.table}"
            )
        self.operator = make_operator(self.rig.operator)
        config = self.rig.robot_config(self.scene.seats[0].reach)
        try:
            self._camera = self._devices.enter_context(
                Camera(open_source(self.rig.camera, self.rig.latency))
            )
            self._check_camera()
            half = tuple(float(x) for x in table.size / 2)
            detector = Detector(
                *(self.rig.view, self.rig.puck, table.puck_radius, half),  # type: ignore[arg-type]
                readout=self.rig.readout,
            )
            if self.scene.pucks:
                self._check_pucks(detector)
            self._overlay = Overlay(self.rig.view, table)
            self.rectifier = Rectifier(self.rig.view, table.size)
            self.watcher = Watcher(self._camera, detector)
            self._devices.callback(self.watcher.close)
            self._robot = self._devices.enter_context(Robot(config))
        except BaseException:
            self._devices.close()
            raise

    def _check_camera(self) -> None:
        frame = self._camera.next(seconds=FIRST_FRAME)
        if frame is None:
            raise RuntimeError(
                f"{self._camera.trouble}; check that {self.rig.camera} is the camera"
            )
        trouble = view_trouble(self.rig.view, [frame.image], self.rig.known_tags)
        if trouble:
            raise RuntimeError(f"camera {self.rig.camera}: {trouble}")

    def _check_pucks(self, detector: Detector) -> None:
        """Refuse a table on which several objects have the puck's colour."""
        frame = self._camera.newest
        assert frame is not None
        found = [np.round(seen.place, 2).tolist() for seen in detector.find_all(frame)]
        if len(found) > 1:
            raise RuntimeError(
                f"camera: {len(found)} things have the puck's colour and size, at "
                f"{found} m; leave one puck on the table, or calibrate another colour"
            )

    def expect(self, physics: Physics) -> None:
        self._tracker = Tracker(self.scene, physics)

    def set_physics(self, values: dict[str, Array], worlds: Array) -> None:
        """Do nothing: the physics of a real table cannot be set."""

    @property
    def robot(self) -> Robot:
        """Robot that moves the paddle."""
        if self._robot is None:
            raise RuntimeError('backend "real": connect() comes first')
        return self._robot

    @property
    def camera(self) -> Camera:
        """Camera over the table."""
        return self._camera

    @property
    def interruption(self) -> str:
        return self._reason

    def arrange(self, state: State) -> State:
        self._reason = ""
        self._tracker.forget()
        if not self._allowed:
            self.operator.begin(self.rig.motion_words(self.scene.seats[0].reach))
            self._allowed = True
        try:
            self._ready_robot()
            self.robot.go_to(state.paddle[0, 0])
        except RobotError as error:
            raise RuntimeError(str(error)) from error
        seen: list[Sighting] = []
        if self.scene.pucks:
            target, velocity = state.puck[0, 0], state.puck_velocity[0, 0]
            self.operator.place(target, velocity)
            self._await_puck(target)
            self.operator.release()
            seen = self._first_sightings()
        self.robot.enable()
        self._began = self._due = time.monotonic()
        begun = self.scene.still_state(1)
        if seen:
            self._tracker.begin(seen)
        self._fill(begun, self._began, self._began)
        begun.time[:] = 0.0
        return begun

    def _ready_robot(self) -> None:
        """Recover a robot that has stopped, after the operator has allowed it.

        Raises:
            RobotError: The robot does not recover.
        """
        robot = self.robot
        while robot.state is DriverState.FAULT or not robot.is_connected:
            self.operator.allow(robot.fault.label)
            if robot.fault is Fault.EMERGENCY_STOP:
                # A person must release it at the pendant, or `connect` fails.
                robot.disconnect()
                robot.connect()
            else:
                robot.recover()

    def _await_puck(self, target: Array) -> None:
        """Wait until the placed puck is seen near its target position (2,), m.

        Raises:
            RuntimeError: The puck is not seen there in time.
        """
        until, far = time.monotonic() + PLACING, float("inf")
        began = time.monotonic()
        while time.monotonic() < until:
            self.robot.send_action(np.zeros(2), 0.0)
            last = self.watcher.last
            if last is not None and last.taken > began:
                far = float(np.linalg.norm(last.place - target))
                if far < APART:
                    return
            time.sleep(0.02)
        trouble = self._camera.trouble or self.watcher.trouble
        where = "not seen" if not np.isfinite(far) else f"seen {far:.2f} m from there"
        raise RuntimeError(
            f"the puck is {where} within {PLACING:.0f} s (target "
            f"{np.round(target, 2)} m); "
            f"{trouble or 'put it at its target'}"
        )

    def _first_sightings(self) -> list[Sighting]:
        """Return the first sightings of a puck that was just released.

        Raises:
            RuntimeError: The puck is not seen often enough.
        """
        self.watcher.take()
        seen: list[Sighting] = []
        until = time.monotonic() + LOST
        while len(seen) < FIRST and time.monotonic() < until:
            self.robot.send_action(np.zeros(2), 0.0)
            time.sleep(0.005)
            seen += self.watcher.take()
        if len(seen) < FIRST:
            raise RuntimeError("the puck was not seen after its release")
        return seen

    def stage(self, command: Command, before: State, after: State) -> Stage:
        return Stage(self._move, (command, before, after))

    def _move(self, command: Command, before: State, after: State) -> None:
        """Send the command, wait for the end of the step and fill ``after``."""
        self._commanded = command.velocity[0, 0].copy()
        self._report_lateness(time.monotonic())
        self.robot.send_action(self._commanded, self.control_dt)
        self._due += self.control_dt
        left = self._due - time.monotonic()
        if left > 0:
            time.sleep(left)
        else:
            self._overruns += 1
            if left < -2 * self.control_dt:
                # Missed time is not made up for by shorter steps.
                self._due = time.monotonic()
        now = time.monotonic()
        for name in ("touched", "banked", "crossed", "crossed_velocity", "lifted"):
            getattr(after, name)[:] = 0
        after.touched_at[:] = np.nan
        self._fill(after, now, now - self.control_dt)
        after.time[:] = before.time + self.control_dt
        self._reason = self._reason or self._trouble(now)
        if self._reason:
            self.robot.disable()

    def _report_lateness(self, began: float) -> None:
        """Log a step whose command comes late, and what took the time.

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

    def _trouble(self, now: float) -> str:
        """Return why the episode cannot continue; "" if it can."""
        robot = self.robot
        # A HOLD because commands were late ends with the next command.
        held = robot.state is DriverState.HOLD and robot.fault in LATCHED
        if held or robot.state is DriverState.FAULT:
            return f"robot: {robot.fault.label}"
        if not robot.is_connected:
            return "robot: its driver has ended"
        return self._blindness(now) if self.scene.pucks else ""

    def _blindness(self, now: float) -> str:
        """Return why the puck's state is not known; "" if it is."""
        camera, last = self._camera, self._tracker.last
        if camera.age > BLIND:
            return camera.trouble
        if camera.transit > DELAYED:
            return f"camera: frames arrive {camera.transit:.2f} s after their exposure"
        if self.watcher.trouble:
            return self.watcher.trouble
        if last is not None and now - last.time > LOST:
            return f"puck: not seen for {LOST:.0f} s"
        return self._tracker.innovations.trouble

    def _fill(self, state: State, now: float, since: float) -> None:
        """Fill a state with positions and velocities now and new contacts.

        Args:
            state: State of the one world.
            now: Time of the state, s.
            since: Time at which the step began, s.
        """
        self._moment = now
        status = self.robot.get_observation()
        state.position[0, 0] = status.x, status.y
        state.velocity[0, 0] = status.vx, status.vy
        if self.scene.pucks:
            seen = self.watcher.take()
            self._tracker.fill(state, seen, self.robot.track, now, since)

    def sight(self) -> Array:
        return self._tracker.sight(self.watcher.looked_at)

    def telemetry(self) -> dict[str, Any]:
        status, camera, last = (
            self.robot.get_observation(),
            self._camera,
            self._tracker.last,
        )
        return {
            "moment": self._moment,
            "robot": self.robot.state.name,
            "fault": self.robot.fault.label,
            "asked": [round(float(x), 4) for x in self._commanded],
            "sent": [round(status.sent_vx, 4), round(status.sent_vy, 4)],
            "sent_place": [round(status.sent_x, 4), round(status.sent_y, 4)],
            "height_mm": round(1e3 * status.z, 2),
            "force": round(status.force, 1),
            "joints": [round(angle, 5) for angle in status.joints],
            "cycles": int(status.cycles),
            "late": int(status.late),
            "refused": int(status.refused),
            "overruns": self._overruns,
            "camera": camera.trouble,
            "frame_ms": round(1e3 * min(camera.age, 99.0), 1),
            "dropped": camera.dropped,
            "puck_ms": round(1e3 * (time.monotonic() - last.time), 1) if last else None,
            "noise_mm": round(1e3 * self._tracker.noise, 2),
        }

    def photograph(
        self, world: int, viewpoint: str, marks: Sequence[Mark], width: int
    ) -> Array:
        frame = self._camera.newest
        if frame is None:
            raise RuntimeError(self._camera.trouble or "camera: no frame yet")
        if viewpoint == "rectified":
            return self.rectifier.rectify(frame.image, width)[..., ::-1]
        status = self.robot.get_observation()
        paddle = np.array([status.x, status.y])
        puck = self._tracker.estimate
        return self._overlay.draw(frame.image, paddle, puck, marks, width)

    def close(self) -> None:
        if self._robot is not None and self._robot.is_connected:
            self._robot.disable()
        self._devices.close()
        self._robot = None

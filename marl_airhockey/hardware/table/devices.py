"""Devices of a real table: its camera, the detector of the puck, and its robot."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace

import numpy as np

from marl_airhockey.hardware.camera import Camera, open_source
from marl_airhockey.hardware.rig import Rig
from marl_airhockey.hardware.robot import Robot
from marl_airhockey.hardware.table.overlay import Overlay
from marl_airhockey.hardware.vision import Detector
from marl_airhockey.hardware.vision.calibration import view_trouble
from marl_airhockey.hardware.vision.rectifier import Rectifier
from marl_airhockey.hardware.vision.watcher import Watcher
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.table import TABLES

FIRST_FRAME = 10.0
"""Longest time from opening a camera to its first frame, s."""


class TableDevices:
    """Devices of a table, which are open until `close`.

    Args:
        scene: Scene that is played on the table.
        rig: Description of the devices.

    Raises:
        ValueError: The scene has another table.
        RuntimeError: A device does not respond, or the camera does not show the table
            with one puck. The message contains a remedy.
    """

    def __init__(self, scene: Scene, rig: Rig) -> None:
        table = TABLES[rig.table]
        if scene.table != table:
            raise ValueError(
                f"the scenario's table is not the rig's {rig.table!r}; pass "
                f'options={{"table": "{rig.table}"}} or --option table={rig.table}'
            )
        if scene.blocks and rig.block is None:
            raise ValueError(
                "the rig has no block: click one in airhockey calibrate, or start a "
                "lab that has one, airhockey lab --block"
            )
        self.rig = rig
        self.pucks = scene.pucks
        """Number of pucks on the table."""
        config = rig.robot_config(scene.seats[0].reach)
        half = tuple(float(x) for x in table.size / 2)
        detector = Detector(
            *(rig.view, rig.puck, table.puck_radius, half),  # type: ignore[arg-type]
            readout=rig.readout,
            marked=rig.puck_marked,
        )
        self.overlay = Overlay(rig.view, table)
        self.rectifier = Rectifier(rig.view, table.size)
        with ExitStack() as stack:
            self.camera = stack.enter_context(
                Camera(open_source(rig.camera, rig.latency))
            )
            self._check_camera()
            if scene.pucks:
                self._check_alone("puck", detector)
                self._check_mark(detector)
            self.watcher = Watcher(self.camera, detector)
            stack.callback(self.watcher.close)
            self.block_watcher: Watcher | None = None
            if scene.blocks and rig.block is not None:
                size = scene.block_radius
                block = replace(detector, colour=rig.block, radius=size, marked=False)
                self._check_alone("block", block)
                self.block_watcher = Watcher(self.camera, block)
                stack.callback(self.block_watcher.close)
            self.robot = stack.enter_context(Robot(config))
            self._open = stack.pop_all()

    def _check_camera(self) -> None:
        frame = self.camera.next(seconds=FIRST_FRAME)
        if frame is None:
            raise RuntimeError(
                f"{self.camera.trouble}; check that {self.rig.camera} is the camera"
            )
        trouble = view_trouble(self.rig.view, [frame.image], self.rig.known_tags)
        if trouble:
            raise RuntimeError(f"camera {self.rig.camera}: {trouble}")

    def _check_alone(self, body: str, detector: Detector) -> None:
        """Check that not several objects on the table have the colour of a body."""
        frame = self.camera.newest
        assert frame is not None
        found = [np.round(seen.place, 2).tolist() for seen in detector.find_all(frame)]
        if len(found) > 1:
            raise RuntimeError(
                f"camera: {len(found)} objects have the {body}'s colour and size, at "
                f"{found} m; leave one {body} on the table, or calibrate another colour"
            )

    def _check_mark(self, detector: Detector) -> None:
        """Check that a puck shows the mark that its rig states."""
        frame = self.camera.newest
        assert frame is not None
        seen = detector.find(frame)
        if detector.marked and seen is not None and np.isnan(seen.angle):
            raise RuntimeError(
                f"camera: the puck at {np.round(seen.place, 2).tolist()} m shows no "
                "mark, but puck_marked is true in the rig; use the marked puck, renew "
                "its bar, or set puck_marked to false"
            )

    def close(self) -> None:
        """Stop the robot and close all devices."""
        if self.robot.is_connected:
            self.robot.disable()
        self._open.close()

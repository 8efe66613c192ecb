"""Process of the lab's table: physics and camera, in real time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from marl_airhockey.hardware.block import Block
from marl_airhockey.hardware.camera.camera import CameraFrame
from marl_airhockey.hardware.lab.frame_server import FrameServer
from marl_airhockey.hardware.lab.setup import LabSetup
from marl_airhockey.hardware.lab.table_camera import Seen, TableCamera, lab_view
from marl_airhockey.hardware.lab.world import RATE, LabWorld
from marl_airhockey.sim.contracts.camera_model import BEHIND

LATE = 0.25
"""Largest lag of the loop, s; after a larger one, missed steps are skipped."""
MOVED = 0.02
"""Displacement of a camera under the fault moved_camera, m."""
DELAY = 0.2
"""Additional latency under the fault delayed_frames, s."""
SECOND_PUCK = np.array([0.55, -0.25])
"""Position (2,) of the second puck under the fault second_puck, table frame, m."""


class TableLoop:
    """Loop of the table: steps of the world, and a frame when it is due.

    Args:
        setup: Setup of the lab.
        seed: Seed of the table's physics parameters and of the image noise.
        frame_rate: Frame rate of the camera, 1/s.
        block: Memory in which the arm reports its paddle, see `PublishedTable`.
        server: Server of the frames.
    """

    def __init__(
        self,
        setup: LabSetup,
        seed: int,
        frame_rate: float,
        block: Block,
        server: FrameServer,
    ) -> None:
        self._setup, self._block, self._server = setup, block, server
        self.world = LabWorld(setup, seed)
        edge = -float(setup.geometry.offsets[0])
        base = np.array([edge - BEHIND, 0.0])
        self._view = lab_view(setup.geometry)
        self._camera = TableCamera(
            setup.geometry, self._view, base, seed=seed, marked=setup.marked
        )
        self._every = max(round(RATE / frame_rate), 1)
        self._steps, self._frames, self._frozen = 0, 0, False
        self._repeats = self._stuck = False
        self._image = np.zeros((0, 0, 3), np.uint8)
        self._moving: threading.Thread | None = None
        self._now = time.monotonic()
        self._paddle_state = block.read()[1:].tolist()
        self.faults: dict[str, Callable[[bool], None]] = {
            "frozen_camera": self._freeze,
            "dark_camera": self._darken,
            "moved_camera": self._move_camera,
            "delayed_frames": self._delay,
            "second_puck": self._add_puck,
            "repeated_frames": self._repeat,
            "stuck_frame": self._stick,
            "lost_puck": self._remove_puck,
        }
        self._on: set[str] = set()
        """Names of the faults that are switched on."""

    def _freeze(self, on: bool) -> None:
        self._frozen = on

    def _repeat(self, on: bool) -> None:
        self._repeats = on

    def _stick(self, on: bool) -> None:
        self._stuck = on

    def _darken(self, on: bool) -> None:
        self._camera.dark = on

    def _delay(self, on: bool) -> None:
        self._server.latency = self._setup.latency + (DELAY if on else 0.0)

    def _add_puck(self, on: bool) -> None:
        self._camera.left = SECOND_PUCK if on else None

    def _move_camera(self, on: bool) -> None:
        x, y, z = self._view.translation
        moved = replace(self._view, translation=(x + MOVED, y, z)) if on else self._view
        # In a thread, as drawing the new scene takes longer than a frame.
        if self._moving is not None:
            self._moving.join()
        self._moving = threading.Thread(target=self._camera.move, args=(moved,))
        self._moving.start()

    def _remove_puck(self, on: bool) -> None:
        self.world.present = not on

    def step(self, now: float) -> None:
        """Advance the world by one step.

        Args:
            now: Time of the new state, monotonic clock, s.
        """
        stamp, x, y, z, vx, vy = self._block.read()
        velocity = np.array([vx, vy])
        ahead = min(max(now - stamp, 0.0), 0.02)
        paddle = np.array([x, y]) + ahead * velocity
        self.world.step(paddle, velocity, z)
        self._now, self._paddle_state = now, [*paddle.tolist(), z, vx, vy]
        self._steps += 1
        if self._steps % self._every == 0 and not self._frozen:
            self._server.send(self._photograph(now, paddle, velocity))

    def _photograph(self, now: float, paddle: Any, velocity: Any) -> CameraFrame:
        world = self.world
        moving = np.zeros(2) if world.held else world.puck_velocity
        puck = world.puck if world.present else None
        rotation = world.puck_angle, 0.0 if world.held else world.puck_spin
        seen = Seen(puck, moving, paddle, velocity, *rotation, world.block)
        self._frames += 1
        again = self._stuck or (self._repeats and self._frames % 2)
        if not (again and self._image.size):
            self._image = self._camera.photograph(seen, self._frames)
        return CameraFrame(self._image, now, self._frames)

    def obey(self, order: dict[str, Any]) -> dict[str, Any]:
        """Execute a request of the lab's operator; return the true state."""
        world = self.world
        what = order["do"]
        if what == "place":
            position, velocity = np.array(order["puck"]), np.array(order["velocity"])
            block = np.array(order["block"]) if "block" in order else None
            world.put(position, velocity, held=True, block=block)
            self._on.discard("lost_puck")
        elif what == "release":
            world.release()
        elif what == "board":
            self._camera.show_board(order["number"])
        elif what == "fault":
            name, on = order["name"], bool(order["on"])
            self.faults[name](on)
            self._on = self._on | {name} if on else self._on - {name}
        since = self._now - world.time
        return {
            "time": self._now,
            "touches": [since + t for t in world.touches],
            "banks": [(since + t, s) for t, s in world.banks],
            "paddle": self._paddle_state,
            "puck": world.puck.tolist(),
            "velocity": world.puck_velocity.tolist(),
            "block": None if world.block is None else world.block[0].tolist(),
            "faults": sorted(self._on),
            "laws": {name: float(value[0]) for name, value in world.laws.items()},
        }


def run_table(
    setup: LabSetup, seed: int, frame_rate: float, memory: Any, pipe: Connection
) -> None:
    """Run the table until the other end of the pipe is closed."""
    server = FrameServer(setup.latency)
    block = Block(np.frombuffer(memory))
    loop = TableLoop(setup, seed, frame_rate, block, server)
    loop.step(time.monotonic())
    pipe.send({"port": server.port})
    due = time.monotonic()
    while True:
        try:
            while pipe.poll():
                pipe.send(loop.obey(pipe.recv()))
        except (EOFError, OSError):
            return
        loop.step(due)
        due += 1.0 / RATE
        left = due - time.monotonic()
        if left > 0:
            time.sleep(left)
        elif left < -LATE:
            due = time.monotonic()

"""Sensor: the sensed states of B worlds and their history."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from marl_airhockey.sim.contracts.backend import LiveBackend
from marl_airhockey.sim.contracts.camera_model import CameraModel
from marl_airhockey.sim.contracts.image_form import (
    image_form,
    shows_camera,
    shows_images,
)
from marl_airhockey.sim.contracts.observable import HISTORY, PENDING
from marl_airhockey.sim.core.physics import Physics
from marl_airhockey.sim.core.rng import StreamSet
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.sensing.photos import Photos, SimulatedPhotos, TablePhotos
from marl_airhockey.sim.sensing.simulated_camera import SENSED, SimulatedCamera
from marl_airhockey.types import ALL, Array, Rows


class Needs(NamedTuple):
    """Requirements of observation types beyond the sensed state."""

    history: bool
    """True to store the last sensed positions and requested actions."""
    estimate: bool
    """True to estimate the pucks for now by a filter."""
    frames: int = 0
    """Number of sensed positions of all bodies to store, for drawn images."""

    @staticmethod
    def of(forms: Iterable[str]) -> Needs:
        """Return the requirements of observation types, see `observable.OBSERVE`.

        Args:
            forms: Names of the observation types.
        """
        forms = set(forms)
        drawn = [f for f in forms if shows_images(f) and not shows_camera(f)]
        frames = [image_form(f).frames for f in drawn]
        history = bool(forms - {"velocity"})
        return Needs(history, "estimate" in forms, max(frames, default=0))


class Sensor:
    """Sensor of B worlds, which converts states to sensed states and stores a history.

    Args:
        scene: Scene on the tables.
        num_worlds: Number of worlds, B.
        physics: Ranges of the parameters of sensing.
        control_dt: Length of a control step, s.
        needs: Requirements of the observation types.
        live: Backend of a real table; None for simulated sensing.
        cameras: Cameras of the observation types that show one.
    """

    def __init__(
        self,
        scene: Scene,
        num_worlds: int,
        physics: Physics,
        control_dt: float,
        needs: Needs,
        live: LiveBackend | None = None,
        cameras: Mapping[str, CameraModel] | None = None,
    ) -> None:
        self.control_dt, self._live, self._keeps = control_dt, live, needs.history
        self.camera: SimulatedCamera | None = None
        """Simulated camera; None if the states themselves are observed."""
        if live is None and physics.any_of(*SENSED):
            simulated = scene, num_worlds, physics, control_dt, needs.estimate
            self.camera = SimulatedCamera(*simulated)
        pucks, b = scene.bodies.pucks, num_worlds
        self.history = np.zeros((b, HISTORY, pucks, 4))
        """Sensed x and y, m, visibility, and age, s, of the pucks
        (B, HISTORY, pucks, 4), newest last."""
        self.age = np.zeros((b, pucks))
        """Age of the simulated camera's newest frame of each puck (B, pucks), s."""
        self.frames = np.zeros((b, needs.frames, len(scene.bodies), 3))
        """Sensed positions, m, and angles of all bodies (B, F, N, 3), newest last."""
        self.photos: dict[str, Photos] = {}
        """Frames of each camera that an observation type shows."""
        for form, camera in (cameras or {}).items():
            size, count = image_form(form).size, image_form(form).frames
            self.photos[form] = (
                SimulatedPhotos(camera, scene, b, count, control_dt)
                if live is None
                else TablePhotos(live.frame, size, count)
            )
        self.requested = np.zeros((b, PENDING, scene.bodies.paddles, 2))
        """Last requested actions (B, PENDING, seats, 2), ego frames, newest last."""

    @property
    def ideal(self) -> bool:
        """True if sensed states are equal to the states."""
        return self.camera is None

    def past(self) -> dict[str, Array]:
        """Return ``history`` and ``requested``, by name."""
        return {"history": self.history, "requested": self.requested}

    def estimated(self, sensed: State) -> State:
        """Return a sensed state with the estimates of the pucks for now."""
        return sensed if self.camera is None else self.camera.estimated(sensed)

    def best(self, sensed: State) -> State:
        """Return a sensed state with estimates, if they are computed."""
        estimates = self.camera is not None and self.camera.estimates
        return self.estimated(sensed) if estimates else sensed

    def note(self, actions: Array) -> None:
        """Append the actions (B, seats, 2) that are requested in a step."""
        if self._keeps:
            past = self.requested
            past[:, :-1], past[:, -1] = past[:, 1:], actions

    def begin(
        self,
        worlds: Array,
        state: State,
        values: Mapping[str, Array],
        streams: StreamSet,
    ) -> State:
        """Begin an episode in some worlds and return the sensed state, see `reset`."""
        self.requested[worlds] = 0.0
        if self.camera is not None:
            self.camera.begin(worlds, values, streams)
        return self.reset(worlds, state, values, streams)

    def reset(
        self,
        worlds: Array,
        state: State,
        values: Mapping[str, Array],
        streams: StreamSet,
    ) -> State:
        """Replace the past in some worlds and return the sensed state.

        The new past is that of bodies that moved at constant velocity.

        Args:
            worlds: Indices (W,) of the worlds.
            state: State of all B worlds.
            values: Physical parameters (B,) by name.
            streams: Random streams of the worlds, including "sensor".
        """
        if self.camera is not None:
            self.camera.reset(worlds, state, values)
        sensed = self._sense(state, values, streams, worlds)
        for photos in self.photos.values():
            photos.restart(state, streams, worlds)
        if self._keeps:
            self.history[worlds] = self.history[worlds][:, -1:]
            self.frames[worlds] = self.frames[worlds][:, -1:]
        return sensed

    def sense(
        self,
        state: State,
        values: Mapping[str, Array],
        streams: StreamSet,
        rows: Rows = ALL,
    ) -> State:
        """Return the sensed state. Time has passed only in the worlds ``rows``."""
        for photos in self.photos.values():
            photos.take(state, streams, rows)
        return self._sense(state, values, streams, rows)

    def _sense(
        self,
        state: State,
        values: Mapping[str, Array],
        streams: StreamSet,
        rows: Rows,
    ) -> State:
        sensed = state
        if self.camera is not None:
            sensed, self.age = self.camera.look(state, values, streams, rows)
        if self._keeps:
            self._append(self.history, self._newest(sensed), rows)
        if self.frames.shape[1]:
            bodies = sensed.position, sensed.angle[..., None]
            self._append(self.frames, np.concatenate(bodies, -1), rows)
        return sensed

    def _newest(self, sensed: State) -> Array:
        """Return the newest row (B, pucks, 4) of the history."""
        if self._live is not None:
            return self._live.sight()
        newest = np.empty((*self.age.shape, 4))
        newest[..., :2], newest[..., 2] = sensed.puck, sensed.visible
        newest[..., 3] = self.age
        return newest

    @staticmethod
    def _append(past: Array, newest: Array, rows: Rows) -> None:
        """Append a row (B, ...) to a past (B, n, ...) in some worlds, in place."""
        past[rows, :-1], past[rows, -1] = past[rows, 1:], newest[rows]

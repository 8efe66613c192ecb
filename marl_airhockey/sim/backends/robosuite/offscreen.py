"""Camera: pictures of the arms and the table, rendered by MuJoCo without a screen."""

from __future__ import annotations

import atexit
import weakref
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from marl_airhockey.sim.backends.robosuite.frames import TableFrame
from marl_airhockey.sim.contracts.mark import Mark, Meaning
from marl_airhockey.types import Array

COLOURS: dict[Meaning, tuple[float, float, float, float]] = {
    "goal": (0.0, 0.62, 0.45, 0.55),
    "reward": (0.9, 0.75, 0.1, 0.5),
    "cost": (0.84, 0.37, 0.0, 0.5),
    "drag": (0.41, 0.45, 0.53, 0.5),
}
"""Colours of marks by what they mean (RGBA)"""
THIN = 0.004
"""Half the width of a line, and half the height of a circle (m)."""


class OffscreenRenderer:
    """Camera on one model, for pictures of one size.

    Args:
        model: MuJoCo's model.
        frame: frame of the table.
        width: of the pictures, pixels.
        height: of the pictures, pixels.

    Raises:
        RuntimeError: OpenGL is missing; the message names the packages to install.
    """

    def __init__(self, model: Any, frame: TableFrame, width: int, height: int) -> None:
        self._frame, self._model = frame, model
        self._data = mujoco.MjData(model)
        # Size of the model's offscreen buffer, which bounds the pictures.
        model.vis.global_.offwidth = max(model.vis.global_.offwidth, width)
        model.vis.global_.offheight = max(model.vis.global_.offheight, height)
        try:
            self._renderer = mujoco.Renderer(model, height, width)
        except Exception as error:
            raise RuntimeError(
                "no picture without OpenGL: apt-get install libegl1 libegl-mesa0, "
                "set MUJOCO_GL=egl before mujoco is imported, or libosmesa6 and "
                f"set osmesa ({error})"
            ) from error
        # Close before MuJoCo ends OpenGL at the exit, if the environment is still open.
        atexit.register(_close, weakref.ref(self))
        self._option = mujoco.MjvOption()
        self._option.geomgroup[:] = 0
        self._option.geomgroup[1] = 1
        self._option.sitegroup[:] = 0

    def picture(self, qpos: Array, name: str, marks: Sequence[Mark] = ()) -> Array:
        """Return the picture (H, W, 3) uint8 of a camera at ``qpos``, with marks."""
        self._data.qpos[:] = qpos
        mujoco.mj_fwdPosition(self._model, self._data)
        self._renderer.update_scene(self._data, name, self._option)
        for mark in marks:
            self._draw(mark)
        return np.asarray(self._renderer.render())

    def _draw(self, mark: Mark) -> None:
        scene = self._renderer.scene
        if scene.ngeom == scene.maxgeom:
            return
        geom = scene.geoms[scene.ngeom]
        start = self._frame.to_world(*mark.start, THIN)
        colour = np.array(COLOURS[mark.means])
        if mark.kind == "circle":
            kind, size = mujoco.mjtGeom.mjGEOM_CYLINDER, [mark.radius, THIN, THIN]
            orientation = self._frame.rotation.ravel()
            mujoco.mjv_initGeom(geom, kind, size, start, orientation, colour)
        else:
            kind = (
                mujoco.mjtGeom.mjGEOM_ARROW
                if mark.kind == "arrow"
                else mujoco.mjtGeom.mjGEOM_CAPSULE
            )
            mujoco.mjv_initGeom(
                geom, kind, np.zeros(3), start, np.eye(3).ravel(), colour
            )
            end = self._frame.to_world(*mark.end, THIN)
            mujoco.mjv_connector(geom, kind, 2 * THIN, start, end)
        scene.ngeom += 1

    def close(self) -> None:
        """Release the OpenGL context."""
        self._renderer.close()


def _close(camera: weakref.ref[OffscreenRenderer]) -> None:
    found = camera()
    if found is not None:
        found.close()

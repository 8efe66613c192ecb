"""Pictures of the arms and the table, drawn by MuJoCo without a screen."""

from __future__ import annotations

import atexit
import weakref
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from marl_airhockey.backends.robosuite.frames import TableFrame
from marl_airhockey.contracts.mark import Mark
from marl_airhockey.types import Array

GREEN = np.array([0.0, 0.62, 0.45, 0.55])
"""Of marks."""
THIN = 0.004
"""m, half the width of a line; half the height of a circle"""


class Camera:
    """Draws one model; kept for pictures of one size.

    Raises:
        RuntimeError: there is no OpenGL; says what to install.
    """

    def __init__(self, model: Any, place: TableFrame, width: int, height: int) -> None:
        self._place, self._model = place, model
        self._data = mujoco.MjData(model)
        # The largest picture that the model's own buffer holds.
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
        # Before MuJoCo ends OpenGL at the exit, even if nobody closes the environment.
        atexit.register(_close, weakref.ref(self))
        self._option = mujoco.MjvOption()
        self._option.geomgroup[:] = 0
        self._option.geomgroup[1] = 1
        self._option.sitegroup[:] = 0

    def picture(self, places: Array, name: str, marks: Sequence[Mark] = ()) -> Array:
        """(H, W, 3) uint8 of what a camera sees at qpos, and a scenario's marks."""
        self._data.qpos[:] = places
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
        start = self._place.to_world(*mark.start, THIN)
        if mark.kind == "circle":
            kind, size = mujoco.mjtGeom.mjGEOM_CYLINDER, [mark.radius, THIN, THIN]
            orientation = self._place.rotation.ravel()
            mujoco.mjv_initGeom(geom, kind, size, start, orientation, GREEN)
        else:
            kind = (
                mujoco.mjtGeom.mjGEOM_ARROW
                if mark.kind == "arrow"
                else mujoco.mjtGeom.mjGEOM_CAPSULE
            )
            mujoco.mjv_initGeom(
                geom, kind, np.zeros(3), start, np.eye(3).ravel(), GREEN
            )
            end = self._place.to_world(*mark.end, THIN)
            mujoco.mjv_connector(geom, kind, 2 * THIN, start, end)
        scene.ngeom += 1

    def close(self) -> None:
        """Let go of the OpenGL context."""
        self._renderer.close()


def _close(camera: weakref.ref[Camera]) -> None:
    found = camera()
    if found is not None:
        found.close()

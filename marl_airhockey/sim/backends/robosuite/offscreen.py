"""Camera: images of the arms and the table, which MuJoCo renders without a display."""

from __future__ import annotations

import atexit
import weakref
from collections.abc import Sequence
from typing import Any, get_args

import mujoco
import numpy as np

from marl_airhockey.sim.backends.robosuite.frames import TableFrame
from marl_airhockey.sim.contracts.mark import Mark, Meaning
from marl_airhockey.sim.contracts.palette import LIGHT, rgb
from marl_airhockey.types import Array

COLOURS: dict[Meaning, Array] = {
    meaning: np.array([*rgb(LIGHT[meaning]), 140]) / 255
    for meaning in get_args(Meaning)
}
"""Colours of marks by meaning, RGBA (4,), 0 to 1."""
SHADOWS = 4096
"""Resolution of shadows, pixels."""
THIN = 0.004
"""Half the width of a line, and half the height of a circle, m."""
LOOK_AT, DISTANCE = (0.0, 0.0, 0.9), 2.6
"""Centre (3,) of the view of `whole_table`, and its distance from the camera, m."""
ELEVATION, FIELD = -43.0, 36.0
"""Direction of the camera of `whole_table`, and its vertical field of view, degrees."""


def whole_table(model: Any) -> Any:
    """Return a camera, `mujoco.MjvCamera`, from which arms at both ends are visible.

    Args:
        model: MuJoCo model, whose field of view changes for all free cameras.
    """
    model.vis.global_.fovy = FIELD
    camera = mujoco.MjvCamera()
    camera.lookat[:], camera.distance = LOOK_AT, DISTANCE
    camera.azimuth, camera.elevation = 90.0, ELEVATION
    return camera


class OffscreenRenderer:
    """Camera of one model, for images of one size.

    Args:
        model: MuJoCo model.
        frame: Frame of the table.
        width: Width of the images, pixels.
        height: Height of the images, pixels.
        shadows: Resolution of shadows, pixels.

    Raises:
        RuntimeError: OpenGL is missing. The message names the packages to install.
    """

    def __init__(
        self,
        model: Any,
        frame: TableFrame,
        width: int,
        height: int,
        shadows: int = SHADOWS,
    ) -> None:
        self._frame, self._model = frame, model
        self._data = mujoco.MjData(model)
        # The offscreen buffer of the model limits the size of the images.
        model.vis.global_.offwidth = max(model.vis.global_.offwidth, width)
        model.vis.global_.offheight = max(model.vis.global_.offheight, height)
        model.vis.quality.shadowsize = shadows
        try:
            self._renderer = mujoco.Renderer(model, height, width)
        except Exception as error:
            raise RuntimeError(
                "images need OpenGL: run apt-get install libegl1 libegl-mesa0 and set "
                "MUJOCO_GL=egl before mujoco is imported, or install libosmesa6 and "
                f"set MUJOCO_GL=osmesa ({error})"
            ) from error
        # If the environment is still open at the exit, close before MuJoCo ends OpenGL.
        atexit.register(_close, weakref.ref(self))
        self._option = mujoco.MjvOption()
        self._option.geomgroup[:] = 0
        self._option.geomgroup[1] = 1
        self._option.sitegroup[:] = 0

    def picture(
        self, qpos: Array, camera: str | Any, marks: Sequence[Mark] = ()
    ) -> Array:
        """Return an image (H, W, 3) uint8.

        Args:
            qpos: Positions of all joints, see `mujoco.MjData.qpos`.
            camera: Name of a camera of the model, or a `mujoco.MjvCamera`.
            marks: Marks on the table.
        """
        self._data.qpos[:] = qpos
        mujoco.mj_fwdPosition(self._model, self._data)
        self._renderer.update_scene(self._data, camera, self._option)
        for mark in marks:
            self._draw(mark)
        return np.asarray(self._renderer.render())

    def _draw(self, mark: Mark) -> None:
        scene = self._renderer.scene
        if scene.ngeom == scene.maxgeom:
            return
        geom = scene.geoms[scene.ngeom]
        x, y, end_x, end_y, radius = mark.numbers
        start = self._frame.to_world(x, y, THIN)
        colour = COLOURS[mark.means]
        if mark.kind == "circle":
            kind, size = mujoco.mjtGeom.mjGEOM_CYLINDER, [radius, THIN, THIN]
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
            end = self._frame.to_world(end_x, end_y, THIN)
            mujoco.mjv_connector(geom, kind, 2 * THIN, start, end)
        scene.ngeom += 1

    def close(self) -> None:
        """Release the OpenGL context."""
        self._renderer.close()


def _close(camera: weakref.ref[OffscreenRenderer]) -> None:
    found = camera()
    if found is not None:
        found.close()

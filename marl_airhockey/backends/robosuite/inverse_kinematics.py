"""Joint angles that put a paddle somewhere on the table (inverse kinematics)."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from marl_airhockey.types import Array

ELBOW_UP = (-0.2349, -0.9849, 2.0144, -2.7482, -1.5543, -3.3757)
"""rad; where the search begins, so that it ends with the elbow above the table."""
CLOSE = 1e-7
"""m and rad, together"""
TRIES = 200


def reach_for(
    model: Any,
    data: Any,
    site: int,
    places: Any,
    dofs: Any,
    target: Array,
    rotation: Array,
    begin: Array | tuple[float, ...] = ELBOW_UP,
) -> Array:
    """Joint angles (n,), rad, by damped least squares; ``data`` is left changed.

    Args:
        model: MuJoCo's model.
        data: its data.
        site: of the paddle's foot.
        places: of the arm's joints in qpos.
        dofs: of the arm's joints in qvel.
        target: (3,) m, in the world.
        rotation: (3, 3) wanted, in the world.
        begin: where the search begins.

    Raises:
        ValueError: the arm does not get there.
    """
    angles = np.array(begin, dtype=float)
    jacobian = np.zeros((6, model.nv))
    for _ in range(TRIES):
        data.qpos[places] = angles
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], site)
        r = rotation @ data.site_xmat[site].reshape(3, 3).T
        off = 0.5 * np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
        error = np.concatenate([target - data.site_xpos[site], off])
        if np.linalg.norm(error) < CLOSE:
            return angles
        arm = jacobian[:, dofs]
        step = arm.T @ np.linalg.solve(arm @ arm.T + 1e-6 * np.eye(6), error)
        angles += np.clip(step, -0.2, 0.2)
    raise ValueError(f"the arm does not reach {np.round(target, 3)} m")

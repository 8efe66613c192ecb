"""Inverse kinematics: joint angles for a pose of the paddle."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from marl_airhockey.types import Array

ELBOW_UP = (-0.2349, -0.9849, 2.0144, -2.7482, -1.5543, -3.3757)
"""Initial angles of the search, rad. From them, the search ends with the elbow up."""
TOLERANCE = 1e-7
"""Largest norm of the error, which combines m and rad."""
MAX_ITERATIONS = 200


def find_joint_angles(
    model: Any,
    data: Any,
    site: int,
    qpos_index: Any,
    dofs: Any,
    target: Array,
    rotation: Array,
    initial: Array | tuple[float, ...] = ELBOW_UP,
) -> Array:
    """Find joint angles (n,), rad, by damped least squares; ``data`` is changed.

    Args:
        model: MuJoCo model.
        data: MuJoCo data.
        site: Site of the paddle's foot.
        qpos_index: Indices of the arm's joints in qpos (n,).
        dofs: Indices of the arm's joints in qvel (n,).
        target: Target position (3,), world frame, m.
        rotation: Target rotation from the foot to the world frame (3, 3).
        initial: Initial angles of the search (n,), rad.

    Raises:
        ValueError: The arm cannot reach the pose.
    """
    angles = np.array(initial, dtype=float)
    jacobian = np.zeros((6, model.nv))
    for _ in range(MAX_ITERATIONS):
        data.qpos[qpos_index] = angles
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], site)
        r = rotation @ data.site_xmat[site].reshape(3, 3).T
        off = 0.5 * np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
        error = np.concatenate([target - data.site_xpos[site], off])
        if np.linalg.norm(error) < TOLERANCE:
            return angles
        arm = jacobian[:, dofs]
        step = arm.T @ np.linalg.solve(arm @ arm.T + 1e-6 * np.eye(6), error)
        angles += np.clip(step, -0.2, 0.2)
    raise ValueError(f"the arm cannot reach {np.round(target, 3)} m")

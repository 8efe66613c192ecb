"""Arrays of the compiled stepper: views of a simulation, static values, and output."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from marl_airhockey.sim.backends._planar.walls import sides
from marl_airhockey.sim.backends.robosuite.controller import SeatController
from marl_airhockey.sim.backends.robosuite.frames import TableFrame
from marl_airhockey.sim.backends.robosuite.sliding import Sliding
from marl_airhockey.sim.backends.robosuite.table_physics import TablePhysics
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.types import Array

TRACE = ("height", "tilt", "force", "joint_speed", "share", "speed")
"""Columns of the trace of a paddle at every physics step: height above the table (m),
error of the orientation (rad), force on the table (N), speed of the fastest joint
(rad/s), share of the motion that the torque limits allow (1), speed (m/s)."""


class SimulationViews(NamedTuple):
    """Views, not copies, of one world's MuJoCo arrays, and indices of its parts."""

    model: int
    """Address of the model."""
    data: int
    """Address of the data."""
    inertia: int
    """Address of qM."""
    qpos: Array
    qvel: Array
    applied: Array
    """Applied generalised forces, qfrc_applied (nv,)."""
    ctrl: Array
    bias: Array
    """Gravity, Coriolis and centrifugal torques, qfrc_bias (nv,)."""
    site_positions: Array
    """Positions of the sites (sites, 3), world frame, m."""
    site_rotations: Array
    """Rotations of the sites to the world frame (sites, 9)."""
    sensors: Array
    arms: Array
    """Indices of each arm (seats, 6): first joint in qpos, in qvel and in ctrl; site of
    the foot; body of this site; force sensor."""
    movers: Array
    """Indices of x of pucks and blocks in qpos and in qvel (movers, 2)."""
    sliding: Sliding
    """Arrays of the pucks and blocks."""
    gravity: Array
    """Gravity (3,), world frame, m/s2."""
    gains: Array
    """Gains of the controllers (seats, 8), see `osc.Gains`."""
    payloads: Array
    """Masses at the feet that the controllers do not know (seats,), kg."""


class StaticScene(NamedTuple):
    """Static values that all worlds share."""

    origin: Array
    """Origin of the table frame (3,), world frame, m."""
    rotation: Array
    """Rotation from the table frame to the world frame (3, 3)."""
    foot_rotations: Array
    """Target rotations from the feet to the world frame (seats, 3, 3)."""
    low: Array
    """Smallest torques of the joints (seats, 6), Nm."""
    high: Array
    """Largest torques of the joints (seats, 6), Nm."""
    radius: Array
    """Radii of paddle and puck (2,), m."""
    pucks: int
    normals: Array
    """Inward normals of the sides of the goal lines (goal_lines, 2)."""
    offsets: Array
    """Offsets of the sides of the goal lines (goal_lines,), m."""
    openings: Array
    """Ends of the goal lines (goal_lines, 2, 2), table frame, m."""
    sides: Array
    """Sides of the table (sides, 6), see `walls.sides`."""
    whole_side: Array
    """True if a goal line is a whole side, which a touch crosses (goal_lines,)."""


class StepOutput(NamedTuple):
    """Output of a step of one world, filled in place; `State` defines its events."""

    paddles: Array
    """Columns x, y, vx, vy of the paddles (seats, 4), table frame, m and m/s."""
    touched: Array
    touched_at: Array
    touching: Array
    """True if in contact (seats, pucks); persists between steps."""
    banked: Array
    """Number of bounces (pucks, sides)."""
    against: Array
    """True if a puck touches the rail of a side (pucks, sides); persists."""
    crossed: Array
    crossed_velocity: Array
    lifted: Array
    """Always False, because arms do not lift pucks (pucks,)."""
    beyond: Array
    """True if a puck is at or beyond a goal line (pucks, goal_lines); persists."""
    path: Array
    """Columns x, y, vx, vy (substeps + 1 or 0, movers with paddles, 4)."""
    trace: Array
    """Trace (substeps, seats, len(TRACE)), see `TRACE`."""


def make_static_scene(
    scene: Scene, frame: TableFrame, hands: Sequence[SeatController]
) -> StaticScene:
    """Return the static values of a scene and its bound controllers."""
    table, lines = scene.table, scene.goal_lines
    return StaticScene(
        origin=frame.origin,
        rotation=frame.rotation,
        foot_rotations=np.array([hand.foot_rotation for hand in hands]),
        low=np.array([hand.low for hand in hands]),
        high=np.array([hand.high for hand in hands]),
        radius=np.array([table.paddle_radius, table.puck_radius]),
        pucks=scene.pucks,
        normals=np.array([table.normals[m.side] for m in lines]).reshape(-1, 2),
        offsets=np.array([table.offsets[m.side] for m in lines]),
        openings=np.array([scene.opening(m) for m in lines]).reshape(-1, 2, 2),
        sides=sides(scene),
        whole_side=np.array([m.width is None for m in lines], np.bool_),
    )


def make_views(
    model: Any,
    data: Any,
    arms: Array,
    table_physics: TablePhysics,
    hands: Sequence[SeatController],
) -> SimulationViews:
    """Return the views of a model and its data.

    Args:
        model: MuJoCo model.
        data: MuJoCo data.
        arms: Indices of each arm (seats, 6), see `SimulationViews`.
        table_physics: Physics of the pucks and blocks of the model.
        hands: Controllers of the seats, for their gains.
    """
    return SimulationViews(
        model=model._address,
        data=data._address,
        inertia=data.qM.ctypes.data,
        qpos=data.qpos,
        qvel=data.qvel,
        applied=data.qfrc_applied,
        ctrl=data.ctrl,
        bias=data.qfrc_bias,
        site_positions=data.site_xpos,
        site_rotations=data.site_xmat,
        sensors=data.sensordata,
        arms=arms,
        movers=np.stack([table_physics.qpos_index, table_physics.dofs], 1),
        sliding=table_physics.sliding,
        gravity=model.opt.gravity,
        gains=np.array([hand.gains for hand in hands]),
        payloads=np.zeros(len(hands)),
    )


def make_output(scene: Scene, path: tuple[int, ...], trace: Array) -> StepOutput:
    """Return an output with the given trace and a path of shape ``path``."""
    pairs = len(scene.seats), scene.pucks
    crossings = scene.pucks, len(scene.goal_lines)
    banks = scene.pucks, len(scene.table.vertices)
    return StepOutput(
        paddles=np.zeros((len(scene.seats), 4)),
        touched=np.zeros(pairs, np.int64),
        touched_at=np.zeros(pairs),
        touching=np.zeros(pairs, np.bool_),
        banked=np.zeros(banks, np.int64),
        against=np.zeros(banks, np.bool_),
        crossed=np.zeros(crossings, np.bool_),
        crossed_velocity=np.zeros((*crossings, 2)),
        lifted=np.zeros(scene.pucks, np.bool_),
        beyond=np.zeros(crossings, np.bool_),
        path=np.zeros(path),
        trace=trace,
    )

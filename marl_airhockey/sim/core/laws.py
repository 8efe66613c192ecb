"""Laws of pucks and blocks: flight, sliding, restitution and the impulse of a contact.

They are compiled functions of numbers, the same for every backend and for roll-outs.
Where they come from: two real tables, see the documentation of the physics.
"""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.core.parameters import PUCK_SPEED_CAP, SLOWEST_BOUNCE
from marl_airhockey.sim.jit.cache import compiled, inner
from marl_airhockey.types import Array

Motion = tuple[float, float, float, float]
"""Distance along x and y, m, and velocity after it, m/s."""


@compiled(nogil=True, error_model="numpy", forceinline=True)
def fly(
    vx: float, vy: float, h: float, gx: float, gy: float, damping: float, drag: float
) -> Motion:
    """Return the motion of a puck in h s at v' = g - (damping + drag |v|) v.

    It is a flow: half of the slope's acceleration, the exact solution under drag, the
    other half. Under drag alone v falls to v / (1 + z) after ln(1 + z) / drag, where z
    is the drag times the distance without it. With a slope the error is of third order
    in h: 0.15 mm in 2 s of steps of 50 ms.

    Args:
        vx: m/s.
        vy: m/s.
        h: s.
        gx: acceleration by the slope, m/s2.
        gy: the same along y.
        damping: linear drag, 1/s.
        drag: quadratic drag, 1/m.
    """
    time = -np.expm1(-damping * h) / damping if damping > 0.0 else h
    return fly_slowed(vx, vy, h, time, gx, gy, damping, drag)


@inner(error_model="numpy", forceinline=True)
def fly_slowed(
    vx: float,
    vy: float,
    h: float,
    time: float,
    gx: float,
    gy: float,
    damping: float,
    drag: float,
) -> Motion:
    """Return what `fly` does, given (1 - exp(-damping h)) / damping as ``time``, s."""
    ux, uy = vx + 0.5 * gx * h, vy + 0.5 * gy * h
    left, way = 1.0, h
    if drag > 0.0 or damping > 0.0:
        z = drag * time * np.sqrt(ux * ux + uy * uy)
        if z < 0.02:
            # ln(1 + z) / z by its series, which is as exact and faster.
            way = 1 - z * (0.5 - z * (1 / 3 - z * (0.25 - z * (0.2 - z / 6))))
        else:
            way = np.log1p(z) / z
        way *= time
        left = (1.0 - damping * time) / (1.0 + z)
    return ux * way, uy * way, ux * left + 0.5 * gx * h, uy * left + 0.5 * gy * h


@compiled(nogil=True, error_model="numpy", forceinline=True)
def slide(vx: float, vy: float, h: float, gx: float, gy: float, grip: float) -> Motion:
    """Return the motion of a block in h s, which Coulomb friction stops and holds.

    Args:
        vx: m/s.
        vy: m/s.
        h: s.
        gx: acceleration by the slope, m/s2.
        gy: the same along y.
        grip: deceleration by friction, m/s2.
    """
    speed = np.sqrt(vx * vx + vy * vy)
    if speed == 0.0 and gx * gx + gy * gy <= grip * grip:
        return 0.0, 0.0, 0.0, 0.0
    loss, wx, wy = grip * h, vx + gx * h, vy + gy * h
    most = np.sqrt(wx * wx + wy * wy)
    left = (most - loss) / most if most > loss else 0.0
    time = 0.5 * h if most > loss else 0.5 * h * most / max(loss, 1e-12)
    return (vx + wx * left) * time, (vy + wy * left) * time, wx * left, wy * left


@compiled(nogil=True, error_model="numpy", forceinline=True)
def cap(vx: float, vy: float) -> float:
    """Return the share of a puck's velocity that the cap on its speed leaves."""
    square = vx * vx + vy * vy
    if square <= PUCK_SPEED_CAP * PUCK_SPEED_CAP:
        return 1.0
    return float(PUCK_SPEED_CAP / np.sqrt(square))


@compiled(nogil=True, error_model="numpy", forceinline=True)
def wall_restitution(speed: float, at_one: float, slope: float) -> float:
    """Return the restitution at a wall, at a normal speed in m/s.

    Args:
        speed: m/s.
        at_one: restitution at 1 m/s.
        slope: its loss per ln(m/s).
    """
    share = at_one - slope * np.log(max(speed, SLOWEST_BOUNCE))
    return float(min(max(share, 0.0), 1.0))


@inner(error_model="numpy", forceinline=True)
def impulse(
    speed: float,
    slip: float,
    restitution: float,
    friction: float,
    normal_mass: float,
    tangential_mass: float,
) -> tuple[float, float]:
    """Return the impulse of a contact along its normal and along its tangent, N s.

    The normal one returns a share of the closing speed. The tangential one ends the
    slip (sticking) or is friction times the normal one (sliding, Coulomb).

    Args:
        speed: closing speed, m/s, above 0.
        slip: tangential speed of the second body's edge from the first's, m/s.
        restitution: share of the closing speed that is returned.
        friction: coefficient.
        normal_mass: sum of the inverse masses, 1/kg.
        tangential_mass: the same with the inverse masses of the edges of discs that can
            spin, r2 / I, which is 2 / m, 1/kg.
    """
    normal = (1.0 + restitution) * speed / normal_mass
    most = friction * normal
    return normal, min(max(-slip / tangential_mass, -most), most)


@compiled(nogil=True, error_model="numpy", forceinline=True)
def bounce(
    puck: Array,
    nx: float,
    ny: float,
    closing: float,
    along: float,
    restitution: float,
    friction: float,
) -> None:
    """Let a puck bounce off something heavy, in place.

    Args:
        puck: (5,) x, y, m, vx, vy and speed of the edge by spin, m/s.
        nx: of the unit normal toward the puck.
        ny: of the same.
        closing: speed at which they come together along it, m/s, above 0.
        along: speed of the other along the normal turned by +90 degrees, m/s.
        restitution: share of the closing speed that is returned.
        friction: coefficient.
    """
    slip = nx * puck[3] - ny * puck[2] - along - puck[4]
    push, aside = impulse(closing, slip, restitution, friction, 1.0, 3.0)
    puck[2] += push * nx - aside * ny
    puck[3] += push * ny + aside * nx
    puck[4] -= 2.0 * aside

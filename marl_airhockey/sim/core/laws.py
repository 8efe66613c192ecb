"""Physics model of pucks and blocks: flight, sliding, restitution, contact impulse.

The functions are compiled and take plain numbers. All backends and predictions share
them. They were derived from measurements on two real tables, see docs/physics.md.
"""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.core.parameters import PUCK_SPEED_CAP, SLOWEST_BOUNCE
from marl_airhockey.sim.jit.cache import compiled, inner
from marl_airhockey.sim.jit.elementary import expm1, log, log1p
from marl_airhockey.types import Array

Motion = tuple[float, float, float, float]
"""Displacement along x and y, m, and final velocity along x and y, m/s."""


@compiled(nogil=True, error_model="numpy", forceinline=True)
def fly(
    vx: float, vy: float, h: float, gx: float, gy: float, damping: float, drag: float
) -> Motion:
    """Return the displacement and final velocity of a puck after h seconds.

    The equation is v' = g - (damping + drag |v|) v. The solution applies half of the
    slope's acceleration, then the exact solution under drag, then the other half. Under
    drag alone, v falls to v / (1 + z) over the distance ln(1 + z) / drag. Here z is the
    drag times the distance without drag. With a slope the error is of third order in h:
    0.15 mm in 2 s of steps of 50 ms.

    Args:
        vx: Velocity along x, m/s.
        vy: Velocity along y, m/s.
        h: Time of the flight, s.
        gx: Acceleration by the slope along x, m/s2.
        gy: Acceleration by the slope along y, m/s2.
        damping: Linear drag, 1/s.
        drag: Quadratic drag, 1/m.
    """
    time = -expm1(-damping * h) / damping if damping > 0.0 else h
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
    """Return the result of `fly` for ``time`` = (1 - exp(-damping h)) / damping, s."""
    ux, uy = vx + 0.5 * gx * h, vy + 0.5 * gy * h
    left, way = 1.0, h
    if drag > 0.0 or damping > 0.0:
        z = drag * time * np.sqrt(ux * ux + uy * uy)
        if z < 0.02:
            # The series of ln(1 + z) / z is as exact and faster.
            way = 1 - z * (0.5 - z * (1 / 3 - z * (0.25 - z * (0.2 - z / 6))))
        else:
            way = log1p(z) / z
        way *= time
        left = (1.0 - damping * time) / (1.0 + z)
    return ux * way, uy * way, ux * left + 0.5 * gx * h, uy * left + 0.5 * gy * h


@compiled(nogil=True, error_model="numpy", forceinline=True)
def slide(vx: float, vy: float, h: float, gx: float, gy: float, grip: float) -> Motion:
    """Return the displacement and final velocity of a block after h seconds.

    Coulomb friction stops the block and holds it.

    Args:
        vx: Velocity along x, m/s.
        vy: Velocity along y, m/s.
        h: Time of the movement, s.
        gx: Acceleration by the slope along x, m/s2.
        gy: Acceleration by the slope along y, m/s2.
        grip: Deceleration by friction, m/s2.
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
    """Return the factor that limits the speed of a puck to `PUCK_SPEED_CAP`."""
    square = vx * vx + vy * vy
    if square <= PUCK_SPEED_CAP * PUCK_SPEED_CAP:
        return 1.0
    return float(PUCK_SPEED_CAP / np.sqrt(square))


@compiled(nogil=True, error_model="numpy", forceinline=True)
def wall_restitution(speed: float, at_one: float, slope: float) -> float:
    """Return the restitution at a wall.

    Args:
        speed: Normal speed, m/s.
        at_one: Restitution at 1 m/s.
        slope: Loss of restitution per ln(m/s).
    """
    share = at_one - slope * log(max(speed, SLOWEST_BOUNCE))
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
    """Return the normal and tangential impulse of a contact, N s.

    The normal impulse returns a share of the closing speed. The tangential impulse ends
    the slip (sticking), or is friction times the normal impulse (sliding, Coulomb).

    Args:
        speed: Closing speed, m/s, above 0.
        slip: Tangential speed of the second body's edge relative to the first's, m/s.
        restitution: Share of the closing speed that is returned.
        friction: Coefficient of friction.
        normal_mass: Sum of the inverse masses, 1/kg.
        tangential_mass: Sum of the inverse masses, plus r2 / I, which is 2 / m, of each
            disc that can spin, 1/kg.
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
    """Apply a bounce off a heavy body to a puck, in place.

    Args:
        puck: Puck (5,): x, y, m; vx, vy and speed of the edge by spin, m/s.
        nx: Component x of the unit normal toward the puck.
        ny: Component y of the unit normal toward the puck.
        closing: Closing speed along the normal, m/s, above 0.
        along: Speed of the other body along the normal turned by +90 degrees, m/s.
        restitution: Share of the closing speed that is returned.
        friction: Coefficient of friction.
    """
    slip = nx * puck[3] - ny * puck[2] - along - puck[4]
    push, aside = impulse(closing, slip, restitution, friction, 1.0, 3.0)
    puck[2] += push * nx - aside * ny
    puck[3] += push * ny + aside * nx
    puck[4] -= 2.0 * aside

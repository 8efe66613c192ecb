"""Worlds with the puck where a test wants it."""

import numpy as np


def place_puck(world, x, y, vx=0.0, vy=0.0, paddle=None, **memory):
    """Put puck 0 of every world somewhere, with something else in the memory.

    If the place of a paddle is given, that of seat 0 stands there and nothing turns.
    """
    rows, kept = world.get_state()
    rows.puck[:, 0], rows.puck_velocity[:, 0] = (x, y), (vx, vy)
    if paddle is not None:
        rows.position[:, 0], rows.velocity[:, 0], rows.spin[:] = paddle, 0.0, 0.0
    for name, value in memory.items():
        kept[name][:] = value
    world.set_state(rows, kept)


def idle(world, seconds):
    """Steps of worlds in which nobody moves."""
    still = np.zeros((world.num_worlds, len(world.open), 2))
    return [world.step(still) for _ in range(round(seconds / world.control_dt))]


def shoot(world, side, speed=2.5):
    """Send the puck through the middle of a side of a polygon, past its paddle."""
    normal, offset = world.scene.table.normals[side], world.scene.table.offsets[side]
    place_puck(world, *(-normal * (offset - 0.04)), *(-normal * speed))

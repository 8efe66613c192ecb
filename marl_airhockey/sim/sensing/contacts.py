"""Contacts of pucks with paddles, detected in delayed frames of a camera.

A camera rarely takes a frame at the moment of a contact. The puck's path is therefore
extrapolated forward from the older frame and backward from the newer one. A contact is
detected where one of these paths meets a paddle, and the puck moves toward this paddle
or away from it.
"""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.jit.cache import compiled
from marl_airhockey.types import Array

MOMENTS = 9
"""Number of times between two frames at which the paths are checked."""
MARGIN = 0.004
"""Largest gap that counts as a contact, m, for errors of calibration and noise."""


class ContactSensor:
    """Sensor of contacts in B worlds, from frames of pucks and paths of paddles.

    Args:
        scene: Bodies and their sizes.
        worlds: Number of worlds, B.
        control_dt: Length of a control step, s.
    """

    def __init__(self, scene: Scene, worlds: int, control_dt: float) -> None:
        bodies, table = scene.bodies, scene.table
        self._near, self._dt = table.puck_radius + table.paddle_radius, control_dt
        self._tracks = np.zeros((worlds, bodies.pucks, 5))
        """Last frame of each puck: time, s; x and y, m; vx and vy, m/s."""
        pairs = worlds, bodies.paddles, bodies.pucks
        self.touched = np.zeros(pairs, np.int64)
        """Number of contacts that began (B, paddles, pucks), as in `State`."""
        self.touched_at = np.full(pairs, np.nan)
        """Time of the contact relative to the start of the step (B, paddles, pucks), s;
        negative before the step, nan without a contact."""
        self.touching = np.zeros(pairs, np.bool_)
        """True for a contact in the newest frame (B, paddles, pucks)."""

    def reset(self, worlds: Array, taken: Array, track: Array) -> None:
        """Delete all contacts in some worlds.

        Args:
            worlds: Indices (W,) of the worlds.
            taken: Times of a frame (B, n) by body, pucks first, s.
            track: Positions, m, and velocities, m/s, in the frame (B, n, 4 or more),
                pucks first.
        """
        pucks = self._tracks.shape[1]
        self._tracks[worlds, :, 0] = taken[worlds, :pucks]
        self._tracks[worlds, :, 1:] = track[worlds, :pucks, :4]
        self.touched[worlds], self.touched_at[worlds] = 0, np.nan
        self.touching[worlds] = False

    def update(
        self, worlds: Array, taken: Array, track: Array, paddles: Array, now: Array
    ) -> None:
        """Find the contacts before the newest frames.

        Args:
            worlds: Indices (W,) of the worlds.
            taken: Times of the newest frames (B, n) by body, pucks first, s.
            track: Positions, m, and velocities, m/s, in these frames (B, n, 4 or more),
                pucks first.
            paddles: Positions (B, steps, S, 2) of the paddles at the last control
                steps, up to now, m.
            now: Current times (B,), s.
        """
        state = self._tracks, self.touched, self.touched_at, self.touching
        _update(worlds, taken, track, paddles, now, self._near, self._dt, *state)


@compiled(nogil=True, error_model="numpy")
def _update(
    worlds: Array,
    taken: Array,
    track: Array,
    paddles: Array,
    now: Array,
    near: float,
    control_dt: float,
    last: Array,
    touched: Array,
    touched_at: Array,
    touching: Array,
) -> None:
    """Update the arrays of a `ContactSensor` in place, see its `update`."""
    stored, new = paddles.shape[1], np.empty(5)
    for w in worlds:
        times = now[w] - control_dt * np.arange(stored - 1, -1, -1)
        touched[w], touched_at[w] = 0, np.nan
        for p in range(last.shape[1]):
            if taken[w, p] <= last[w, p, 0]:
                continue
            new[0], new[1:] = taken[w, p], track[w, p, :4]
            for s in range(paddles.shape[2]):
                at = contact_time(last[w, p], new, times, paddles[w, :, s], near)
                if np.isfinite(at) and not touching[w, s, p]:
                    touched[w, s, p] = 1
                    touched_at[w, s, p] = at - (now[w] - control_dt)
                touching[w, s, p] = np.isfinite(at)
            last[w, p] = new


@compiled(nogil=True, error_model="numpy")
def contact_time(
    before: Array, after: Array, times: Array, paddle: Array, near: float
) -> float:
    """Return the time of a puck's contact with a paddle between two frames, s.

    Args:
        before: Puck in the older frame (5,): time, s; x and y, m; vx and vy, m/s.
        after: Puck in the newer frame (5,), with the same elements.
        times: Times (n,) of the paddle's positions, s.
        paddle: Positions (n, 2) of the paddle, m.
        near: Distance between the centres in contact, m.

    Returns:
        Time of the contact; nan without a contact.
    """
    span, first = after[0] - before[0], np.nan
    start_x, start_y = _at(times, paddle, before[0])
    end_x, end_y = _at(times, paddle, after[0])
    speed_x, speed_y = (end_x - start_x) / span, (end_y - start_y) / span
    closing = (before[3] - speed_x) * (start_x - before[1])
    closing += (before[4] - speed_y) * (start_y - before[2])
    leaving = (after[3] - speed_x) * (after[1] - end_x)
    leaving += (after[4] - speed_y) * (after[2] - end_y)
    either, both = closing > 0.0 or leaving > 0.0, closing > 0.0 and leaving > 0.0
    half, beyond = MOMENTS // 2, (near + MARGIN) ** 2
    for k in range(MOMENTS):
        share = k / (MOMENTS - 1)
        at = before[0] + share * span
        x, y = _at(times, paddle, at)
        on_x = before[1] + share * span * before[3] - x
        on_y = before[2] + share * span * before[4] - y
        back_x = after[1] - (1.0 - share) * span * after[3] - x
        back_y = after[2] - (1.0 - share) * span * after[4] - y
        ahead = on_x * on_x + on_y * on_y < beyond
        # Each path is used in the half of the time that is nearer to its frame.
        met = (k <= half and ahead) or (
            k >= half and back_x * back_x + back_y * back_y < beyond
        )
        if met and either:
            return float(at)
        if ahead and both and np.isnan(first):
            first = at
    return float(first)


@compiled(nogil=True, error_model="numpy")
def _at(times: Array, path: Array, at: float) -> tuple[float, float]:
    """Return the point of a path (n, 2) at a time by linear interpolation."""
    if at <= times[0]:
        return path[0, 0], path[0, 1]
    for k in range(1, len(times)):
        if at <= times[k]:
            share = (at - times[k - 1]) / (times[k] - times[k - 1])
            return (
                path[k - 1, 0] + share * (path[k, 0] - path[k - 1, 0]),
                path[k - 1, 1] + share * (path[k, 1] - path[k - 1, 1]),
            )
    return path[-1, 0], path[-1, 1]

"""The lines that a puck's centre keeps inside of, and how a squeezed puck gets away."""

from __future__ import annotations

import math

from marl_airhockey.cast import Cast

SQUEEZE = 0.002
"""m: a puck that a paddle pushes deeper than this into a wall is set free."""


class Rails:
    """The walls of a cast as a puck's centre meets them, goal mouths left open."""

    def __init__(self, cast: Cast) -> None:
        table = cast.table
        self.touch = table.paddle_radius + table.puck_radius
        self._lines: list[tuple[float, ...]] = []
        for side, (nx, ny) in enumerate(table.normals.tolist()):
            start, end = table.ends(side)
            line = float(table.offsets[side]) - table.puck_radius
            widths = [m.width or 0.0 for m in cast.mouths if m.side == side]
            middle = ((start + end) / 2).tolist()
            half = max(widths, default=0.0) / 2
            self._lines.append((nx, ny, line, *middle, half))

    def wall(self, x: float, y: float, depth: float) -> tuple[float, ...] | None:
        """Normal and offset of a wall that a puck is deeper in than ``depth``, m."""
        for nx, ny, line, mx, my, half in self._lines:
            if nx * x + ny * y + line < -depth:
                aside = nx * (y - my) - ny * (x - mx)
                if abs(aside) >= half:
                    return nx, ny, line
        return None

    def inside(self, x: float, y: float) -> tuple[float, float]:
        """The place taken out of the walls; twice, for a corner."""
        for _ in range(2):
            wall = self.wall(x, y, 0.0)
            if wall is not None:
                nx, ny, line = wall
                into = nx * x + ny * y + line
                x, y = x - into * nx, y - into * ny
        return x, y

    def slip(
        self, x: float, y: float, paddles: list[tuple[float, float]]
    ) -> tuple[float, float] | None:
        """Where a puck goes that paddles squeeze into a wall: away along it.

        Neither wall nor paddle yields to a solver, which would push the puck into the
        wall; in a corner the paddle is left to ride over it. None: not squeezed.
        """
        wall = self.wall(x, y, SQUEEZE)
        if wall is None:
            return None
        nx, ny, _ = wall
        x, y = self.inside(x, y)
        for px, py in paddles:
            gap, aside = nx * (x - px) + ny * (y - py), nx * (y - py) - ny * (x - px)
            if gap * gap + aside * aside < self.touch**2:
                way = math.sqrt(self.touch**2 - gap**2)
                shift = math.copysign(way, aside) - aside
                x, y = x - shift * ny, y + shift * nx
        return self.inside(x, y)

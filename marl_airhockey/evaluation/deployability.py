"""Deployability: suitability of a driver's actions for a real arm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Deployability:
    """Suitability of a driver for a real arm, summarized as a class from A to D.

    * A: violations in at most 1 of 100 control steps, at most 10 % of the power above 5
      Hz, decisions within 5 ms.
    * B: violations in at most 1 of 10 steps, at most 25 % of the power, 10 ms.
    * C: violations in at most 1 of 2 steps, at most 50 % of the power, 25 ms.
    * D: all others.
    """

    violations_per_minute: float
    """Control steps per minute in which the action exceeded the limits of speed,
    acceleration, jerk or workspace."""
    jerk: float
    """Root mean square of the jerk of the commands, m/s3."""
    power_above_5hz: float
    """Share of the power of the actions above 5 Hz; nan for control rates of 10 Hz or
    less."""
    act_ms: float
    """Median CPU time of a decision for one world, ms; nan for a recording."""
    grade: str
    """Class: "A", "B", "C" or "D"."""

    @staticmethod
    def of(
        violations: float, jerk: float, power: float, act_ms: float, control_dt: float
    ) -> Deployability:
        """Return the measures with their class, which ignores measures that are nan.

        Args:
            violations: Share of the control steps with a violation.
            jerk: Root mean square of the jerk of the commands, m/s3.
            power: Share of the power of the actions above 5 Hz, or nan.
            act_ms: Median CPU time of a decision, ms, or nan.
            control_dt: Length of a control step, s.
        """
        bounds = {"A": (0.01, 0.10, 5.0), "B": (0.1, 0.25, 10.0), "C": (0.5, 0.5, 25.0)}
        high, act = np.nan_to_num([power, act_ms])
        grade = next(
            (
                name
                for name, (v, p, ms) in bounds.items()
                if violations <= v and high <= p and act <= ms
            ),
            "D",
        )
        per_minute = violations * 60 / control_dt
        return Deployability(per_minute, jerk, power, act_ms, grade)

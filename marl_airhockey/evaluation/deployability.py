"""Deployability: see the definitions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Deployability:
    """How fit a driver is for a real arm, summed up in a class.

    * A: violations of at most 1 minute in 100, power above 5 Hz at most 10 %,
      decisions within 5 ms.
    * B: at most 1 in 10, 25 %, 10 ms.   * C: at most 1 in 2, 50 %, 25 ms.   * D: else.
    """

    violations_per_minute: float
    """Control steps a minute in which what was asked exceeded speed, acceleration,
    jerk or reach"""
    jerk: float
    """Root mean square of the sent jerk, m/s3"""
    power_above_5hz: float
    """Share of the power of the asked actions above 5 Hz; nan below 10 Hz of control"""
    act_ms: float
    """Milliseconds of CPU that a decision for one world takes, median"""
    grade: str

    @staticmethod
    def of(
        violations: float, jerk: float, power: float, act_ms: float, control_dt: float
    ) -> Deployability:
        """Sum the measures up; ``violations`` is a share of the steps."""
        shares = {"A": (0.01, 0.10, 5.0), "B": (0.1, 0.25, 10.0), "C": (0.5, 0.5, 25.0)}
        high = 0.0 if np.isnan(power) else power
        grade = next(
            (
                name
                for name, (v, p, ms) in shares.items()
                if violations <= v and high <= p and act_ms <= ms
            ),
            "D",
        )
        minute = violations * 60 / control_dt
        return Deployability(minute, jerk, power, act_ms, grade)

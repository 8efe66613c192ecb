"""Configuration of team_juggle."""

from dataclasses import MISSING, dataclass


@dataclass
class TaskConfig:
    """Cooperative game of two paddles that hit a falling puck in turns."""

    profile: str = MISSING
    max_cycles: int = MISSING
    passes: int = MISSING
    lift_weight: float = MISSING

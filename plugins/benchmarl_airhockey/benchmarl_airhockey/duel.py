"""Configuration of duel."""

from dataclasses import MISSING, dataclass


@dataclass
class TaskConfig:
    """Duel of two paddles."""

    profile: str = MISSING
    opponent: str = MISSING
    max_cycles: int = MISSING
    goals_to_win: int = MISSING
    scored_weight: float = MISSING
    shot_weight: float = MISSING
    reaction: float = MISSING

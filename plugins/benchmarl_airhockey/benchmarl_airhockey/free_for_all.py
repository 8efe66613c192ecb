"""Configuration of free_for_all."""

from dataclasses import MISSING, dataclass


@dataclass
class TaskConfig:
    """Game of four paddles, each against all others."""

    profile: str = MISSING
    opponent: str = MISSING
    max_cycles: int = MISSING
    lives: int = MISSING
    shot_weight: float = MISSING
    reaction: float = MISSING

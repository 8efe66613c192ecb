"""Configuration of rally."""

from dataclasses import MISSING, dataclass


@dataclass
class TaskConfig:
    """Cooperative game of two paddles that keep the puck in play."""

    profile: str = MISSING
    max_cycles: int = MISSING
    crossings: int = MISSING
    patience: float = MISSING

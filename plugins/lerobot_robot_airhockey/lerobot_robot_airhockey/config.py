"""Configurations of the robot and of its teleoperator."""

from dataclasses import dataclass

from lerobot.robots import RobotConfig
from lerobot.teleoperators import TeleoperatorConfig


@RobotConfig.register_subclass("airhockey_paddle")
@dataclass(kw_only=True)
class AirHockeyPaddleConfig(RobotConfig):
    """Configuration of the paddle of a real table, or of the virtual lab."""

    rig: str = "lab"
    """File with the devices, which ``airhockey calibrate`` writes; "lab" for the
    virtual lab."""
    task: str = "touch"
    """Task that defines where puck and paddle are at first."""
    fps: int = 20
    """Rate of commands, 1/s; the same as that of the dataset."""
    width: int = 320
    """Width of the camera's image, pixels; 0 for no image."""


@TeleoperatorConfig.register_subclass("airhockey_driver")
@dataclass(kw_only=True)
class AirHockeyDriverConfig(TeleoperatorConfig):
    """Configuration of a driver of this library as a teleoperator."""

    driver: str = "striker"
    """Name of a driver that needs no observation of a task: a script, or
    ``shadow:rig=hand.json`` for a paddle in a person's hand."""
    seed: int = 0
    """Seed of the driver's random numbers."""

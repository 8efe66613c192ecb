"""Robot ``airhockey_paddle`` and teleoperator ``airhockey_driver`` of LeRobot."""

from lerobot_robot_airhockey.config import AirHockeyDriverConfig, AirHockeyPaddleConfig
from lerobot_robot_airhockey.driver import AirHockeyDriver
from lerobot_robot_airhockey.paddle import AirHockeyPaddle

__all__ = [
    "AirHockeyDriver",
    "AirHockeyDriverConfig",
    "AirHockeyPaddle",
    "AirHockeyPaddleConfig",
]

"""Parts that robot and teleoperator share."""


class VelocityDevice:
    """Device with velocities as actions that LeRobot does not calibrate."""

    @property
    def action_features(self) -> dict[str, type]:
        """Types of the parts of an action, a fraction of the top speed."""
        return {"x": float, "y": float}

    @property
    def is_calibrated(self) -> bool:
        """True, because ``airhockey calibrate`` writes the file of the devices."""
        return True

    def calibrate(self) -> None:
        """Do nothing."""

    def configure(self) -> None:
        """Do nothing: there are no further settings."""

"""Vision: the position of a puck from the frames of a calibrated camera."""

from marl_airhockey.devices.vision.colour import Colour
from marl_airhockey.devices.vision.detector import Detector, Sighting
from marl_airhockey.devices.vision.lens import Lens, View

__all__ = ["Colour", "Detector", "Lens", "Sighting", "View"]

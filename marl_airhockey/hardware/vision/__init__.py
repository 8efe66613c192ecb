"""Position of a puck from the frames of a calibrated camera."""

from marl_airhockey.hardware.vision.colour import Colour
from marl_airhockey.hardware.vision.detector import Detector, Sighting
from marl_airhockey.hardware.vision.lens import CameraView, Lens

__all__ = ["CameraView", "Colour", "Detector", "Lens", "Sighting"]

"""Settings of images, which are part of the name of an observation type."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from functools import cache

from marl_airhockey.sim.contracts.observable import OBSERVE
from marl_airhockey.sim.core.errors import unknown_name

IMAGES, CAMERA = "pixels", "camera"
"""Observation types of images with the default settings: drawn tables, and the frames
of a camera."""
PIXELS, OWN = "pixels", "agent_pos"
"""Entries of an observation of a camera: frames, and the state of the own paddle."""
OWN_SIZE = 4
"""Number of elements of this state: position, m, and velocity, m/s."""
CHANNELS = {"grey": 1, "rgb": 3}
"""Number of channels of a frame by colour."""
SIZES, STACKS = range(36, 257), range(1, 9)
"""Allowed sizes and numbers of frames."""


@dataclass(frozen=True)
class ImageForm:
    """Settings of images, as in ``pixels:size=64,colour=rgb,frames=1``.

    Raises:
        ValueError: A setting is not allowed.
    """

    size: int = 84
    """Width and height, pixels."""
    colour: str = "grey"
    """"grey" or "rgb"."""
    frames: int = 3
    """Number of frames, one for each of the last control steps."""

    def __post_init__(self) -> None:
        if self.colour not in CHANNELS:
            raise ValueError(unknown_name("colour", self.colour, list(CHANNELS)))
        for name, allowed in (("size", SIZES), ("frames", STACKS)):
            if getattr(self, name) not in allowed:
                raise ValueError(
                    f"{name}: {getattr(self, name)} is not one of {allowed[0]} .. "
                    f"{allowed[-1]}"
                )

    @property
    def channels(self) -> int:
        """Number of channels of a frame."""
        return CHANNELS[self.colour]

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape of an observation: height, width, and the channels of all frames."""
        return self.size, self.size, self.frames * self.channels


@dataclass(frozen=True)
class CameraForm(ImageForm):
    """Settings of the frames of a camera, as in ``camera:rig=rig.json,size=84``.

    Raises:
        ValueError: A setting is not allowed.
    """

    rig: str = ""
    """File that describes the camera of a table; "" for the camera of the virtual
    lab."""


FORMS = {IMAGES: ImageForm, CAMERA: CameraForm}
"""Settings of each observation type that has images."""


def shows_images(observe: str | None) -> bool:
    """Return True if an observation type has images."""
    return observe is not None and observe.partition(":")[0] in FORMS


def shows_camera(observe: str | None) -> bool:
    """Return True if an observation type has the frames of a camera."""
    return observe is not None and observe.partition(":")[0] == CAMERA


def kind_of_images(observe: str) -> ImageForm | None:
    """Return the settings of images that matter to a policy; None without images."""
    form = image_form(observe) if shows_images(observe) else None
    return replace(form, rig="") if isinstance(form, CameraForm) else form


def check_forms(forms: Iterable[str]) -> None:
    """Check that observation types exist.

    Raises:
        ValueError: A type is unknown.
    """
    for form in forms:
        if form not in OBSERVE and not shows_images(form):
            raise ValueError(unknown_name("observe", form, OBSERVE))


@cache
def image_form(observe: str) -> ImageForm:
    """Return the settings in the name of an observation type of images.

    Raises:
        ValueError: A setting is unknown or not allowed.
    """
    head, colon, tail = observe.partition(":")
    kind = FORMS[head]
    known = {f.name: str(f.type) for f in fields(kind)}
    found: dict[str, int | str] = {}
    for part in tail.split(",") if colon else ():
        name, _, value = (text.strip() for text in part.partition("="))
        if name not in known:
            raise ValueError(
                f"observe: {observe!r}: {unknown_name('setting', name, list(known))}"
            )
        if name in found:
            raise ValueError(f"observe: {observe!r}: {name} is given twice")
        try:
            found[name] = int(value) if known[name] == "int" else value
        except ValueError:
            raise ValueError(
                f"observe: {observe!r}: {name} must be a whole number"
            ) from None
    try:
        return kind(**found)  # type: ignore[arg-type]
    except ValueError as error:
        raise ValueError(f"observe: {observe!r}: {error}") from error

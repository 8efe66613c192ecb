"""Colours of images, videos, the 3D scene, camera overlays, plots and the browser page.

Seats have the colours of Okabe and Ito, which colour-blind people can distinguish. This
module is in `contracts`, because backends and renderers use it.
"""

from __future__ import annotations

from typing import Literal

Scheme = Literal["light", "dark"]
SEATS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Colours of seats: blue, vermilion, green, purple, orange, sky blue."""
SCHEMES: dict[Scheme, dict[str, str]] = {
    "light": {
        "room": "#e6ebf2",
        "field": "#fbfcfe",
        "rail": "#24324a",
        "print": "#9dbbe0",
        "faint": "#dbe6f2",
        "ink": "#1d232b",
        "soft": "#56606e",
        "puck": "#20262e",
        "block": "#c9a26b",
        "estimate": "#f0e442",
        "goal": "#009e73",
        "reward": "#8f6c05",
        "cost": "#d55e00",
        "drag": "#6b7785",
    },
    "dark": {
        "room": "#12161c",
        "field": "#1d242d",
        "rail": "#55657a",
        "print": "#3b5068",
        "faint": "#2a3542",
        "ink": "#eef2f6",
        "soft": "#9aa7b6",
        "puck": "#f2f5f8",
        "block": "#c9a26b",
        "estimate": "#f0e442",
        "goal": "#2fc79b",
        "reward": "#e0b73a",
        "cost": "#ff8a4a",
        "drag": "#93a1b1",
    },
}
"""Colours by name, for light and dark surroundings. ``print`` and ``faint`` are lines
on the table, ``ink`` and ``soft`` are text, and ``estimate`` outlines an estimated puck
in a camera image. The last four are the meanings of marks."""
LIGHT = SCHEMES["light"]


def rgb(colour: str) -> tuple[int, int, int]:
    """Return red, green and blue, 0 to 255, of a colour such as "#0072b2"."""
    red, green, blue = bytes.fromhex(colour.removeprefix("#"))
    return red, green, blue


def stylesheet() -> str:
    """Return the colours as CSS variables ``--<name>`` and ``--seat-<number>``."""
    seats = {f"seat-{i}": colour for i, colour in enumerate(SEATS)}
    light, dark = (
        "".join(f"--{name}: {colour}; " for name, colour in colours.items())
        for colours in ({**LIGHT, **seats}, SCHEMES["dark"])
    )
    return (
        f":root {{ {light}}}\n"
        f"@media (prefers-color-scheme: dark) {{ :root {{ {dark}}} }}\n"
    )

"""Parts that commands share: options, the console, and the progress of training."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from marl_airhockey.cli.progress import bar
from marl_airhockey.policies.trust import Trust
from marl_airhockey.sim.core.physics import load_physics
from marl_airhockey.sim.jit.threads import use_threads

if TYPE_CHECKING:
    from marl_airhockey.learn.algorithms import AnyConfig
    from marl_airhockey.learn.evaluate_policy import Metrics

console = Console()

Scenario = Annotated[
    str | None,
    typer.Option(
        "--scenario",
        "-s",
        help="Name or file of a scenario; by default the scenario in which the policy "
        "was trained.",
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
Video = Annotated[
    Path | None,
    typer.Option(
        help="Video to write instead of opening a window: .gif, .webp or .mp4."
    ),
]
Backend = Annotated[
    str,
    typer.Option(
        help="Physics engine: numba, pymunk or robosuite; real with --lab or --rig."
    ),
]
Profile = Annotated[
    str | None,
    typer.Option(
        help="Sensing and actuation: ideal, ur5e, ur5e-calibrated, ur5e-authors, "
        "gantry, or a file of airhockey fit-table; by default the profile in which "
        "the policy was trained, else ideal."
    ),
]
Options = Annotated[
    list[str] | None,
    typer.Option(
        "--option",
        help="Option of the scenario, NAME=VALUE; airhockey list SCENARIO prints all "
        "options. Can be repeated.",
    ),
]
Physics = Annotated[
    list[str] | None,
    typer.Option(
        help="Physics parameter, NAME=VALUE, or NAME=LOW:HIGH to sample it for each "
        "episode; or a preset (professional, wooden) or a TOML file of airhockey fit. "
        "Can be repeated."
    ),
]
Workers = Annotated[
    int | None,
    typer.Option(
        "--num-workers",
        help="Largest number of threads that step the worlds; by default the "
        "environment variable MARL_AIRHOCKEY_THREADS, or 1.",
        min=1,
        callback=use_threads,
    ),
]


def _trust(given: bool) -> bool:
    Trust.answer = True if given else Trust.answer
    return given


Trusting = Annotated[
    bool,
    typer.Option(
        "--trust",
        help="Load policies that contain pickled Python, which can run any code.",
        callback=_trust,
    ),
]
Drivers = Annotated[
    list[str] | None,
    typer.Option(
        "--driver",
        help="Driver of another seat, AGENT=NAME, for example paddle_1=striker. Can be "
        "repeated.",
    ),
]


def settings(pairs: list[str] | None) -> dict[str, Any]:
    """Return NAME=VALUE pairs as a dict.

    Values are parsed as TOML. A value that is not valid TOML is a string.

    Raises:
        ValueError: A pair has no "=", or a name is given twice.
    """
    chosen: dict[str, Any] = {}
    for pair in pairs or []:
        name, equals, value = pair.partition("=")
        if not equals:
            raise ValueError(f"{pair!r}: expected NAME=VALUE")
        if name in chosen:
            raise ValueError(f"{pair!r}: {name} is given twice")
        try:
            chosen[name] = tomllib.loads(f"v = {value}")["v"]
        except tomllib.TOMLDecodeError:
            chosen[name] = value
    return chosen


def physics_of(given: list[str] | None) -> dict[str, Any]:
    """Return physics parameters by name from the values of ``--physics``.

    Args:
        given: Names of presets, TOML files, NAME=VALUE and NAME=LOW:HIGH. The last two
            override presets and files.

    Raises:
        ValueError: A text is none of these, or a name is given twice.
    """
    loaded: dict[str, Any] = {}
    found: dict[str, Any] = {}
    for text in given or []:
        name, equals, value = text.partition("=")
        read = {} if equals else load_physics(text)
        if again := (loaded.keys() & read.keys()) | (found.keys() & {name}):
            raise ValueError(f"--physics {text}: {min(again)} is given twice")
        if not equals:
            loaded |= read
            continue
        try:
            numbers = [float(part) for part in value.split(":")]
        except ValueError:
            numbers = []
        if len(numbers) not in (1, 2):
            raise ValueError(
                f"--physics {text}: expected NAME=VALUE or NAME=LOW:HIGH, with numbers"
            )
        found[name] = numbers[0] if len(numbers) == 1 else tuple(numbers)
    return loaded | found


def measure_of(row: dict[str, float]) -> str:
    """Return the name of the measure in a row of evaluations: "success" or "score"."""
    return "success" if "success" in row else "score"


def train_with_progress(config: AnyConfig | None, folder: Path) -> Metrics:
    """Call `learn.train.run_training` with a progress bar."""
    from marl_airhockey.learn.train import run_training

    with bar() as progress:
        task = progress.add_task(folder.name, total=None, note="")

        def report(done: int, total: int, row: dict[str, float]) -> None:
            """Show the progress of training."""
            name = measure_of(row)
            note = f"{name} {row[name]:.2f}" if row else ""
            progress.update(task, completed=done, total=total, note=note)

        return run_training(config, folder, report)

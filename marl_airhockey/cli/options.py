"""Parts that commands share: the application, options, the progress bar."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from marl_airhockey.contracts.driver import Driver
from marl_airhockey.core.physics import load_physics
from marl_airhockey.jit.threads import use_threads
from marl_airhockey.registry import runs_code
from marl_airhockey.toolkit.policies import Policy
from marl_airhockey.toolkit.trust import Trust
from marl_airhockey.world.build import Keywords

if TYPE_CHECKING:
    from marl_airhockey.learn.algorithms import AnyConfig
    from marl_airhockey.learn.grade import Metrics

app = typer.Typer(
    help="Air hockey for robot learning and multi-agent RL.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)
console = Console()

Scenario = Annotated[
    str | None,
    typer.Option(
        "--scenario", "-s", help="What is played; None: the scenario of its training."
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Backend = Annotated[str, typer.Option(help="Physics.")]
Profile = Annotated[
    str,
    typer.Option(help="ideal, a robot's (ur5e, gantry), or a file: airhockey fit."),
]
Options = Annotated[
    list[str] | None,
    typer.Option("--option", help="A field of the scenario, NAME=VALUE; repeatable."),
]
Physics = Annotated[
    Path | None, typer.Option(help="A preset of physics, TOML; see airhockey fit.")
]
Workers = Annotated[
    int | None,
    typer.Option(
        "--num-workers",
        help="Threads that step the worlds; else MARL_AIRHOCKEY_THREADS says, or 1.",
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
        "--trust", help="Load policies that hold pickled Python.", callback=_trust
    ),
]
Drivers = Annotated[
    list[str] | None,
    typer.Option("--driver", help="Who drives another seat, AGENT=NAME; repeatable."),
]


def settings(pairs: list[str] | None) -> dict[str, Any]:
    """Return NAME=VALUE pairs as a dict; values as in TOML, bare words as strings.

    Raises:
        ValueError: a pair without "=".
    """
    chosen: dict[str, Any] = {}
    for pair in pairs or []:
        name, equals, value = pair.partition("=")
        if not equals:
            raise ValueError(f"{pair!r}: expected NAME=VALUE")
        try:
            chosen[name] = tomllib.loads(f"v = {value}")["v"]
        except tomllib.TOMLDecodeError:
            chosen[name] = value
    return chosen


def scenario_for(driver: Driver, given: str | None) -> str:
    """Return the scenario that a driver plays: as given, or that of its training.

    Raises:
        ValueError: neither is there; a name of code is not taken from a policy's file.
    """
    trained = driver.scenario if isinstance(driver, Policy) else ""
    found = given or ("" if runs_code(trained) else trained)
    if not found:
        raise ValueError("--scenario: say what the driver is to play")
    return found


def environment(
    backend: str,
    profile: str,
    option: list[str] | None,
    driver: list[str] | None,
    physics: Path | None = None,
) -> Keywords:
    """Return an environment's keywords from the options that commands share."""
    return {
        "backend": backend,
        "profile": profile,
        "options": settings(option),
        "drivers": settings(driver),
        "physics": load_physics(physics) if physics is not None else {},
    }


def measure_of(row: dict[str, float]) -> str:
    """Return the name of the measure in a row of training: "success" or "score"."""
    return "success" if "success" in row else "score"


def bar() -> Progress:
    """Return a progress bar on standard error, so that output can be piped."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[note]}"),
        console=Console(stderr=True),
    )


def train_with_progress(config: AnyConfig | None, folder: Path) -> Metrics:
    """Call `learn.train.train` with a progress bar."""
    from marl_airhockey.learn.train import train

    with bar() as progress:
        task = progress.add_task(folder.name, total=None, note="")

        def report(done: int, total: int, row: dict[str, float]) -> None:
            """Show the progress of training."""
            name = measure_of(row)
            note = f"{name} {row[name]:.2f}" if row else ""
            progress.update(task, completed=done, total=total, note=note)

        return train(config, folder, report)

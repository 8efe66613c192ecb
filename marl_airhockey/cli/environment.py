"""Options of the environment that a command uses: simulated or a real table."""

from __future__ import annotations

import functools
import inspect
import typing
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from marl_airhockey.build import table_keywords
from marl_airhockey.cli.options import (
    Backend,
    Drivers,
    Options,
    Physics,
    Profile,
    Trusting,
    console,
    physics_of,
    settings,
)
from marl_airhockey.cli.progress import errors, waiting
from marl_airhockey.registry import DEFAULT_BACKEND, REAL, make_driver, zoo_names
from marl_airhockey.rollouts.as_trained import (
    as_trained,
    describe_environment,
    seen_in,
)
from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.sim.world.keywords import Keywords

SUFFIX = "_full_size"
"""Suffix of the names of zoo policies that were trained for the real table."""

Observe = Annotated[
    str | None,
    typer.Option(
        help="Observation type: velocity, estimate, history or pixels; by default the "
        "type with which the policy was trained."
    ),
]
ControlDt = Annotated[
    float | None,
    typer.Option(
        help="Time between two actions, s; by default the time with which the policy "
        "was trained, else 0.05."
    ),
]
LabOption = Annotated[
    bool,
    typer.Option(
        "--lab",
        help="Use the virtual lab as the real table; a lab is started if none is "
        "running.",
    ),
]
RigOption = Annotated[
    Path | None,
    typer.Option(help="Rig file of a real table: its devices and their calibration."),
]


@dataclass(frozen=True, kw_only=True)
class SimulationOptions:
    """Options of a simulated environment; each field is an option of the command."""

    backend: Backend = DEFAULT_BACKEND
    profile: Profile = None
    option: Options = None
    physics: Physics = None
    control_dt: ControlDt = None
    trust: Trusting = False

    @property
    def keywords(self) -> Keywords:
        """Keywords of the environment for the options that were given."""
        keywords: Keywords = {"backend": self.backend}
        if self.profile is not None:
            keywords["profile"] = self.profile
        if self.option:
            keywords["options"] = settings(self.option)
        if self.physics:
            keywords["physics"] = physics_of(self.physics)
        if self.control_dt is not None:
            keywords["control_dt"] = self.control_dt
        return keywords


@dataclass(frozen=True, kw_only=True)
class EnvironmentOptions(SimulationOptions):
    """Options of an environment, simulated or a real table."""

    driver: Drivers = None
    observe: Observe = None
    lab: LabOption = False
    rig: RigOption = None

    @property
    def keywords(self) -> Keywords:
        """Keywords of the environment for the options that were given."""
        keywords = super().keywords
        if self.driver:
            keywords["drivers"] = settings(self.driver)
        if self.observe is not None:
            keywords["observe"] = self.observe
        return keywords

    def on_table(self, driver: str) -> str:
        """Return the name of the zoo policy that was trained for the real table.

        If the backend is not "real", or there is no such policy, return the given name.
        """
        own = f"{driver}{SUFFIX}"
        return own if self.backend == REAL and own in zoo_names() else driver

    def one_driver(
        self, name: str, scenario: str | None, quiet: bool = False
    ) -> tuple[str, Driver, str, Keywords]:
        """Return a driver for this environment, with the scenario and the keywords.

        Args:
            name: Name of a driver, or path of a policy.
            scenario: Scenario that was given; None for the scenario of its training.
            quiet: True to print the environment to standard error, see
                `as_trained_unless_given`.

        Returns:
            Name of the driver on this table, driver, scenario and keywords.
        """
        name = self.on_table(name)
        game, keywords, players = as_trained_unless_given(
            {name: make_driver(name)}, scenario, self.keywords, quiet
        )
        return name, players[name], game, keywords

    @contextmanager
    def table(self, keywords: Keywords) -> Iterator[Keywords]:
        """Yield the keywords of the environment on its table, while the lab runs.

        Args:
            keywords: Keywords of the environment.

        Raises:
            ValueError: --lab or --rig was given without the backend "real", or this
                backend without exactly one of them.
            RuntimeError: The lab does not start.
        """
        if self.backend == REAL:
            with rig_of(self.lab, self.rig) as path:
                yield table_keywords({**keywords, "rig": str(path)})
            return
        if self.lab or self.rig:
            raise ValueError("--lab and --rig need --backend real")
        yield keywords


@dataclass(frozen=True, kw_only=True)
class TableOptions(EnvironmentOptions):
    """Options of an environment with a real table as the default backend."""

    backend: Backend = REAL


def in_environment(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command that takes the fields of its ``environment`` as options.

    Args:
        command: Function with a parameter ``environment`` of one of the classes above.
    """
    hints = typing.get_type_hints(command, include_extras=True)
    kind = hints["environment"]
    parts = typing.get_type_hints(kind, include_extras=True)
    options = {
        name: inspect.Parameter(
            name,
            inspect.Parameter.KEYWORD_ONLY,
            default=field.default,
            annotation=_in_panel(parts[name]),
        )
        for name, field in kind.__dataclass_fields__.items()
    }
    own = [
        parameter.replace(kind=parameter.KEYWORD_ONLY, annotation=hints[name])
        for name, parameter in inspect.signature(command).parameters.items()
        if name != "environment"
    ]
    found = [*own, *options.values()]

    @functools.wraps(command)
    def wrapped(**given: Any) -> None:
        fields = {name: given.pop(name) for name in options}
        command(**given, environment=kind(**fields))

    wrapped.__signature__ = inspect.Signature(found)  # type: ignore[attr-defined]
    wrapped.__annotations__ = {p.name: p.annotation for p in found}
    del wrapped.__wrapped__
    return wrapped


def as_trained_unless_given(
    players: dict[str, Driver],
    scenario: str | None,
    keywords: Keywords,
    quiet: bool = False,
) -> tuple[str, Keywords, dict[str, Driver]]:
    """Complete scenario and keywords with those of the drivers' training; print them.

    Args:
        players: Drivers by name.
        scenario: Scenario, if it was given.
        keywords: Keywords that were given.
        quiet: True to print to standard error, because the output is JSON.

    Returns:
        Scenario, keywords, and the drivers with the observation type that was given.
    """
    found, keywords = as_trained(players, scenario, keywords)
    assert isinstance(found, str)
    players = {name: seen_in(player, keywords) for name, player in players.items()}
    line = describe_environment(found, keywords, players)
    (errors if quiet else console).print(
        line, soft_wrap=True, markup=False, highlight=False
    )
    return found, keywords, players


def _in_panel(annotation: Any) -> Any:
    """Return the annotation of an option with the help panel "Environment"."""
    kind, option = typing.get_args(annotation)
    option = copy(option)
    option.rich_help_panel = "Environment"
    return Annotated[kind, option]


@contextmanager
def rig_of(lab: bool, rig: Path | None) -> Iterator[Path]:
    """Yield the rig file of a real table, while the lab runs.

    Args:
        lab: True for the virtual lab.
        rig: Rig file of another table.

    Raises:
        ValueError: Both are given, or none.
        RuntimeError: The lab does not start.
    """
    if lab and rig:
        raise ValueError("--lab and --rig are two tables; give one of them")
    if rig:
        yield rig
        return
    if not lab:
        raise ValueError("no real table was given; add --lab or --rig FILE")
    from marl_airhockey.hardware.calibration.lab_rig import lab_rig

    with waiting("opening the lab (the first time takes longer)"):
        opened = lab_rig()
        path = opened.__enter__()
    try:
        yield path
    finally:
        opened.__exit__(None, None, None)

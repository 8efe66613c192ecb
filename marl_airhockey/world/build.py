"""Builder of worlds from the keywords that all environments share."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypedDict

import numpy as np

from marl_airhockey.contracts.driver import Driver
from marl_airhockey.contracts.scenario import Scenario
from marl_airhockey.core.errors import (
    UnknownKeywordError,
    unknown_keyword,
    unknown_name,
)
from marl_airhockey.core.physics import Given, Physics
from marl_airhockey.jit.threads import threads
from marl_airhockey.registry import (
    DEFAULT_BACKEND,
    find_backend,
    find_scenario,
    make_agent,
)
from marl_airhockey.world.world import World

LONGEST_STEP = 0.2
"""Longest control step, s, for which overlaps stay below 0.25 mm; in longer ones a
paddle has time to come to where a puck has crossed a goal line."""


class Keywords(TypedDict, total=False):
    """Keywords of every environment; see `build_world` for meanings."""

    backend: str
    drivers: Mapping[str, Any]
    seats: str
    profile: str
    observe: str
    goals: str
    physics: Given
    control_dt: float
    substeps: int
    max_cycles: int
    options: Mapping[str, Any]
    rig: str


def build_world(
    scenario: str | Scenario,
    num_worlds: int,
    autoreset: bool,
    keywords: Keywords,
) -> World:
    """Build B worlds of a scenario from the keywords that all environments share.

    Args:
        scenario: a name, code or an object, see `registry.find_scenario`.
        num_worlds: B.
        autoreset: whether worlds begin anew where an episode ended.
        keywords: all optional.
            backend: name of the physics ("numba").
            drivers: players of seats by agent, see `registry.make_agent`: names, paths
                of policies, functions, models and so on; the other seats are open.
            seats: "robot" or "arcade".
            profile: "ideal", or what a robot senses and how far physics may vary:
                "ur5e", "ur5e-authors" or "gantry", or a file,
                see `profiles.find_profile`.
            observe: "velocity" (in the ideal profile), "history" (in the others),
                "estimate" or "pixels", see `observable.OBSERVE`.
            goals: "flat" or "dict".
            physics: a preset's name, a TOML file, or parameters by name, values or
                (low, high) drawn per episode, which may name a ``preset``.
            control_dt: s between two actions (0.05).
            substeps: least number of physics steps in one control step (the
                backend's own); not for numba, which has none.
            max_cycles: length of an episode in control steps.
            options: the scenario's own fields.
            rig: file of a real table's devices and their calibration, for the backend
                "real" alone, see `rig.Rig`.

    Raises:
        UnknownKeywordError: a keyword that is none of these; TypeError and ValueError.
        ValueError: an unknown name or a value that makes no sense, named.
        RuntimeError: a backend that cannot run here, with the fix.
    """
    for name in keywords:
        if name not in Keywords.__annotations__:
            raise UnknownKeywordError(
                unknown_keyword(name, Keywords.__annotations__)
                + "; fields of the scenario go into options={...}"
            )
    threads()  # Refused here if it makes no sense, not at the first step.
    if num_worlds < 1:
        raise ValueError(f"num_worlds: {num_worlds} must be at least 1")
    game = scenario_of(scenario, keywords)
    scene = game.scene
    name = keywords.get("backend", DEFAULT_BACKEND)
    kind = find_backend(name)
    reason = kind.supports(scene)
    if reason:
        raise ValueError(f"backend {name!r} cannot play {game.name!r}: {reason}")
    control_dt = keywords.get("control_dt", 0.05)
    substeps = keywords.get("substeps")
    max_cycles = keywords.get("max_cycles")
    _check_times(control_dt, substeps, max_cycles)
    profile = keywords.get("profile", "ideal")
    given = keywords.get("physics")
    backend = kind(scene, num_worlds, control_dt, substeps)
    physics = Physics(
        scene.defaults, profile, given, arms=not kind.ideal, real=kind.realtime
    )
    usual = "velocity" if profile == "ideal" else "history"
    agents = [f"paddle_{i}" for i in range(len(scene.seats))]
    drivers: dict[int, Driver] = {}
    given_drivers = keywords.get("drivers", {})
    if not isinstance(given_drivers, Mapping):
        raise ValueError(f"drivers: {given_drivers!r} is no dict of players by agent")
    for agent, driver in given_drivers.items():
        if agent not in agents:
            raise ValueError(unknown_name("agent", agent, agents))
        drivers[agents.index(agent)] = seated = make_agent(driver)
        refuse_erratic(agent, seated, kind.realtime)
    if kind.realtime:
        backend.expect(Physics(scene.defaults, profile, given, arms=not kind.ideal))
    if kind.realtime or "rig" in keywords:
        backend.connect(keywords.get("rig", ""))
    return World(
        game,
        backend,
        drivers,
        physics,
        keywords.get("observe", usual),
        max_cycles,
        autoreset,
    )


def refuse_erratic(agent: str, driver: Driver, realtime: bool) -> None:
    """Do nothing if a driver may move what a backend moves.

    Raises:
        ValueError: it is erratic, and a real arm would follow it.
    """
    if realtime and driver.erratic:
        raise ValueError(f"{agent}: {driver!r} must not move a real arm")


def compile_world(scenario: str | Scenario, keywords: Keywords) -> None:
    """Compile all that a world needs, once per machine, restarts too."""
    world = build_world(scenario, 2, autoreset=True, keywords=keywords)
    world.reset(0)
    world.max_cycles = 1
    for _ in range(2):
        world.step(np.zeros((2, len(world.open), 2)))
    world.close()


def _check_times(
    control_dt: float, substeps: int | None, max_cycles: int | None
) -> None:
    if not 0.001 <= control_dt <= LONGEST_STEP:
        raise ValueError(
            f"control_dt: {control_dt} s must be in 0.001 .. {LONGEST_STEP}; in longer "
            "steps a paddle overlaps a puck that has scored"
        )
    whole = isinstance(substeps, int) and not isinstance(substeps, bool)
    if substeps is not None and not (whole and substeps >= 1):
        raise ValueError(
            f"substeps: {substeps!r} must be a whole number above 0: control_dt is a "
            "multiple of the simulation's step"
        )
    if max_cycles is not None and max_cycles < 1:
        raise ValueError(f"max_cycles: {max_cycles} must be at least 1")


def scenario_of(scenario: str | Scenario, keywords: Keywords) -> Scenario:
    """Return the scenario that keywords ask for."""
    options = dict(keywords.get("options", {}))
    for shared in ("seats", "goals"):
        if shared in keywords:
            options[shared] = keywords.get(shared)
    return find_scenario(scenario, **options)

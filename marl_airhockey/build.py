"""Builder of worlds from the keywords that all environments share."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from marl_airhockey.registry import (
    DEFAULT_BACKEND,
    find_backend,
    find_scenario,
    make_driver,
)
from marl_airhockey.sim.contracts.backend import Backend, LiveBackend
from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.core.checks import check_count
from marl_airhockey.sim.core.errors import (
    unknown_name,
)
from marl_airhockey.sim.core.physics import Physics
from marl_airhockey.sim.jit.threads import threads
from marl_airhockey.sim.world.keywords import Keywords, check_keywords
from marl_airhockey.sim.world.world import World

LONGEST_STEP = 0.2
"""Longest control step, s, for which overlaps stay below 0.25 mm; in longer ones a
paddle has time to come to where a puck has crossed a goal line."""


def build_world(
    scenario: str | Scenario,
    num_worlds: int,
    autoreset: bool,
    keywords: Keywords,
    forms: Collection[str] = (),
) -> World:
    """Build B worlds of a scenario from the keywords that all environments share.

    Args:
        scenario: Name, code or object, see `registry.find_scenario`.
        num_worlds: Number of worlds, B.
        autoreset: Whether a new episode begins where one ended.
        keywords: Keywords, all optional:
            backend: Name of the physics ("numba").
            drivers: Drivers of seats by agent, see `registry.make_driver`: names, paths
                of policies, functions, models and so on; the other seats are open.
            seats: "robot" or "arcade".
            profile: "ideal", or the sensing and the spread of physics of a robot:
                "ur5e", "ur5e-authors" or "gantry", or a file,
                see `profiles.find_profile`.
            observe: "velocity" (in the ideal profile), "history" (in the others),
                "estimate" or "pixels", see `observable.OBSERVE`.
            goals: "flat" or "dict".
            physics: Name of a preset, a TOML file, or parameters by name, values or
                (low, high) sampled per episode, which may name a ``preset``.
            control_dt: Time between two actions, s (0.05).
            substeps: Least number of physics steps in one control step (the
                backend's own); not for numba, which has none.
            max_cycles: Length of an episode in control steps.
            options: Fields of the scenario by name.
            rig: File of a real table's devices and their calibration, for the backend
                "real" alone, see `rig.Rig`.
        forms: Forms of observations of players who take open seats later, such as
            those of a `Roster`; those of the keywords' drivers are known.

    Raises:
        UnknownKeywordError: A keyword that is none of these; TypeError and ValueError.
        ValueError: An unknown name or a value that makes no sense, named.
        RuntimeError: A backend that cannot run here, with the fix.
    """
    check_keywords(keywords)
    keywords = table_keywords(keywords)
    threads()  # Refused here if it makes no sense, not at the first step.
    num_worlds = check_count("num_worlds", num_worlds)
    game = scenario_of(scenario, keywords)
    profile, max_cycles = keywords.get("profile", "ideal"), keywords.get("max_cycles")
    kind = _backend_of(game, keywords)
    live = issubclass(kind, LiveBackend)
    physics = _physics(game, kind, keywords, real=live)
    drivers = _drivers(game, live, keywords)
    backend = _backend(kind, game, num_worlds, keywords)
    usual = "velocity" if profile == "ideal" else "history"
    own = [driver.observe for driver in drivers.values() if driver.observe]
    # Each once, in this order: the first is the form of the open seats.
    every = dict.fromkeys([keywords.get("observe", usual), *own, *forms])
    return World(game, backend, drivers, physics, tuple(every), max_cycles, autoreset)


def build_driven_world(
    driver: Driver,
    scenario: str | Scenario,
    num_worlds: int,
    keywords: Keywords,
    forms: Collection[str] = (),
) -> World:
    """Build worlds in which a driver controls ``paddle_0`` and its teammates' seats.

    All other seats need drivers, too. Episodes do not restart.

    Args:
        driver: Driver of the team of ``paddle_0``.
        scenario: Name of the scenario, or a scenario object.
        num_worlds: Number of worlds.
        keywords: Keywords of the environment; its drivers replace that of teammates.
        forms: See `build_world`.

    Raises:
        ValueError: A seat without a driver, named.
    """
    if "paddle_0" in keywords.get("drivers", {}):
        raise ValueError("drivers: paddle_0 is the seat of the driver that is measured")
    scene = scenario_of(scenario, keywords).scene
    team = [i for i, s in enumerate(scene.seats) if s.team == scene.seats[0].team]
    own = {f"paddle_{i}": driver for i in team}
    drivers = {**own, **keywords.get("drivers", {}), "paddle_0": driver}
    driven: Keywords = {**keywords, "drivers": drivers}
    world = build_world(scenario, num_worlds, False, driven, forms)
    if len(world.open):
        raise ValueError(
            f"{world.scenario.name!r} has more seats: say who drives paddle_"
            f"{world.open[0]}, e.g. --driver paddle_{world.open[0]}=goalkeeper"
        )
    return world


def table_keywords(keywords: Keywords) -> Keywords:
    """Return keywords with the table and the profile of a real table's rig.

    Those that are given stay, but for the profile "ideal", which no real table has.
    Keywords of a simulation are returned as they are.

    Raises:
        ValueError: A rig that cannot be read.
    """
    backend = find_backend(keywords.get("backend", DEFAULT_BACKEND))
    rig = keywords.get("rig", "")
    if not (rig and issubclass(backend, LiveBackend)):
        return keywords
    table, profile = backend.table_and_profile(rig)
    options = {"table": table, **keywords.get("options", {})}
    given = keywords.get("profile", "ideal")
    used = profile if given == "ideal" else given
    return {**keywords, "profile": used, "options": options}


def _backend_of(game: Scenario, keywords: Keywords) -> type[Backend]:
    """Return the class of the backend that keywords name, which supports a scenario."""
    name = keywords.get("backend", DEFAULT_BACKEND)
    kind = find_backend(name)
    reason = kind.supports(game.scene)
    if reason:
        raise ValueError(f"backend {name!r} cannot play {game.name!r}: {reason}")
    return kind


def _backend(
    kind: type[Backend], game: Scenario, num_worlds: int, keywords: Keywords
) -> Backend:
    """Return a backend of a kind for the scene of a scenario."""
    control_dt, substeps = keywords.get("control_dt", 0.05), keywords.get("substeps")
    _check_times(control_dt, substeps)
    if not issubclass(kind, LiveBackend):
        if "rig" in keywords:
            raise ValueError(
                'rig: this backend has no devices; leave it out, or take backend="real"'
            )
        return kind(game.scene, num_worlds, control_dt, substeps)
    if num_worlds != 1:
        raise ValueError(
            f"num_worlds: {num_worlds}; expected 1, as there is one real table"
        )
    if substeps is not None:
        raise ValueError("substeps: a real table has no physics steps; leave it out")
    expected = _physics(game, kind, keywords, real=False)
    return kind.open(game.scene, control_dt, keywords.get("rig", ""), expected)


def _physics(
    game: Scenario, backend: type[Backend], keywords: Keywords, real: bool
) -> Physics:
    """Return the ranges of physics that keywords name, see `Physics` for ``real``."""
    return Physics(
        game.scene.defaults,
        keywords.get("profile", "ideal"),
        keywords.get("physics"),
        arms=not backend.tracks_commands,
        real=real,
    )


def _drivers(game: Scenario, live: bool, keywords: Keywords) -> dict[int, Driver]:
    """Return the drivers that keywords name, by seat."""
    agents = [f"paddle_{i}" for i in range(len(game.scene.seats))]
    drivers: dict[int, Driver] = {}
    for agent, driver in keywords.get("drivers", {}).items():
        if agent not in agents:
            raise ValueError(unknown_name("agent", agent, agents))
        drivers[agents.index(agent)] = seated = make_driver(driver)
        refuse_erratic(agent, seated, live)
    return drivers


def refuse_erratic(agent: str, driver: Driver, live: bool) -> None:
    """Refuse an erratic driver on a real table.

    Args:
        agent: Agent at the driver's seat.
        driver: Driver.
        live: Whether a real arm would follow it.

    Raises:
        ValueError: It is erratic, and a real arm would.
    """
    if live and driver.erratic:
        raise ValueError(f"{agent}: {driver!r} must not move a real arm")


def compile_world(scenario: str | Scenario, keywords: Keywords) -> None:
    """Compile all that a world needs, once per machine, restarts too."""
    for worlds in (1, 2):
        world = build_world(scenario, worlds, autoreset=True, keywords=keywords)
        world.reset(0)
        world.max_cycles = 1
        for _ in range(2):
            world.step(np.zeros((worlds, len(world.open), 2)))
        world.close()


def _check_times(control_dt: float, substeps: int | None) -> None:
    if not 0.001 <= control_dt <= LONGEST_STEP:
        raise ValueError(
            f"control_dt: {control_dt} s must be in 0.001 .. {LONGEST_STEP}; in longer "
            "steps a paddle overlaps a puck that has scored"
        )
    if substeps is not None:
        why = ": control_dt is a multiple of the simulation's step"
        check_count("substeps", substeps, why)


def scenario_of(scenario: str | Scenario, keywords: Keywords) -> Scenario:
    """Return the scenario that keywords ask for."""
    options = dict(keywords.get("options", {}))
    for shared in ("seats", "goals"):
        if shared not in keywords:
            continue
        if options.get(shared, keywords.get(shared)) != keywords.get(shared):
            raise ValueError(
                f"{shared}: given twice, {keywords.get(shared)!r} and in options "
                f"{options[shared]!r}"
            )
        options[shared] = keywords.get(shared)
    return find_scenario(scenario, **options)

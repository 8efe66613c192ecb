"""Builder of worlds from the keywords that all environments share."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from marl_airhockey.cameras import camera_models
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
"""Longest control step, s. With it, overlaps stay below 0.25 mm. In a longer step, a
paddle could reach the position at which a puck has crossed a goal line."""


def build_world(
    scenario: str | Scenario,
    num_worlds: int,
    autoreset: bool,
    keywords: Keywords,
    forms: Collection[str] = (),
) -> World:
    """Create B worlds of a scenario from the keywords that all environments share.

    Args:
        scenario: Name, code, class or object, see `registry.find_scenario`.
        num_worlds: Number of worlds, B.
        autoreset: True to begin a new episode in the step in which one ended.
        keywords: Shared keywords, which `make.parallel_env` explains. All are optional.
        forms: Observation types of drivers that take open seats later, such as those of
            a `Roster`. The types of the drivers in ``keywords`` are added
            automatically.

    Returns:
        Worlds; seats without a driver are open.

    Raises:
        UnknownKeywordError: A keyword is unknown. The error is a TypeError and a
            ValueError.
        ValueError: A name is unknown, or a value is not valid.
        RuntimeError: The backend cannot run here. The message states what to do.
    """
    check_keywords(keywords)
    keywords = table_keywords(keywords)
    threads()  # Check the number of threads here, before the first step.
    num_worlds = check_count("num_worlds", num_worlds)
    game = scenario_of(scenario, keywords)
    profile, max_cycles = keywords.get("profile", "ideal"), keywords.get("max_cycles")
    kind = _backend_of(game, keywords)
    live = issubclass(kind, LiveBackend)
    physics = _physics(game, kind, keywords, real=live)
    drivers = seat_drivers(game, keywords, live)
    backend = _backend(kind, game, num_worlds, keywords)
    usual = "velocity" if profile == "ideal" else "history"
    own = [driver.observe for driver in drivers.values() if driver.observe]
    # Each type occurs once. The first one is the type of the open seats.
    every = dict.fromkeys([keywords.get("observe", usual), *own, *forms])
    parts = game, backend, drivers, physics, tuple(every), max_cycles, autoreset
    return World(*parts, camera_models(every, game.scene, backend))


def build_driven_world(
    driver: Driver,
    scenario: str | Scenario,
    num_worlds: int,
    keywords: Keywords,
    forms: Collection[str] = (),
) -> World:
    """Create worlds in which a driver controls ``paddle_0`` and its teammates.

    All other seats need drivers, too. Worlds do not begin a new episode automatically.

    Args:
        driver: Driver of the team of ``paddle_0``.
        scenario: Name of the scenario, or a scenario object.
        num_worlds: Number of worlds, B.
        keywords: Shared keywords. Their drivers replace ``driver`` at the seats of
            teammates.
        forms: Observation types of drivers that take seats later, see `build_world`.

    Raises:
        ValueError: A seat has no driver.
    """
    if "paddle_0" in keywords.get("drivers", {}):
        raise ValueError(
            "drivers: paddle_0 is the seat of the evaluated driver; leave it out"
        )
    scene = scenario_of(scenario, keywords).scene
    team = [i for i, s in enumerate(scene.seats) if s.team == scene.seats[0].team]
    own = {f"paddle_{i}": driver for i in team}
    drivers = {**own, **keywords.get("drivers", {}), "paddle_0": driver}
    driven: Keywords = {**keywords, "drivers": drivers}
    world = build_world(scenario, num_worlds, False, driven, forms)
    if len(world.open):
        raise ValueError(
            f"{world.scenario.name!r} has more seats: add a driver for paddle_"
            f"{world.open[0]}, e.g. --driver paddle_{world.open[0]}=goalkeeper"
        )
    return world


def table_keywords(keywords: Keywords) -> Keywords:
    """Return keywords with the table and the profile of a real table's rig.

    A given table or profile has priority, except for the profile "ideal", which no real
    table has. Keywords of a simulation are returned unchanged.

    Raises:
        ValueError: The file of the rig cannot be read.
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
    """Return the class of the backend, which must support the scenario."""
    name = keywords.get("backend", DEFAULT_BACKEND)
    kind = find_backend(name)
    reason = kind.supports(game.scene)
    if reason:
        raise ValueError(f"backend {name!r} does not support {game.name!r}: {reason}")
    return kind


def _backend(
    kind: type[Backend], game: Scenario, num_worlds: int, keywords: Keywords
) -> Backend:
    """Return a backend of a class for the scene of a scenario."""
    control_dt, substeps = keywords.get("control_dt", 0.05), keywords.get("substeps")
    _check_times(control_dt, substeps)
    if not issubclass(kind, LiveBackend):
        if "rig" in keywords:
            raise ValueError(
                'rig: this backend has no devices; leave it out, or set backend="real"'
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
    """Return the ranges of physics parameters; `Physics` explains ``real``."""
    return Physics(
        game.scene.defaults,
        keywords.get("profile", "ideal"),
        keywords.get("physics"),
        arms=not backend.tracks_commands,
        real=real,
    )


def seat_drivers(
    game: Scenario, keywords: Keywords, live: bool = False
) -> dict[int, Driver]:
    """Return the drivers in the keywords, by seat index.

    Args:
        game: Scenario with the seats.
        keywords: Keywords of a world.
        live: True if a real arm would follow the drivers.

    Raises:
        ValueError: A name is unknown, or a driver must not move an arm.
    """
    agents = [f"paddle_{i}" for i in range(len(game.scene.seats))]
    drivers: dict[int, Driver] = {}
    for agent, driver in keywords.get("drivers", {}).items():
        if agent not in agents:
            raise ValueError(unknown_name("agent", agent, agents))
        drivers[agents.index(agent)] = seated = make_driver(driver)
        refuse_erratic(agent, seated, live)
    return drivers


def refuse_erratic(agent: str, driver: Driver, live: bool) -> None:
    """Check that a driver may move the arm of a real table.

    Args:
        agent: Agent at the driver's seat.
        driver: Driver of the seat.
        live: True if a real arm would follow the driver.

    Raises:
        ValueError: A real arm would follow a driver that must never move one.
    """
    if live and driver.erratic:
        raise ValueError(f"{agent}: {driver!r} must not move a real arm")


def compile_world(scenario: str | Scenario, keywords: Keywords) -> None:
    """Compile all code of a world, including resets, once for each machine."""
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
            "steps a paddle could overlap a puck that has scored"
        )
    if substeps is not None:
        why = ": control_dt is a multiple of the physics step"
        check_count("substeps", substeps, why)


def scenario_of(scenario: str | Scenario, keywords: Keywords) -> Scenario:
    """Return the scenario with the options in the keywords."""
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

"""Environment in which policies are evaluated, by default that of their training."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

from marl_airhockey.policies.policy import Policy
from marl_airhockey.policies.trust import is_trusted_code, require_trust
from marl_airhockey.registry import find_scenario, make_driver, runs_code
from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.sim.contracts.image_form import kind_of_images
from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.world.keywords import Keywords

EVERYWHERE = ("profile", "control_dt", "goals")
"""Keywords of a policy's training that apply in any scenario."""
IN_ITS_SCENARIO = ("options", "physics")
"""Keywords of a policy's training that apply only in the same scenario."""


def as_trained(
    players: Mapping[str, Driver],
    scenario: str | Scenario | None,
    keywords: Keywords,
) -> tuple[str | Scenario, Keywords]:
    """Complete keywords with those of the environment in which policies were trained.

    Args:
        players: Drivers by name. Drivers that are not policies add no keywords.
        scenario: Requested scenario, or None.
        keywords: Requested keywords, which have priority. Options, drivers and physics
            are merged by name.

    Returns:
        Scenario and keywords of the environment. With a single player, the drivers of
        other seats are also those of its training.

    Raises:
        ValueError: The scenario is unknown, the policies were trained in different
            environments, or one names Python code that is not trusted.
    """
    known = {
        name: player.trained_in for name, player in players.items() if player.trained_in
    }
    if scenario is None:
        scenario = _agreed("scenario", known)
        if scenario is None:
            raise ValueError("scenario: none is known; name the scenario to play")
        _require_trust(str(scenario), players)
    same = {n: t for n, t in known.items() if _is_scenario(t, scenario)}
    found = {name: _agreed(name, known) for name in EVERYWHERE}
    found |= {name: _agreed(name, same) for name in IN_ITS_SCENARIO}
    if len(players) == 1:
        found["drivers"] = _agreed("drivers", same)
        for driver in (found["drivers"] or {}).values():
            _require_trust(str(driver), players)
    given = cast(dict[str, Any], keywords)
    if "goals" in given.get("options", {}) or isinstance(scenario, Scenario):
        del found["goals"]
    merged = {name: value for name, value in found.items() if value}
    merged |= given
    for name in ("options", "drivers", "physics"):
        if found.get(name) and isinstance(given.get(name), Mapping):
            merged[name] = {**cast(Any, found[name]), **given[name]}
    return scenario, cast(Keywords, merged)


def seen_in(player: Driver, keywords: Keywords) -> Driver:
    """Return a policy with the observation type of the keywords, if they have one.

    Raises:
        ValueError: One of the types is another kind of images.
    """
    observe = keywords.get("observe")
    if observe and isinstance(player, Policy):
        own = player.observe or observe
        if kind_of_images(own) != kind_of_images(observe):
            raise ValueError(
                f"{player.source}: it was trained with observe={own!r}, not with "
                f"{observe!r}; omit observe"
            )
        return replace(player, observe=observe)
    return player


def describe_environment(
    scenario: str | Scenario,
    keywords: Keywords,
    players: Mapping[str, Driver],
) -> str:
    """Return one line that names a scenario and describes its environment."""
    forms = {p.observe for p in players.values() if isinstance(p, Policy)} - {None}
    observe = keywords.get("observe") or "/".join(sorted(map(str, forms)))
    named = scenario if isinstance(scenario, str) else find_scenario(scenario).name
    parts = [f"profile {keywords.get('profile', 'ideal')}"]
    parts += [f"observe {observe}"] if observe else []
    parts.append(f"control_dt {keywords.get('control_dt', 0.05):g} s")
    for name in (*IN_ITS_SCENARIO, "drivers"):
        value = keywords.get(name)
        if isinstance(value, Mapping) and value:
            parts.append(f"{name} " + " ".join(f"{k}={v}" for k, v in value.items()))
    sources = [p.source for p in players.values() if isinstance(p, Policy)]
    if len(players) == 1 and sources and sources[0] not in players:
        parts.append(f"policy {sources[0]}")
    for name, player in players.items():
        if player.trained_in and not _is_scenario(player.trained_in, named):
            parts.append(f"{name} was trained in {player.trained_in['scenario']}")
    return f"{named}: {', '.join(parts)}"


def _agreed(name: str, known: Mapping[str, Mapping[str, Any]]) -> Any:
    """Return the value of all policies that have one; None if none has.

    Raises:
        ValueError: The values are different.
    """
    found = {player: facts[name] for player, facts in known.items() if name in facts}
    values = list(found.values())
    if any(value != values[0] for value in values):
        listed = ", ".join(f"{player}: {value}" for player, value in found.items())
        raise ValueError(
            f"{name}: the policies were trained with different values ({listed}); "
            f"choose one"
        )
    return values[0] if values else None


def _is_scenario(facts: Mapping[str, Any], scenario: object) -> bool:
    """Return True if a policy was, or may have been, trained in a named scenario.

    It is False for scenario objects, because they have their options already.
    """
    if not isinstance(scenario, str):
        return False
    trained = facts.get("scenario", scenario)
    return trained == scenario or _resolved(trained) == _resolved(scenario)


def _resolved(text: str) -> str:
    """Return code as training stores it, with the absolute path of its file."""
    place, colon, name = text.partition(":")
    return f"{Path(place).expanduser().resolve()}{colon}{name}"


def _require_trust(text: str, players: Mapping[str, Driver]) -> None:
    """Check that the user has trained with the code that a policy's file names."""
    if not runs_code(text) or is_trusted_code(text):
        return
    file, source = Path(text.partition(":")[0]), next(iter(players))
    if file.suffix == ".py" and not file.exists():
        raise ValueError(
            f"{source}: it was trained in {text}, but this file does not exist"
        )
    unknown = (
        f"the name of Python code that you have not trained with in its current state, "
        f"{text}"
    )
    require_trust(Path(source), code=unknown)


def seated_players(
    players: Mapping[str, object] | Sequence[str],
    scenario: str,
    keywords: Keywords,
    exact: bool,
) -> tuple[dict[str, Driver], Keywords]:
    """Return drivers by name, and the keywords of their environment.

    Args:
        players: Players by name, see `registry.make_driver`, or a list of names.
        scenario: Scenario that they play.
        keywords: Requested keywords.
        exact: True for the default values of all other keywords, False for those of
            training.

    Raises:
        ValueError: ``players`` is a single name, or the policies were trained in
            different environments.
    """
    if isinstance(players, str):
        raise ValueError(f"players: expected a list of names, got {players!r}")
    named = players if isinstance(players, Mapping) else {n: n for n in players}
    drivers = {name: make_driver(player) for name, player in named.items()}
    if exact:
        return drivers, keywords
    _, keywords = as_trained(drivers, scenario, keywords)
    return {n: seen_in(driver, keywords) for n, driver in drivers.items()}, keywords

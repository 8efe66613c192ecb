"""Descriptions of scenarios and profiles as plain data."""

from __future__ import annotations

import dataclasses
import sys
import warnings
from dataclasses import replace
from typing import Any

import numpy as np

from marl_airhockey.build import build_world
from marl_airhockey.discovery import gymnasium_id
from marl_airhockey.envs.meanings import (
    description,
    option_meanings,
    success_meaning,
    term_meanings,
)
from marl_airhockey.registry import (
    backend_names,
    driver_names,
    find_scenario,
    make_scenario,
    plugin_names,
    scenario_names,
    zoo_names,
)
from marl_airhockey.sim.contracts.scenario import Scenario, Transition
from marl_airhockey.sim.contracts.units import range_of
from marl_airhockey.sim.core.parameters import PARAMETERS
from marl_airhockey.sim.core.profiles import PROFILES, delay_of, find_profile
from marl_airhockey.sim.core.rng import RandomStreams


def what(scenario: Scenario) -> str:
    """Return the first paragraph of the docstring of a scenario's module."""
    text = sys.modules[type(scenario).__module__].__doc__ or ""
    return text.strip().split("\n\n")[0]


def _id(name: str) -> str | None:
    """Return the gymnasium id of a scenario; None if it is not in this library."""
    return gymnasium_id(name) if name in scenario_names() else None


def summary() -> dict[str, Any]:
    """Return the names of all scenarios, drivers, policies, backends and profiles.

    A scenario of an installed package that cannot be created is left out, with a
    warning.
    """
    rows = []
    for name in (*scenario_names(), *plugin_names("scenarios")):
        try:
            scenario = make_scenario(name)
        except ValueError as error:
            warnings.warn(f"scenario {error}", RuntimeWarning, stacklevel=2)
            continue
        rows.append(
            {
                "name": name,
                "what": what(scenario),
                "seats": len(scenario.scene.seats),
                "seconds": scenario.seconds,
                "id": _id(name),
            }
        )
    return {
        "scenarios": rows,
        "drivers": [*driver_names(), *plugin_names("drivers")],
        "zoo": zoo_names(),
        "backends": backend_names(),
        "profiles": list(PROFILES),
    }


def describe_profile(name: str) -> dict[str, Any]:
    """Return the end-to-end latency of a profile and the ranges of its physics."""
    profile = find_profile(name)
    least, longest = (1000.0 * end for end in delay_of(profile))
    follows = {key: follow.range for key, follow in profile.follows.items()}
    times = {f"{key} (times)": pair for key, pair in profile.shares.items()}
    rows = [
        {
            "parameter": key,
            "low": round(pair[0], 6),
            "high": round(pair[1], 6),
            "unit": "" if key in times else PARAMETERS[key].unit,
            "meaning": PARAMETERS[key.partition(" ")[0]].meaning,
        }
        for key, pair in {**profile.ranges, **follows, **times}.items()
    ]
    delay = f"{least:.0f} .. {longest:.0f} ms from an event to 50 % of a velocity step"
    return {"name": name, "what": profile.what, "delay": delay, "parameters": rows}


def describe(name: str) -> dict[str, Any]:
    """Return the description of a scenario as plain data.

    It contains the class docstring by section, success, seats, observation, reward and
    options.
    """
    scenario = find_scenario(name)
    layout = build_world(name, 1, autoreset=True, keywords={}).observer.layout
    terms, options = term_meanings(type(scenario)), option_meanings(type(scenario))
    return {
        "name": name,
        "id": _id(name),
        **description(type(scenario)),
        "success": success_meaning(type(scenario)),
        "seconds": scenario.seconds,
        "seats": [
            {
                "agent": f"paddle_{i}",
                "side": seat.side,
                "team": seat.team,
                "top speed m/s": seat.speed,
                "acceleration m/s2": seat.acceleration,
            }
            for i, seat in enumerate(scenario.scene.seats)
        ],
        "observation": [
            {
                "label": label,
                "unit": unit_of(label),
                "low": round(float(low), 3),
                "high": round(float(high), 3),
                "meaning": " ".join(meaning.split()),
            }
            for label, low, high, meaning in zip(
                *(layout.labels, layout.low, layout.high, layout.meanings), strict=True
            )
        ],
        "reward": [
            {"term": term, "meaning": terms.get(term, "")}
            for term in reward_terms(scenario)
        ],
        "options": [
            {
                "option": f.name,
                "default": getattr(scenario, f.name),
                "range": range_of(str(f.type)),
                "meaning": options.get(f.name, ""),
            }
            for f in dataclasses.fields(scenario)
        ],
    }


UNITS = {
    **dict.fromkeys(("x", "y", "dx", "dy", "struck_at"), "m"),
    **dict.fromkeys(("vx", "vy", "spin"), "m/s"),
    **dict.fromkeys(("age", "held"), "s"),
}
"""Units of elements of observations, by the last word of their label."""


def unit_of(label: str) -> str:
    """Return the unit of an element of an observation; "" for flags and counts."""
    word = label.rpartition(".")[2].rstrip("0123456789").rstrip("_")
    return UNITS.get(word, "")


def reward_terms(scenario: Scenario) -> list[str]:
    """Return the names of all reward terms of a scenario, without compiling it."""
    first = np.zeros(1, np.int64)
    state, memory = scenario.reset(RandomStreams.keyed(first, first, "start"), 1)
    if scenario.scene.path:
        moments = np.zeros((1, 2, scenario.scene.bodies.movers, 4))
        state = replace(state, path=moments)
    command = np.zeros((1, len(scenario.scene.seats), 2))
    t = Transition(state, command, state, memory, memory, np.zeros(1, np.bool_))
    t = t._replace(new_memory=scenario.next_memory(t))
    return list(scenario.all_reward_terms(t))

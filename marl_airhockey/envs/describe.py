"""What there is, in words: read off the scenarios themselves."""

from __future__ import annotations

import dataclasses
import sys
from typing import Any

import numpy as np

from marl_airhockey.contracts.scenario import Scenario
from marl_airhockey.registry import (
    agent_names,
    backend_names,
    gymnasium_id,
    make_scenario,
    scenario_names,
    zoo_names,
)
from marl_airhockey.world.build import build_world


def what(scenario: Scenario) -> str:
    """The sentence at the head of a scenario's file."""
    text = sys.modules[type(scenario).__module__].__doc__ or ""
    return text.strip().split("\n\n")[0]


def summary() -> dict[str, Any]:
    """Names of all scenarios, drivers and backends."""
    rows = []
    for name in scenario_names():
        scenario = make_scenario(name)
        rows.append(
            {
                "name": name,
                "what": what(scenario),
                "seats": len(scenario.scene.seats),
                "seconds": scenario.seconds,
                "id": gymnasium_id(name),
            }
        )
    return {
        "scenarios": rows,
        "drivers": agent_names(),
        "zoo": zoo_names(),
        "backends": backend_names(),
    }


def describe(name: str) -> dict[str, Any]:
    """Seats, observation, reward terms and options of a scenario."""
    scenario = make_scenario(name)
    world = build_world(name, 1, autoreset=True, keywords={})
    world.reset(0)
    step = world.step(np.zeros((1, len(world.open), 2)))
    layout = world.observer.layout
    doc = (type(scenario).__doc__ or "").strip()
    return {
        "name": name,
        "id": gymnasium_id(name),
        "what": what(scenario) + "\n" + " ".join(doc.split()),
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
            {"label": label, "low": round(float(low), 3), "high": round(float(high), 3)}
            for label, low, high in zip(
                layout.labels, layout.low, layout.high, strict=True
            )
        ],
        "reward": [{"term": term} for term in step.terms],
        "options": [
            {"option": f.name, "default": getattr(scenario, f.name)}
            for f in dataclasses.fields(scenario)
        ],
    }

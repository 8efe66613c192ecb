"""Export of the control step of scenarios as code for another machine."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from marl_airhockey.build import build_world
from marl_airhockey.sim.backends.numba.backend import NumbaBackend
from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.jit.fused import Fused, Sink, Source
from marl_airhockey.sim.jit.targets import (
    TARGETS,
    UNOPTIMISED,
    check_target,
    linked,
    object_code,
    text_of,
)
from marl_airhockey.sim.world.actions import Elimination
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.sim.world.layout import Extra, Layout, layout_of
from marl_airhockey.sim.world.world import World
from marl_airhockey.toolkit.serves import ServingScenario, serve_stage
from marl_airhockey.toolkit.starts import SPIN
from marl_airhockey.types import Memory

SEED = 0
"""Seed of the episode in the image."""


class ExportedGame(NamedTuple):
    """Arrays of one scenario."""

    facts: dict[str, Any]
    """Description, see `docs/same_results.md`."""
    image: bytes
    """Arrays at the start of the episode with the seed `SEED`."""


class ExportedCode(NamedTuple):
    """Code of several scenarios, which share functions."""

    code: bytes
    games: dict[str, ExportedGame]
    """Games by scenario."""


def export_code(scenario: str, target: str, out: Path, keywords: Keywords) -> Path:
    """Write the compiled control step of one world as code for another machine.

    The folder contains the code, the image of the arrays (``NAME.bin``), and a
    description (``NAME.json``). `docs/same_results.md` explains them.

    Args:
        scenario: Name of a scenario.
        target: Name of a target, see `targets.TARGETS`.
        out: Folder, which is created.
        keywords: Keywords of the world. All seats are open.

    Returns:
        Path of the description.

    Raises:
        ValueError: The target is unknown, or the control step is not compiled.
        ModuleNotFoundError: The linker for WebAssembly is not installed.
    """
    code, games = exported([scenario], target, keywords)
    facts, image = games[scenario]
    out.mkdir(parents=True, exist_ok=True)
    name = f"{scenario}{TARGETS[target].suffix}"
    (out / name).write_bytes(code)
    (out / f"{scenario}.bin").write_bytes(image)
    path = out / f"{scenario}.json"
    files = {"scenario": scenario, "code": name, "image": f"{scenario}.bin"}
    path.write_text(json.dumps({**files, **facts}) + "\n")
    return path


def exported(
    scenarios: Sequence[str], target: str, keywords: Keywords, starts: int = 1
) -> ExportedCode:
    """Return the compiled control steps of one world of each scenario.

    Args:
        scenarios: Names of scenarios.
        target: Name of a target, see `targets.TARGETS`.
        keywords: Keywords of the worlds. All seats are open.
        starts: Number of episodes whose starts are included, with seeds from `SEED`.

    Raises:
        ValueError: The target is unknown, or a control step is not compiled.
        ModuleNotFoundError: The linker for WebAssembly is not installed.
    """
    check_target(target)
    texts, games = translated(scenarios, keywords, starts)
    code = object_code(texts, target)
    if target == "wasm32":
        code = linked(code, list(texts))
    return ExportedCode(code, games)


def translated(
    scenarios: Sequence[str], keywords: Keywords, starts: int = 1
) -> tuple[dict[str, str], dict[str, ExportedGame]]:
    """Return the LLVM texts of the functions of scenarios, and their arrays, by name.

    The arguments are those of `exported`.

    Raises:
        ValueError: A control step is not compiled.
    """
    for scenario in scenarios:
        check_exported(build_world(scenario, 1, False, keywords))
    given = list(scenarios), keywords, starts
    program = f"from {__name__} import _write; _write(*{given!r})"
    own = {"MARL_AIRHOCKEY_CACHE": "code", "PYTHONPATH": os.pathsep.join(sys.path)}
    variables = {**os.environ, **UNOPTIMISED, **own}
    with tempfile.TemporaryDirectory() as name:
        # A process of its own compiles without optimisation.
        words = [sys.executable, "-c", program]
        subprocess.run(words, check=True, cwd=name, env=variables)
        folder = Path(name)
        texts = {path.stem: path.read_text() for path in sorted(folder.glob("*.ll"))}
        games = {
            scenario: ExportedGame(
                json.loads((folder / f"{scenario}.json").read_text()),
                (folder / f"{scenario}.bin").read_bytes(),
            )
            for scenario in scenarios
        }
    return texts, games


def check_exported(world: World) -> None:
    """Check that the control step of a world is all in the exported code.

    Raises:
        ValueError: The scenario has regions with drag.
    """
    if world.scenario.drag_regions:
        raise ValueError(
            "drag_regions: the compiled control step does not include them; leave the "
            "option out"
        )


def _write(scenarios: Sequence[str], keywords: Keywords, starts: int) -> None:
    """Write the files that `exported` reads into the current folder."""
    names: dict[int, str] = {}
    for scenario in scenarios:
        world = build_world(scenario, 1, False, keywords)
        world.reset(seed=SEED)
        extras = list(_extras(world))
        layout = layout_of(world, extras)
        for part in layout.parts:
            if id(part.kernel) not in names:
                name = names[id(part.kernel)] = f"part_{len(names)}"
                Path(f"{name}.ll").write_text(text_of(part.kernel))
        functions = [names[id(part.kernel)] for part in layout.parts]
        facts = _facts(world, layout, functions)
        facts["starts"] = _starts(world, layout.image, extras, starts)
        Path(f"{scenario}.bin").write_bytes(layout.image)
        Path(f"{scenario}.json").write_text(json.dumps(facts))


def _facts(world: World, layout: Layout, functions: list[str]) -> dict[str, Any]:
    """Return the description of a world, except for its starts."""
    scenario, (state, memory) = world.scenario, world.get_state()
    scene = scenario.scene
    return {
        "functions": list(dict.fromkeys(functions)),
        "calls": {
            name: [
                {"function": functions[c.part], "table": c.table, "length": c.length}
                for c in calls
            ]
            for name, calls in layout.calls.items()
        },
        "offsets": layout.offsets,
        "arrays": layout.arrays,
        "observation": list(world.observation_labels),
        "reaction": round(world.observer.reaction / world.control_dt),
        "control_dt": world.control_dt,
        "max_cycles": world.max_cycles,
        "spin": SPIN,
        "shown": [
            name.removeprefix("show_0.")
            for name in layout.arrays
            if name.startswith("show_0.")
        ],
        "marks": [(m.kind, m.means) for m in scenario.all_marks(state, memory)],
        "caption": scenario.caption(memory).text,
        "deciders": list(scenario.deciders(memory)),
        "elimination": _elimination(scenario, memory),
        "bodies": {
            "pucks": [scene.bodies.puck.start, scene.bodies.puck.stop],
            "blocks": [scene.bodies.block.start, scene.bodies.block.stop],
        },
    }


def _elimination(scenario: Scenario, memory: Memory) -> dict[str, Any] | None:
    """Return where eliminated paddles are; None if no seat is ever eliminated."""
    if scenario.eliminated(memory) is None:
        return None
    found = Elimination(scenario.scene)
    return {"parking": found.parking.tolist(), "owner": found.owner.tolist()}


def _starts(
    world: World, image: bytes, extras: list[Extra], count: int
) -> dict[str, Any]:
    """Return the 64-bit words of the image that differ between starts.

    ``words`` are their indices, and ``values`` their values as hexadecimal digits, one
    text for each seed.
    """
    images = []
    for k in range(count):
        world.reset(seed=SEED + k)
        images.append(layout_of(world, extras).image)
    rows = np.array([np.frombuffer(one, np.uint64) for one in images])
    words = np.flatnonzero((rows != np.frombuffer(image, np.uint64)).any(0))
    return {
        "words": words.tolist(),
        "values": [row[words].tobytes().hex() for row in rows],
    }


def _extras(world: World) -> Iterator[Extra]:
    """Yield the observation, the display and, in games, the functions of a serve."""
    step, observer = world.control_step, world.observer
    # The current moment is moment 0.
    moments = step.now, step.moments[1 - step.current]
    if world.sensor.ideal and not observer.images:
        state = step.now.state, step.now.verdict.memory
        yield Extra("observe", *observer.detached(*state, observer.observe))
    show = Fused(partial(_shown, world), f"display of {world.scenario.name}")
    for n, moment in enumerate(moments):
        sources = vars(moment.state), moment.verdict.memory
        (shown,) = show.prepare(*sources)
        if shown:
            yield Extra(f"show_{n}", show.stage(sources, (shown,)), shown)
    if not world.serves or not isinstance(world.backend, NumbaBackend):
        return
    units = {"unit": np.zeros((1, 2))}
    yield Extra("draw", world.serve_stream.stage(units["unit"]), units)
    for n, moment in enumerate(moments):
        for puck in range(world.scene.pucks):
            serve = serve_stage(world.scene, moment.state, puck)
            yield Extra(f"serve_{n}_{puck}", *serve)
        yield Extra(f"place_{n}", world.backend.serve_stage(moment.state), {})


def _shown(world: World, state: Source, memory: Source) -> tuple[Sink, ...]:
    """Return the display, and the headings of serves."""
    scenario = world.scenario
    shown = scenario.display_arrays(State(**state), dict(memory))
    if isinstance(scenario, ServingScenario):
        shown["headings"] = scenario.headings(dict(memory))
    return (shown,)

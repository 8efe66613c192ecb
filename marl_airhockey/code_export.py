"""Export of the control step of a scenario as code for another machine."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.build import build_world
from marl_airhockey.sim.backends.numba.backend import NumbaBackend
from marl_airhockey.sim.jit.targets import (
    TARGETS,
    UNOPTIMISED,
    check_target,
    linked,
    object_code,
    text_of,
)
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.sim.world.layout import Extra, layout_of
from marl_airhockey.sim.world.world import World
from marl_airhockey.toolkit.serves import serve_stage
from marl_airhockey.toolkit.starts import SPIN

SEED = 0
"""Seed of the episode in the image."""


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
    check_target(target)
    with tempfile.TemporaryDirectory() as folder:
        texts, facts, image = _translated(scenario, keywords, Path(folder))
    code = object_code(texts, target)
    if target == "wasm32":
        code = linked(code, list(texts))
    out.mkdir(parents=True, exist_ok=True)
    name = f"{scenario}{TARGETS[target].suffix}"
    (out / name).write_bytes(code)
    (out / f"{scenario}.bin").write_bytes(image)
    path = out / f"{scenario}.json"
    files = {"scenario": scenario, "code": name, "image": f"{scenario}.bin"}
    path.write_text(json.dumps({**files, **facts}) + "\n")
    return path


def _translated(
    scenario: str, keywords: Keywords, folder: Path
) -> tuple[dict[str, str], dict[str, Any], bytes]:
    """Compile in a process without optimisation; return texts, facts and image."""
    program = f"from {__name__} import _write; _write({scenario!r}, {keywords!r}, '.')"
    own = {"MARL_AIRHOCKEY_CACHE": "code", "PYTHONPATH": os.pathsep.join(sys.path)}
    variables = {**os.environ, **UNOPTIMISED, **own}
    words = [sys.executable, "-c", program]
    subprocess.run(words, check=True, cwd=folder, env=variables)
    facts = json.loads((folder / "facts.json").read_text())
    texts = {name: (folder / f"{name}.ll").read_text() for name in facts["functions"]}
    return texts, facts, (folder / "image").read_bytes()


def _write(scenario: str, keywords: Keywords, folder: str) -> None:
    """Write the files that `_translated` reads."""
    world = build_world(scenario, 1, False, keywords)
    world.reset(seed=SEED)
    layout = layout_of(world, list(_extras(world)))
    names = [f"part_{k}" for k in range(len(layout.parts))]
    for name, part in zip(names, layout.parts, strict=True):
        Path(folder, f"{name}.ll").write_text(text_of(part.kernel))
    facts = {
        "functions": names,
        "calls": {
            name: [
                {"function": names[c.part], "table": c.table, "length": c.length}
                for c in calls
            ]
            for name, calls in layout.calls.items()
        },
        "offsets": layout.offsets,
        "arrays": layout.arrays,
        "observation": list(world.observation_labels),
        "reaction": round(world.observer.reaction / world.control_dt),
        "control_dt": world.control_dt,
        "spin": SPIN,
    }
    Path(folder, "image").write_bytes(layout.image)
    Path(folder, "facts.json").write_text(json.dumps(facts))


def _extras(world: World) -> Iterator[Extra]:
    """Yield the observation and, in games, the functions of a serve."""
    step, observer = world.control_step, world.observer
    if world.sensor.ideal:
        state = step.now.state, step.now.verdict.memory
        yield Extra("observe", *observer.detached(*state, observer.observe))
    if not world.serves or not isinstance(world.backend, NumbaBackend):
        return
    units = {"unit": np.zeros((1, 2))}
    yield Extra("draw", world.serve_stream.stage(units["unit"]), units)
    # The current moment is moment 0.
    for n, moment in enumerate((step.now, step.moments[1 - step.current])):
        for puck in range(world.scene.pucks):
            serve = serve_stage(world.scene, moment.state, puck)
            yield Extra(f"serve_{n}_{puck}", *serve)
        yield Extra(f"place_{n}", world.backend.serve_stage(moment.state), {})

"""Exported code: the same bits in another machine's code as in Python."""

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers.modules import modules

import marl_airhockey as ah
from marl_airhockey.build import build_world
from marl_airhockey.code_export import export_code, exported
from marl_airhockey.registry import scenario_names
from marl_airhockey.sim.jit import targets
from marl_airhockey.sim.world.layout import layout_of
from marl_airhockey.toolkit import ServingScenario

NODE, QEMU = shutil.which("node"), shutil.which("qemu-aarch64")
RUNNER = Path(__file__).parent / "helpers" / "run_code.mjs"
SMALL = """
import sys
from marl_airhockey.sim.jit.codegen import load
from marl_airhockey.sim.jit.elementary import cos
from marl_airhockey.sim.jit.targets import text_of
SOURCE = '''
import math
import numpy as np
from numba import carray
from marl_airhockey.sim.jit.elementary import cos
from marl_airhockey.sim.jit.pipeline import pointer
SIGNATURE = "boolean(int64[::1], int64)"
def kernel(where, n):
    x = carray(pointer(where[0]), (n,), np.float64)
    for i in range(n):
        x[i] = FUNCTION(x[i]) * x[i] + 1.0
    return True
'''
print(text_of(load(SOURCE.replace("FUNCTION", sys.argv[1]), "a test").kernel))
"""


def small(function, cache):
    """LLVM text of a small pipeline that calls a function."""
    own = {"MARL_AIRHOCKEY_CACHE": str(cache)}
    variables = {**os.environ, **targets.UNOPTIMISED, **own}
    words = [sys.executable, "-c", SMALL, function]
    return subprocess.run(
        words, env=variables, check=True, capture_output=True, text=True
    ).stdout


def test_products_are_fused_with_sums_on_no_machine(tmp_path):
    parts = {"part": small("cos", tmp_path)}
    for target in targets.TARGETS:
        machine = targets.machine_of(target)
        text = machine.emit_assembly(targets.optimised(parts, target, machine))
        assert re.search(r"\bmulsd\b|\bfmul\b|\bf64\.mul\b", text), target
        assert not re.search(r"\bv?fn?m(add|sub|la|ls)\w*\b", text), target


def test_code_that_calls_the_c_library_is_an_error_that_names_the_function(tmp_path):
    parts = {"part": small("math.tan", tmp_path)}
    with pytest.raises(ValueError, match="tan: this code calls functions of the C"):
        targets.object_code(parts, "wasm32")


def test_an_unknown_target_is_an_error_that_names_all(tmp_path):
    with pytest.raises(ValueError, match="'riscv' is unknown; there are wasm32, aarch"):
        export_code("duel", "riscv", tmp_path, {})


@pytest.mark.parametrize(
    ("keywords", "worlds", "words"),
    [({}, 2, "has one world"), ({"backend": "pymunk"}, 1, "is not compiled")],
)
def test_a_layout_needs_one_compiled_world(keywords, worlds, words):
    world = ah.make_world("juggle", worlds, **keywords)
    world.reset(seed=0)
    with pytest.raises(ValueError, match=words):
        layout_of(world)


def run(path, actions, tmp_path):
    """Hash and number of serves of exported code in Node."""
    (tmp_path / "actions").write_bytes(actions.tobytes())
    words = [NODE, RUNNER, modules(tmp_path), path, tmp_path / "actions"]
    done = subprocess.run(words, check=True, capture_output=True, text=True)
    found = json.loads(done.stdout)
    return found["hash"], found["served"], found["eliminated"]


def played(world, steps, names):
    """Results as of `run`, and the actions after their latency.

    Args:
        world: One world.
        steps: Number of steps.
        names: Names of the arrays of the display.
    """
    digest, given, served, most = hashlib.sha256(), [], 0, 0
    rng = np.random.default_rng(0)
    seats = np.arange(len(world.scene.seats))
    for _ in range(steps):
        world.step(rng.uniform(-1.0, 1.0, (1, len(world.open), 2)))
        now = world.control_step.now
        served += int(now.verdict.outcome.get("serves", np.zeros(1)).any())
        given.append(world.action)
        state = now.state
        for array in (state.position, state.velocity, state.angle, state.spin):
            digest.update(array.tobytes())
        digest.update(now.verdict.outcome["reward"].tobytes())
        if world.sensor.ideal:
            digest.update(world.observe(seats).tobytes())
        shown = world.scenario.display_arrays(state, world.memory)
        if isinstance(world.scenario, ServingScenario):
            shown["headings"] = world.scenario.headings(world.memory)
        for name in names:
            digest.update(shown[name].tobytes())
        most = max(most, int(shown.get("eliminated", np.zeros(1)).sum()))
    return (digest.hexdigest(), served, most), np.array(given)


LONG = {"max_cycles": 12_000, "options": {"goals_to_win": 1000}}
POLICIES = {"paddle_0": "zoo/duel", "paddle_1": "zoo/duel_3"}


@pytest.mark.slow
@pytest.mark.skipif(NODE is None, reason="there is no Node")
@pytest.mark.parametrize(
    ("name", "keywords", "drivers", "steps"),
    [
        ("duel", LONG, POLICIES, 10_000),
        ("duel", {**LONG, "options": {"pucks": 2, "goals_to_win": 1000}}, {}, 3000),
        ("free_for_all", {"max_cycles": 6000}, {}, 6000),
        ("hit_goal_velocity", {"profile": "ur5e"}, {}, 3000),
    ],
)
def test_webassembly_computes_the_bits_of_python(
    name, keywords, drivers, steps, tmp_path
):
    pytest.importorskip("ziglang")
    path = export_code(name, "wasm32", tmp_path, keywords)
    world = build_world(name, 1, False, {**keywords, "drivers": drivers})
    world.reset(seed=0)
    found, given = played(world, steps, json.loads(path.read_text())["shown"])
    assert found[1] > 10 or name != "duel"
    assert found[2] > 1 or name != "free_for_all"
    assert run(path, given, tmp_path) == found
    given[10] *= 0.5
    assert run(path, given, tmp_path)[0] != found[0]


@pytest.fixture(scope="module")
def all_games(tmp_path_factory):
    """Folder with one module for all scenarios, and the paths of descriptions."""
    pytest.importorskip("ziglang")
    folder, names = tmp_path_factory.mktemp("all"), scenario_names()
    code, games = exported(names, "wasm32", {"max_cycles": 2000})
    (folder / "all.wasm").write_bytes(code)
    for name, game in games.items():
        (folder / f"{name}.bin").write_bytes(game.image)
        files = {"code": "all.wasm", "image": f"{name}.bin"}
        (folder / f"{name}.json").write_text(json.dumps({**files, **game.facts}))
    return folder


@pytest.mark.slow
@pytest.mark.skipif(NODE is None, reason="there is no Node")
@pytest.mark.parametrize("name", scenario_names())
def test_every_scenario_has_the_bits_of_python_in_one_module(name, all_games, tmp_path):
    path = all_games / f"{name}.json"
    world = build_world(name, 1, False, {"max_cycles": 2000})
    world.reset(seed=0)
    found, given = played(world, 2000, json.loads(path.read_text())["shown"])
    assert run(path, given, tmp_path) == found


def header(facts):
    """C text with the facts of a description, for run_code.c."""

    def array(name):
        found = facts["arrays"][name]
        bytes_ = int(np.prod(found["shape"])) * np.dtype(found["dtype"]).itemsize
        return f"{{{found['offset']}, {bytes_}}}"

    def calls(name):
        rows = (f"{{{c['function']}, {c['table']}, {c['length']}}}" for c in name)
        return "{" + ", ".join(rows) + "}"

    shown = [f"state.{n}" for n in ("position", "velocity", "angle", "spin")]
    shown.append("verdict.outcome.reward")
    steps = facts["calls"]["step_0"], facts["calls"]["step_1"]
    offsets = ", ".join(map(str, facts["offsets"]))
    lines = [f"function {name};" for name in facts["functions"]]
    lines += [
        f"static const int64_t OFFSETS[] = {{{offsets}}};",
        f"static const array ACTION = {array('inputs.action')};",
        f"enum {{ CALLS = {len(steps[0])}, SHOWN = {len(shown)} }};",
    ]
    for k, step in enumerate(steps):
        arrays = ", ".join(array(f"moment_{k}.{name}") for name in shown)
        lines.append(f"static const call STEP_{k}[] = {calls(step)};")
        lines.append(f"static const array SHOWN_{k}[] = {{{arrays}}};")
    return "\n".join(lines) + "\n"


@pytest.mark.slow
@pytest.mark.skipif(QEMU is None, reason="there is no emulator of aarch64")
def test_aarch64_computes_the_bits_of_python(tmp_path):
    pytest.importorskip("ziglang")
    keywords = {"profile": "ur5e"}
    path = export_code("hit_goal_velocity", "aarch64", tmp_path, keywords)
    facts = json.loads(path.read_text())
    (tmp_path / "facts.h").write_text(header(facts))
    program, code = tmp_path / "run", tmp_path / facts["code"]
    words = ["-m", "ziglang", "cc", "-target", "aarch64-linux-musl", "-static"]
    sources = [RUNNER.with_suffix(".c"), code, "-I", tmp_path, "-o", program]
    subprocess.run([sys.executable, *words, *sources], check=True)
    world = build_world("hit_goal_velocity", 1, False, keywords)
    world.reset(seed=0)
    (wanted, _, _), given = played(world, 3000, [])
    (tmp_path / "actions").write_bytes(given.tobytes())
    words = [QEMU, program, tmp_path / facts["image"], tmp_path / "actions"]
    done = subprocess.run(words, check=True, capture_output=True)
    assert hashlib.sha256(done.stdout).hexdigest() == wanted

"""Rules of the code that no linter knows; `lint-imports` keeps the layers."""

import ast
import importlib.util
import re
import subprocess
import sys
import tokenize
from collections import Counter
from itertools import pairwise
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "marl_airhockey"
LEAVES = [PACKAGE.parent / folder for folder in ("scenarios", "drivers")]
SOURCES = [path for folder in (PACKAGE, *LEAVES) for path in folder.rglob("*.py")]
LOWER_PACKAGES = (
    *("types", "toolkit"),
    *(f"sim/{name}" for name in ("jit", "core", "contracts", "sensing")),
)
EXTRAS = [
    "torch",
    "stable_baselines3",
    "cv2",
    "pymunk",
    "gymnasium",
    "pettingzoo",
    "PIL",
    "typer",
    "rich",
    "pygame",
    "matplotlib",
    "onnxruntime",
    "mujoco",
    "robosuite",
]
MOST_LINES = 300
LONG = {
    "sim/backends/numba/event_loop.py": "one loop, whose phases numba inlines",
    "sim/backends/pymunk/space.py": "one space with the callbacks of its collisions",
    "sim/contracts/scenario.py": "a contract with the methods that all scenarios share",
    "toolkit/observables.py": "twelve observables of some 25 lines each",
    "sim/world/world.py": "one class, which all environments are views of",
}
"""Reasons of the files that are longer"""
INEXACT = {
    *("sin", "cos", "tan", "arcsin", "arccos", "arctan", "arctan2", "atan2", "tanh"),
    *("exp", "exp2", "expm1", "log", "log1p", "log2", "log10", "hypot", "cbrt"),
    *("power", "float_power", "pow", "linalg", "dot", "vdot", "inner", "einsum"),
    *("interp", "convolve", "tensordot", "matmul"),
}
"""Functions of NumPy and math that `sim.jit.elementary` and `geometry` replace"""
OTHER_RESULTS = (
    *("marl_airhockey/sim/render/", "marl_airhockey/sim/backends/robosuite/"),
    *("marl_airhockey/sim/backends/pymunk/", "marl_airhockey/sim/jit/elementary.py"),
    *("marl_airhockey/sim/jit/tracer.py", "marl_airhockey/sim/core/geometry.py"),
)
"""Files without claims to equal bits, and those that define such functions"""
PRIVATE_WORDS = {"told", "shut", "turn", "turns", "turned", "court", "ledger", "chain"}


def modules(path):
    """Modules of this package that a file imports, inside functions too."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom):
            yield node.module or ""
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names)


def test_scenarios_and_drivers_import_the_toolkit_alone():
    # A driver that owns a device imports that, too.
    may = {"scenarios": ("toolkit",), "drivers": ("toolkit", "hardware")}
    for path in (path for folder in LEAVES for path in folder.glob("*.py")):
        allowed = tuple(f"marl_airhockey.{name}" for name in may[path.parent.name])
        for module in modules(path):
            if module.startswith("marl_airhockey"):
                assert module.startswith(allowed), f"{path}: {module}"


@pytest.mark.parametrize("package", LOWER_PACKAGES)
def test_lower_packages_import_with_extras_blocked(package):
    found = sorted((PACKAGE / package).rglob("*.py")) or [PACKAGE / f"{package}.py"]
    names = [
        ".".join(path.relative_to(PACKAGE).with_suffix("").parts) for path in found
    ]
    program = (
        "import importlib, sys, types\n"
        f"for name in {EXTRAS!r}: sys.modules[name] = None\n"
        "package = types.ModuleType('marl_airhockey')\n"
        f"package.__path__ = [{str(PACKAGE)!r}]\n"
        "sys.modules['marl_airhockey'] = package\n"
        f"for name in {names!r}: importlib.import_module(f'marl_airhockey.{{name}}')\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True)
    assert done.returncode == 0, done.stderr.decode()


def test_nothing_uses_a_global_random_generator():
    banned = ("np.random.seed", "np.random.rand", "import random\n")
    texts = {path: path.read_text() for path in SOURCES}
    found = [f"{p}: {word}" for p, t in texts.items() for word in banned if word in t]
    assert not found


def depends_on_the_machine(node):
    """True for an operation whose last bits depend on the processor or the system."""
    if isinstance(node, ast.BinOp):
        return isinstance(node.op, ast.MatMult)
    named = isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name)
    return named and node.value.id in ("np", "math") and node.attr in INEXACT


def test_simulation_and_rules_use_operations_with_the_same_bits_everywhere():
    folders = [PACKAGE / "sim", PACKAGE / "toolkit", *LEAVES]
    for path in (path for folder in folders for path in folder.rglob("*.py")):
        inside = str(path.relative_to(PACKAGE.parent))
        if not inside.startswith(OTHER_RESULTS):
            for node in ast.walk(ast.parse(path.read_text())):
                assert not depends_on_the_machine(node), f"{path}: {ast.unparse(node)}"


def own_names(path):
    """Names in a file, without the constants of libraries that name their own."""
    with path.open("rb") as file:
        names = [t.string for t in tokenize.tokenize(file.readline) if t.type == 1]
    return {b for a, b in pairwise(["", *names]) if a not in ("cv2", "socket")}


def test_names_use_standard_words():
    found = [
        f"{path}: {name}"
        for path in SOURCES
        for name in own_names(path)
        if PRIVATE_WORDS & set(re.split("_+", name.lower()))
    ]
    assert not found


def test_no_class_name_exists_twice():
    names = Counter(
        node.name
        for path in PACKAGE.rglob("*.py")
        if path.parent.name != "templates"
        for node in ast.parse(path.read_text()).body
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_")
    )
    assert [name for name, count in names.items() if count > 1] == []


def test_every_fault_of_check_mutations_can_be_made():
    path = PACKAGE.parent / "scripts" / "check_mutations.py"
    spec = importlib.util.spec_from_file_location(path.stem, path)
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    assert len(script.FAULTS) > 20
    assert script.faults_of(script.FAULTS) == []
    gone = script.FAULTS[0]._replace(old="no such text", tests="no_such_test.py")
    assert len(script.faults_of([gone])) == 2


def test_files_are_short_or_have_a_reason():
    found = {
        str(path.relative_to(PACKAGE))
        for path in PACKAGE.rglob("*.py")
        if len(path.read_text().splitlines()) > MOST_LINES
    }
    assert found == set(LONG)

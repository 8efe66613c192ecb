"""Imports only go down, and the lower layers need nothing but numpy and numba."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "marl_airhockey"
LAYERS = (
    {"state", "draws", "table"},
    {"physics", "scene", "rewards", "views", "starts", "shots", "limits"}
    | {"paddles", "rails", "scenario", "driver", "backend", "extras", "layout"}
    | {
        "symbols",
        "pool",
        "stats",
        "frozen",
        "versus",
        "tactics",
        "loops",
        "chain",
        "fuse",
        "threads",
        "handicap",
    },
    {
        "backends",
        "chipmunk",
        "space",
        "batch",
        "discs",
        "coast",
        "kernel",
        "arm",
        "registry",
        "registration",
    },
    {"sensor", "observer", "seats", "roster", "canvas", "pixels", "render", "window"}
    | {"episode", "referee", "turn", "world"},
    {"make", "spaces", "parallel", "single", "vector", "vector_sb3"},
    {
        "charts",
        "match",
        "contest",
        "league",
        "bench",
        "film",
        "catalogue",
        "learn",
        "cli",
        "cli_common",
        "cli_games",
        "cli_play",
        "play",
        "cli_study",
        "cli_transfer",
        "transfer",
        "fit",
        "study",
    },
)
PURE = sorted(LAYERS[0] | LAYERS[1])
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
]


def layer(module):
    return next(i for i, names in enumerate(LAYERS) if module in names)


def imports(path):
    """Modules of this package that a file imports at its top level, with type hints."""
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(
            "marl_airhockey."
        ):
            yield node.module.split(".")[1]


def test_every_module_has_its_layer_and_imports_go_down():
    for path in PACKAGE.rglob("*.py"):
        parts = path.relative_to(PACKAGE).parts
        name = parts[0].removesuffix(".py")
        if name == "__init__":
            continue
        for other in imports(path):
            assert layer(other) <= layer(name), f"{path} imports {other}"


def test_leaves_import_only_the_core():
    for folder in ("scenarios", "agents"):
        for path in (PACKAGE.parent / folder).glob("*.py"):
            for other in imports(path):
                allowed = layer(other) <= 1 or (folder, other) == ("agents", "learn")
                assert allowed, f"{path} imports {other}"


@pytest.mark.parametrize("module", PURE)
def test_lower_layers_import_with_extras_blocked(module):
    program = (
        "import sys, types\n"
        f"for name in {EXTRAS!r}: sys.modules[name] = None\n"
        "package = types.ModuleType('marl_airhockey')\n"
        f"package.__path__ = [{str(PACKAGE)!r}]\n"
        "sys.modules['marl_airhockey'] = package\n"
        f"import marl_airhockey.{module}\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True)
    assert done.returncode == 0, done.stderr.decode()


def test_nothing_uses_a_global_random_generator():
    for path in [*PACKAGE.rglob("*.py"), *PACKAGE.parent.glob("[sa]*s/*.py")]:
        text = path.read_text()
        for word in ("np.random.seed", "np.random.rand", "import random\n"):
            assert word not in text, path

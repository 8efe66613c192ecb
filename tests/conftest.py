import importlib.util
import os
import shutil
from typing import ClassVar

import pytest
from names import GOALS, ideal_backends, seats

import marl_airhockey as ah
from marl_airhockey.registry import plain_agent_names

os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
os.environ.setdefault("MUJOCO_GL", "egl")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")


def pytest_addoption(parser):
    parser.addoption("--only", help="Run the tests of this scenario or driver alone.")


def pytest_collection_modifyitems(config, items):
    """With --only, keep what was made for that name."""
    name = config.getoption("--only")
    if name is None:
        return
    kept = [i for i in items if name in getattr(i, "callspec", _Plain).params.values()]
    if not kept:
        raise pytest.UsageError(f"--only {name}: no test is made for this name")
    items[:] = kept


LARGE = ("doubles", "free_for_all")
"""Games that take several times as long to compile as all else"""


class _Plain:
    """Parameters of a test that has none."""

    params: ClassVar[dict] = {}


def pytest_generate_tests(metafunc):
    """Every test that asks for a scenario, backend or agent gets all there are."""
    found = {
        "scenario": ah.scenario_names,
        "single": lambda: [n for n in ah.scenario_names() if seats(n) == 1],
        "backend": ideal_backends,
        "agent": plain_agent_names,
        "goal_scenario": lambda: GOALS,
    }
    for name, names in found.items():
        if name in metafunc.fixturenames:
            given = names()
            if metafunc.definition.get_closest_marker("compiles_much"):
                large = [pytest.param(n, marks=pytest.mark.slow) for n in LARGE]
                given = [n for n in given if n not in LARGE] + large
            metafunc.parametrize(name, given)


@pytest.fixture(scope="session", autouse=True)
def _one_thread():
    if importlib.util.find_spec("torch"):
        import torch

        torch.set_num_threads(1)


@pytest.fixture(scope="session")
def touch_run(tmp_path_factory):
    """The folder of a run that has learned to touch the puck."""
    from runs import SMALL

    from marl_airhockey.learn.config import preset
    from marl_airhockey.learn.train import train

    folder = tmp_path_factory.mktemp("run") / "touch-0"
    seen = []
    train(
        preset("touch", {**SMALL, "total_steps": 98_304}),
        folder,
        lambda done, total, row: seen.append((done, total)),
    )
    assert seen[-1][0] <= seen[-1][1]
    return folder


@pytest.fixture(scope="module")
def browser():
    playwright = pytest.importorskip("playwright.sync_api")
    if CHROMIUM is None:
        pytest.skip("no Chromium here: apt-get install chromium")
    with playwright.sync_playwright() as started:
        found = started.chromium.launch(
            executable_path=CHROMIUM,
            args=["--no-sandbox", "--disable-gpu", "--disable-background-networking"],
        )
        yield found
        found.close()


@pytest.fixture(scope="session")
def sb3_run(tmp_path_factory):
    """The folder of a short run of the engine sb3."""
    from runs import SMALL

    from marl_airhockey.learn.config import preset
    from marl_airhockey.learn.train import train

    folder = tmp_path_factory.mktemp("sb3") / "touch-0"
    train(preset("touch", {**SMALL, "engine": "sb3"}), folder)
    return folder

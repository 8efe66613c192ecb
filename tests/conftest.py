import importlib.util
import os
import random
import shutil
from itertools import product
from typing import ClassVar

import costs
import pytest
from names import GOALS, ideal_backends, seats
from xdist.scheduler import LoadScopeScheduling

import marl_airhockey as ah
from marl_airhockey.registry import driver_class

os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
os.environ.setdefault("MUJOCO_GL", "egl")
TOGETHER = ("lab/", "play/test_page.py")
"""Folder and file whose tests one worker runs: they share an arm, or a browser"""
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")


def pytest_addoption(parser):
    parser.addoption("--only", help="Run the tests of this scenario or driver alone.")
    parser.addoption("--shuffle", type=int, help="Run in a random order, by a seed.")
    parser.addoption("--costs", help="File for the CPU-seconds of every test.")
    parser.addoption(
        "--closing", action="store_true", help="Sum up the run before this one, too."
    )


def pytest_configure(config):
    """Measure tests where they run, and sum up where they are reported."""
    config.pluginmanager.register(costs.Measure())
    if not hasattr(config, "workerinput"):
        config.pluginmanager.register(costs.Summary(config))


def pytest_collection_modifyitems(config, items):
    """With --shuffle, change the order; with --only, keep the tests of that name."""
    if (seed := config.getoption("--shuffle")) is not None:
        random.Random(seed).shuffle(items)
    name = config.getoption("--only")
    if name is None:
        return
    kept = [i for i in items if name in getattr(i, "callspec", _Plain).params.values()]
    if not kept:
        raise pytest.UsageError(f"--only {name}: no test is made for this name")
    items[:] = kept


KINDS = ("juggle", "move_block", "team_juggle", "free_for_all")
"""One scenario of each kind: a puck, a block, a team, a polygon"""


class _Plain:
    """Parameters of a test that has none."""

    params: ClassVar[dict] = {}


def _short(scenario, backend="numba", agent="sticky"):
    """True for the part of all combinations that the short run plays."""
    return scenario in KINDS or (backend == "numba" and agent == "sticky")


def pytest_generate_tests(metafunc):
    """Every test that asks for a scenario, backend or agent gets all there are.

    Of combinations with a scenario, the short run plays a part.
    """
    found = {
        "scenario": ah.scenario_names,
        "single": lambda: [n for n in ah.scenario_names() if seats(n) == 1],
        "backend": ideal_backends,
        "agent": lambda: [
            n for n in ah.driver_names() if not driver_class(n).needs_device
        ],
        "goal_scenario": lambda: GOALS,
    }
    names = [name for name in found if name in metafunc.fixturenames]
    rows = []
    for row in product(*(found[name]() for name in names)):
        chosen = dict(zip(names, row, strict=True))
        short = "scenario" not in chosen or _short(**chosen)
        rows.append(pytest.param(*row, marks=() if short else pytest.mark.slow))
    if names:
        metafunc.parametrize(names, rows)


class Scheduling(LoadScopeScheduling):
    """Distribution of single tests over workers, but for those of `TOGETHER`.

    As ``--dist loadgroup`` should; pytest 9.2 hides the groups from xdist 3.8.
    """

    def _split_scope(self, nodeid):
        inside = nodeid.removeprefix("tests/")
        found = [part for part in TOGETHER if inside.startswith(part)]
        return found[0] if found else nodeid


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    return Scheduling(config, log)


@pytest.fixture
def uncompiled(monkeypatch):
    """Run scenarios as plain numpy, so that scenes of all kinds need no compiling."""
    monkeypatch.setenv("MARL_AIRHOCKEY_COMPILE", "0")


@pytest.fixture(scope="session", autouse=True)
def _one_thread():
    if importlib.util.find_spec("torch"):
        import torch

        torch.set_num_threads(1)


@pytest.fixture(scope="session")
def touch_run(tmp_path_factory):
    """The folder of a run that has learned to touch the puck."""
    from runs import SMALL

    from marl_airhockey.learn.ppo_config import preset
    from marl_airhockey.learn.train import run_training

    folder = tmp_path_factory.mktemp("run") / "touch-0"
    seen = []
    run_training(
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

    from marl_airhockey.learn.ppo_config import preset
    from marl_airhockey.learn.train import run_training

    folder = tmp_path_factory.mktemp("sb3") / "touch-0"
    run_training(preset("touch", {**SMALL, "engine": "sb3"}), folder)
    return folder

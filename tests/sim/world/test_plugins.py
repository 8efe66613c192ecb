"""Scenarios and drivers from files, modules and installed packages."""

import sys

import numpy as np
import pytest

import marl_airhockey as ah
from marl_airhockey.envs.describe import summary
from marl_airhockey.play.study.plan import Opponent
from marl_airhockey.registry import find_scenario, make_driver
from marl_airhockey.scenarios.reach import Reach

DRIVER = """
from dataclasses import dataclass
import numpy as np
from marl_airhockey.toolkit import Driver

@dataclass
class Push(Driver):
    share: float = 0.5

    def act(self, view, memory):
        return np.full((len(view.observation), 2), self.share), memory
"""
TASK = '''
"""Reach, with more time."""

from dataclasses import dataclass
from marl_airhockey.scenarios.reach import Reach

@dataclass(frozen=True, kw_only=True)
class Slow(Reach):
    """Reach with more time."""

    seconds: float = 20.0
'''


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Folder where one works, with a driver and a scenario."""
    (tmp_path / "my_driver.py").write_text(DRIVER)
    (tmp_path / "my_task.py").write_text(TASK)
    (tmp_path / "broken.py").write_text("import nothing_of_this_name")
    (tmp_path / "empty.py").write_text("")
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    # Only those of this folder: numba's do not bear being imported twice.
    for name, module in list(sys.modules.items()):
        if str(getattr(module, "__file__", "")).startswith(str(tmp_path)):
            del sys.modules[name]


@pytest.mark.parametrize(
    "name", ["my_driver.py", "my_driver.py:Push", "my_driver:Push"]
)
def test_a_driver_of_a_file_or_a_module_drives(folder, name):
    world = ah.make_world("reach", 2, drivers={"paddle_0": name})
    world.reset(0)
    world.step(np.zeros((2, 0, 2)))
    assert (world.action == 0.5).all()
    assert make_driver(name, share=0.2).share == 0.2
    with pytest.raises(ValueError, match="unknown option"):
        make_driver(name, shair=0.2)


@pytest.mark.parametrize("name", ["my_task.py", "my_task.py:Slow", "my_task:Slow"])
def test_a_scenario_of_a_file_or_a_module_is_played(folder, name):
    env = ah.parallel_env(name)
    assert env.max_cycles == 400
    assert env.metadata["name"] == "my_task_v1", "the version of the base, reach"
    assert find_scenario(name, seconds=5.0).seconds == 5.0
    env.reset(seed=0)
    env.step({"paddle_0": np.zeros(2)})


def test_a_class_or_an_object_is_a_scenario():
    assert ah.parallel_env(Reach).max_cycles == 60
    assert ah.parallel_env(Reach(seconds=5.0)).max_cycles == 100


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("nowhere.py", "no such file"),
        ("broken.py", "cannot be imported: ModuleNotFoundError"),
        ("empty.py", "expected one subclass of Driver, found none"),
        ("my_driver.py:Pull", "has no 'Pull'"),
        ("stricker:weak", "unknown driver 'stricker:weak' .did you mean 'striker'"),
        ("json:dumps", "dumps cannot act in this environment"),
    ],
)
def test_a_driver_that_is_not_there_is_refused_in_words(folder, name, message):
    with pytest.raises(ValueError, match=message):
        ah.make_world("reach", 1, drivers={"paddle_0": name})


def test_code_that_is_no_scenario_is_refused(folder):
    with pytest.raises(ValueError, match="is not a scenario; expected a subclass"):
        ah.make_world("my_driver:Push")
    with pytest.raises(ValueError, match="set them in the scenario object"):
        find_scenario(Reach(), seconds=5.0)


def test_a_plan_of_a_study_runs_no_code(folder):
    for name in ("my_driver.py", "my_driver:Push", "my_driver:Push:share=1"):
        with pytest.raises(ValueError, match="cannot run Python code"):
            Opponent(name)


def test_installed_packages_add_names(folder, monkeypatch):
    info = folder / "somebody-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Name: somebody\nVersion: 1\n")
    (info / "entry_points.txt").write_text(
        "[marl_airhockey.scenarios]\nslow_reach = my_task:Slow\nlost = broken:Task\n"
        "[marl_airhockey.drivers]\npush = my_driver:Push\n"
    )
    monkeypatch.syspath_prepend(str(folder))
    assert ah.make_scenario("slow_reach").seconds == 20.0
    assert make_driver("push:share=0.25").share == 0.25
    with pytest.raises(ValueError, match=r"lost \(broken:Task\): it cannot be"):
        ah.make_scenario("lost")
    with pytest.warns(RuntimeWarning, match="lost"):
        rows = summary()
    assert "slow_reach" in [row["name"] for row in rows["scenarios"]]
    assert "push" in rows["drivers"]

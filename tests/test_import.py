"""What ``import marl_airhockey`` loads, and the names that it offers."""

import subprocess
import sys
from pathlib import Path

import cloudpickle

import marl_airhockey as ah
from marl_airhockey import discovery

MOST_MODULES = 40
HEAVY = ("cv2", "torch", "pyarrow", "matplotlib", "starlette", "numba", "pymunk")
LIST = "import json, sys; import marl_airhockey; print(json.dumps([*sys.modules]))"


def test_the_package_alone_loads_little():
    done = subprocess.run(
        [sys.executable, "-c", LIST], capture_output=True, text=True, check=True
    )
    loaded = {name.strip('[", ]\n') for name in done.stdout.split(",")}
    ours = [name for name in loaded if name.partition(".")[0] == "marl_airhockey"]
    assert 1 < len(ours) < MOST_MODULES, ours
    assert not loaded.intersection(HEAVY)


def test_every_public_name_is_there_and_no_other():
    listed = set(ah.__all__)
    assert {"parallel_env", "make_vec", "make_driver", "evaluate", "train"} <= listed
    assert sorted(listed) == dir(ah)
    for name in listed:
        assert getattr(ah, name).__name__ == name
    modules = {name for name in vars(ah) if not name.startswith("_")} - listed
    assert all(f"marl_airhockey.{name}" in sys.modules for name in modules), modules


def test_functions_that_use_the_package_can_be_sent_to_other_processes():
    """SubprocVecEnv, Ray and joblib pickle functions together with what they name."""
    assert cloudpickle.loads(cloudpickle.dumps(ah)) is ah
    # A public name that is a package's, too, would be one or the other.
    packages = {p.stem for p in Path(ah.__file__).parent.iterdir()}
    assert not packages & set(ah.__all__)


def test_versions_are_read_without_an_import_and_are_those_of_the_classes():
    versions = {name: discovery.version_of(name) for name in ah.scenario_names()}
    assert versions == {n: ah.make_scenario(n).version for n in ah.scenario_names()}
    assert set(versions.values()) == {0, 1}

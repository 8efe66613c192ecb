"""Training where tensorboard is not installed: every way names what to install."""

import importlib.util

import pytest

import marl_airhockey as ah

pytest.importorskip("stable_baselines3")


@pytest.fixture(autouse=True)
def no_tensorboard(monkeypatch):
    """Hide tensorboard."""
    find = importlib.util.find_spec

    def found(name, package=None):
        return None if name == "tensorboard" else find(name, package)

    monkeypatch.setattr(importlib.util, "find_spec", found)


@pytest.mark.parametrize(
    ("task", "changes"),
    [
        ("touch", {"engine": "torch"}),
        ("touch", {"engine": "sb3"}),
        ("reach", {"algo": "sac_her"}),
    ],
)
def test_the_command_that_installs_it_is_named(task, changes, tmp_path):
    with pytest.raises(RuntimeError, match=r"tensorboard is not.*pip install.*train"):
        ah.train(task, tmp_path / "run", total_steps=256, **changes)
    assert not (tmp_path / "run").exists()

"""Run by CI with the bare wheel, from outside the repository, and an empty cache."""

import contextlib
import sys

import gymnasium
import numpy as np

import marl_airhockey as ah
from marl_airhockey import registry
from marl_airhockey.sim.jit import folders, shipped

assert "site-packages" in ah.__file__, ah.__file__
assert len(ah.scenario_names()) >= 10
for name in ah.scenario_names():
    env = ah.parallel_env(name, render_mode="rgb_array")
    env.reset(seed=0)
    env.step({agent: np.zeros(2, np.float32) for agent in env.agents})
    assert env.render().ndim == 3
    env.close()
env = gymnasium.make("marl_airhockey/Juggle-v0")
assert env.reset(seed=0)[0].shape == env.observation_space.shape
with_a_mate = ah.parallel_env("rally", drivers={"paddle_1": "zoo/rally"})
with_a_mate.reset(seed=0)
with_a_mate.step({"paddle_0": np.zeros(2, np.float32)})
for driver in registry.independent_driver_names():
    ah.make_driver(driver)
with contextlib.suppress(RuntimeError):
    ah.make_sb3_vec("juggle")
    sys.exit("the bare wheel has no stable-baselines3, and must say so")
found = list(folders.code_folder().glob("*.code"))
if shipped.shipped().folder is None:
    print("its compiled code does not fit:", shipped.shipped().reason)
else:
    assert not found, "a wheel that holds compiled code compiles nothing"
print("the wheel works")

"""Worlds on a device: the bits of a CPU, code of a GPU, and what is refused."""

import re
import shutil
import subprocess

import numpy as np
import pytest

pytest.importorskip("torch")

import torch

import marl_airhockey as ah
from marl_airhockey.build import build_world
from marl_airhockey.code_export import translated
from marl_airhockey.device.kernel import KernelText
from marl_airhockey.device.module import kernel_module
from marl_airhockey.device.world import DeviceWorld
from marl_airhockey.learn.ppo_config import preset
from marl_airhockey.registry import scenario_names
from marl_airhockey.sim.jit.targets import GPU, machine_of

PTXAS = shutil.which("ptxas")
WORLDS, STARTS = 3, 8
GAMES = {
    "juggle": {},
    "hit_goal": {"physics": {"puck_drag": (0.01, 0.03)}},
    "duel": {"max_cycles": 150},
    "doubles": {"max_cycles": 150, "options": {"reaction": 0.0}},
    "strike_crowd": {"max_cycles": 100},
}


def same_rows(device, numpy):
    return np.array_equal(device.numpy(), numpy)


@pytest.mark.slow
@pytest.mark.parametrize("name", GAMES)
def test_worlds_have_the_bits_of_the_cpu_in_all_episodes(name):
    keywords = GAMES[name]
    world = DeviceWorld(name, WORLDS, "cpu", STARTS, keywords)
    single = [build_world(name, 1, False, keywords) for _ in range(WORLDS)]
    seats, numbers = len(single[0].open), [0] * WORLDS

    def start(k):
        return single[k].reset((k + numbers[k] * WORLDS) % STARTS)[0]

    seen, served = world.reset(), 0
    assert same_rows(seen, np.stack([start(k) for k in range(WORLDS)]))
    actions = np.random.default_rng(0)
    for _ in range(600):
        action = actions.uniform(-1, 1, (WORLDS, seats, 2))
        found = world.step(torch.from_numpy(action))
        for k, one in enumerate(single):
            result = one.step(action[k][None])
            if one.serves:
                served += int(one.control_step.now.verdict.outcome["serves"].sum())
            assert same_rows(found.reward[k], one.outcome["reward"][0])
            assert bool(found.terminated[k]) == result.terminated[0]
            assert bool(found.truncated[k]) == result.truncated[0]
            assert same_rows(found.success[k], one.episode.success[0])
            seen = result.observation[0]
            if result.terminated[0] or result.truncated[0]:
                assert same_rows(found.final_observation[k], seen)
                numbers[k] += 1
                seen = start(k)
            assert same_rows(found.observation[k], seen)
    assert min(numbers) > 0
    assert served > 0 or name not in ("duel", "doubles")
    world.check()
    action[1] = np.nan
    world.step(torch.from_numpy(action))
    with pytest.raises(ValueError, match="world 1: an action is not finite"):
        world.check()


@pytest.mark.slow
def test_every_scenario_becomes_code_of_a_gpu_without_fused_products(tmp_path):
    names = [n for n in scenario_names() if n != "free_for_all"]
    texts, games = translated(names, {})
    machine = machine_of(GPU)
    for name in names:
        module = kernel_module(KernelText(*games[name]), texts, GPU)
        code = machine.emit_assembly(module)
        assert re.search(r"\bmul\.rn\.f64\b", code)
        # ptxas fuses a product and a sum that name no rounding.
        assert not re.search(r"\b(fma|mad)\.\S*f(32|64)\b", code), name
        assert not re.search(r"\b(mul|add|sub)\.f(32|64)\b|\.approx|\.ftz", code), name
        if PTXAS:
            path = tmp_path / f"{name}.ptx"
            path.write_text(code)
            words = [PTXAS, "-arch=sm_90", str(path), "-o", str(tmp_path / "cubin")]
            subprocess.run(words, check=True)


@pytest.mark.parametrize(
    ("keywords", "named"),
    [
        ({"profile": "ur5e"}, "profile: 'ur5e'"),
        ({"backend": "pymunk"}, "backend: 'pymunk'"),
        ({"observe": "pixels"}, "observe: 'pixels'"),
        ({"goals": "dict"}, "goals: 'dict'"),
        ({"drivers": {"paddle_0": "still"}}, "drivers: "),
    ],
)
def test_what_a_device_cannot_do_is_named(keywords, named):
    with pytest.raises(ValueError, match=named):
        ah.make_world("reach", 4, "cuda", **keywords)


def test_games_that_eliminate_players_and_objects_are_named():
    with pytest.raises(ValueError, match="'free_for_all': games that eliminate"):
        ah.make_world("free_for_all", 4, "cuda")
    with pytest.raises(ValueError, match="worlds on a device need the name"):
        ah.make_world(ah.make_scenario("reach"), 4, "cuda")


@pytest.mark.skipif(torch.cuda.is_available(), reason="a GPU is here")
def test_a_missing_gpu_is_named():
    with pytest.raises(RuntimeError, match="torch finds no GPU"):
        ah.make_world("touch", 4, "cuda")


@pytest.mark.slow
def test_ppo_learns_in_worlds_on_a_device(tmp_path):
    settings = {"engine": "device", "evaluations": 1}
    result = ah.train("touch", tmp_path / "run", **settings)
    assert result.metrics["success"] > 0.9
    rows = (tmp_path / "run" / "progress.csv").read_text()
    assert "rollout/success" in rows


@pytest.mark.parametrize(
    ("task", "changes", "named"),
    [
        ("touch", {"cost_weight": 0.1}, "cost_weight: the engine device"),
        ("duel", {}, "self_play_fraction: with the engine device the learner plays"),
    ],
)
def test_settings_of_other_engines_are_named(task, changes, named):
    with pytest.raises(ValueError, match=named):
        preset(task, {"engine": "device", **changes})

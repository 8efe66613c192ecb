"""Worlds on a device: the bits of a CPU, code of a GPU, and what is refused."""

import dataclasses
import re
import shutil
import subprocess

import numpy as np
import pytest

pytest.importorskip("torch")

import torch
from torch.utils._python_dispatch import TorchDispatchMode
from torchrl.envs import check_env_specs

import marl_airhockey as ah
from marl_airhockey.build import build_world
from marl_airhockey.code_export import translated
from marl_airhockey.device.kernel import KernelText
from marl_airhockey.device.module import kernel_module
from marl_airhockey.device.networks import DeviceNetwork
from marl_airhockey.device.world import DeviceWorld
from marl_airhockey.envs.torchrl_env import AirHockeyTorchEnv
from marl_airhockey.learn.ppo_config import preset
from marl_airhockey.learn.ppo_device import DeviceTrainer
from marl_airhockey.registry import make_driver, scenario_names
from marl_airhockey.sim.jit.targets import GPU, machine_of

PTXAS = shutil.which("ptxas")
WORLDS, STARTS = 3, 8
GAMES = {
    "juggle": {"physics": {"servo_time": 0.05}},
    "hit_goal": {"physics": {"puck_drag": (0.01, 0.03)}},
    "duel": {"max_cycles": 150},
    "doubles": {"max_cycles": 150, "options": {"reaction": 0.0}},
    "strike_crowd": {"max_cycles": 100},
    "free_for_all": {"max_cycles": 300, "options": {"lives": 1}},
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

    seen, served, eliminated = world.reset(), 0, 0
    assert same_rows(seen, np.stack([start(k) for k in range(WORLDS)]))
    actions = np.random.default_rng(0)
    for _ in range(600):
        action = actions.uniform(-1, 1, (WORLDS, seats, 2))
        found = world.step(torch.from_numpy(action))
        for k, one in enumerate(single):
            result = one.step(action[k][None])
            if one.serves:
                served += int(one.control_step.now.verdict.outcome["serves"].sum())
            eliminated += int(np.any(one.eliminated))
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
    assert eliminated > 0 or name != "free_for_all"
    world.check()
    action[1] = np.nan
    world.step(torch.from_numpy(action))
    with pytest.raises(ValueError, match="world 1: an action is not finite"):
        world.check()


@pytest.mark.slow
def test_every_scenario_becomes_code_of_a_gpu_without_fused_products(tmp_path):
    names = scenario_names()
    texts, games = translated(names, {})
    machine = machine_of(GPU)
    for name in names:
        module = kernel_module(KernelText(*games[name]), texts, GPU)
        code = machine.emit_assembly(module)
        assert re.search(r"\bmul\.rn\.f64\b", code)
        # ptxas fuses a product and a sum that name no rounding.
        assert not re.search(r"\b(fma|mad)\.\S*f(32|64)\b", code), name
        assert not re.search(r"\b(mul|add|sub)\.f(32|64)\b|\.approx|\.ftz", code), name
        # Numbers of 64 bits are read and written as a whole.
        halves, wholes = (
            len(re.findall(rf"\b(?:ld|st)\.\S*[a-z]{bits}\b", code))
            for bits in (32, 64)
        )
        assert halves < wholes / 10, name
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
        ({"physics": {"action_delay": 0.05}}, "action_delay"),
        ({"options": {"drag_regions": [[0.2, 0.0, 0.1, 1.0]]}}, "drag_regions"),
        ({"drivers": {"paddle_0": "still"}}, "paddle_0: .* it is not a policy"),
        ({"drivers": {"paddle_0": "zoo/reach"}}, "expects observations of shape"),
        ({"drivers": {"paddle_0": "zoo/touch_ur5e"}}, "it observes 'estimate'"),
    ],
)
def test_what_a_device_cannot_do_is_named(keywords, named):
    for make in (ah.make_world, ah.make_torchrl):
        with pytest.raises(ValueError, match=named):
            make("touch", 4, "cuda", **keywords)


def test_objects_are_named():
    with pytest.raises(ValueError, match="worlds on a device need the name"):
        ah.make_world(ah.make_scenario("reach"), 4, "cuda")


def test_a_network_has_the_actions_of_its_policy():
    policy = make_driver("zoo/duel").predict
    for card in ({}, {"bounded": True}):
        same = dataclasses.replace(policy, card=card)
        seen = np.random.default_rng(0).normal(0.0, 0.5, (50, 24)).astype(np.float32)
        wanted = np.clip(same(seen), -1.0, 1.0)
        found = DeviceNetwork(same, torch.device("cpu"))(torch.from_numpy(seen))
        np.testing.assert_allclose(found.numpy(), wanted, atol=1e-5)


@pytest.mark.slow
def test_a_driver_plays_its_seat():
    driven = {**GAMES["duel"], "drivers": {"paddle_1": "zoo/duel"}}
    world = DeviceWorld("duel", WORLDS, "cpu", STARTS, keywords=driven)
    whole = DeviceWorld("duel", WORLDS, "cpu", STARTS, keywords=GAMES["duel"])
    network = DeviceNetwork(make_driver("zoo/duel").predict, torch.device("cpu"))
    seen, both = world.reset(5), whole.reset(5)
    random = torch.Generator().manual_seed(0)
    for _ in range(200):
        assert torch.equal(seen, both[:, :1])
        action = 2.0 * torch.rand((WORLDS, 1, 2), generator=random) - 1.0
        other = network(both[:, 1])[:, None]
        both, paid, *_ = whole.step(torch.cat([action, other], 1))
        seen, reward, *_ = world.step(action)
        assert torch.equal(reward, paid[:, :1])
    assert world.seats == 1
    with pytest.raises(ValueError, match=r"expected shape \(3, 1, 2\), got \(3, 2\)"):
        world.step(action[:, 0])
    with pytest.raises(ValueError, match="seed: -1"):
        world.reset(-1)


@pytest.mark.slow
def test_a_reset_without_a_seed_begins_other_episodes():
    world = DeviceWorld("duel", WORLDS, "cpu", STARTS, GAMES["duel"])
    first, second = world.reset().clone(), world.reset().clone()
    assert not torch.equal(first, second)
    world.step(torch.full((WORLDS, 2, 2), torch.nan, dtype=torch.float64))
    assert torch.equal(world.reset(0), first)
    world.check()
    assert torch.equal(world.reset(), second)


@pytest.mark.slow
def test_a_world_gets_all_starts():
    world = DeviceWorld("duel", STARTS, "cpu", STARTS, GAMES["duel"])
    begun = [world.reset()[0].clone()]
    still = torch.zeros((STARTS, 2, 2))
    while len(begun) < STARTS:
        step = world.step(still)
        if step.terminated[0] or step.truncated[0]:
            begun.append(step.observation[0].clone())
    reset = [world.reset(0)[0].clone()]
    reset += [world.reset()[0].clone() for _ in begun[1:]]
    assert all(torch.equal(*pair) for pair in zip(begun, reset, strict=True))
    assert len({rows.numpy().tobytes() for rows in begun}) == STARTS


@pytest.mark.slow
def test_torchrl_has_the_tensors_of_the_cpu():
    keywords = GAMES["duel"]
    worlds = DeviceWorld("duel", WORLDS, "cpu", STARTS, keywords, False)
    env, other = AirHockeyTorchEnv(worlds), ah.make_torchrl("duel", WORLDS, **keywords)
    for each in (env, other):
        each.set_seed(2)
    seen, wanted = env.reset(), other.reset()
    assert (seen == wanted).all()
    random, going = torch.Generator().manual_seed(0), True
    while going:
        step = env.action_spec.zero()
        for group in env.group_map:
            shape = step[group, "action"].shape
            step[group, "action"] = 2.0 * torch.rand(shape, generator=random) - 1.0
        seen, wanted = env.step(step.clone())["next"], other.step(step)["next"]
        assert (seen == wanted).all()
        going = not seen["done"].any()
    assert seen["done"].any()
    check_env_specs(env)
    way = env.rollout(400, break_when_any_done=False)
    shares = way["state"][..., env.state_labels.index("time_share")]
    begun = way["next", "done"][:, :-1, 0]
    assert begun.sum() > WORLDS
    assert (shares[:, 1:][begun] == 0.0).all()
    assert (shares[:, 1:][~begun] > 0.0).all()


@pytest.mark.skipif(torch.cuda.is_available(), reason="a GPU is here")
def test_a_missing_gpu_is_named():
    with pytest.raises(RuntimeError, match="torch finds no GPU"):
        ah.make_world("touch", 4, "cuda")


class Operations(TorchDispatchMode):
    """Names of the operations of torch."""

    def __init__(self):
        super().__init__()
        self.names = set()

    def __torch_dispatch__(self, function, types, args=(), kwargs=None):
        self.names.add(function.name().split(".")[0])
        return function(*args, **(kwargs or {}))


WAITING = {f"aten::{n}" for n in ("_local_scalar_dense", "nonzero", "equal")}
"""Operations that wait for a device, which a CUDA graph cannot contain."""


@pytest.mark.slow
def test_ppo_learns_in_worlds_on_a_device(tmp_path, monkeypatch):
    play, operations = DeviceTrainer._play, Operations()

    def watched(trainer):
        with operations:
            found = play(trainer)
        assert not operations.names & WAITING
        return found

    monkeypatch.setattr(DeviceTrainer, "_play", watched)
    settings = {"engine": "device", "evaluations": 1}
    result = ah.train("touch", tmp_path / "run", **settings)
    assert result.metrics["success"] > 0.9
    rows = (tmp_path / "run" / "progress.csv").read_text()
    assert "rollout/success" in rows
    assert "aten::randn_like" in operations.names
    with operations:
        assert torch.ones(2).any()
    assert operations.names & WAITING


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

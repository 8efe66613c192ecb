"""Tasks that ask to aim: what does not look at the goal does not succeed."""

import csv
import importlib.util
from pathlib import Path

import numpy as np
import pytest
from situations import idle, place_puck

import marl_airhockey as ah

ROOT = Path(__file__).parents[2]
DATA = ROOT / "docs/data"


@pytest.fixture
def blind_baseline():
    path = ROOT / "scripts/reproduce/blind_baseline.py"
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def at_goal(worlds=1, **goal):
    """Worlds of reach whose paddles are at rest in the middle of the reach."""
    world = ah.make_world("reach", worlds)
    world.autoreset = False
    world.reset(0)
    state, memory = world.get_state()
    state.paddle[:], state.paddle_velocity[:] = (-0.55, 0.0), 0.0
    memory["goal"][:] = (-0.45, 0.0)
    world.set_state(state, memory)
    return world


def test_reach_is_not_a_passage_at_full_speed():
    world, forward = at_goal(), np.full((1, 1, 2), (1.0, 0.0))
    gaps, success = [], []
    for _ in range(6):
        success.append(world.step(forward).success.any())
        gaps.append(world.memory["gap"].item())
    assert min(gaps) < world.scenario.radius
    assert not any(success)


def test_reach_is_rest_at_the_goal_for_a_tenth_of_a_second():
    world, ends = at_goal(), []
    for _ in range(20):
        own = world.state.paddle[:, 0]
        gap = world.memory["goal"] - own
        step = world.step(np.clip(6.0 * gap, -1, 1)[:, None])
        speed = np.linalg.norm(world.state.paddle_velocity[:, 0])
        rests = speed < 0.05 and world.memory["gap"].item() < 0.02
        ends.append((rests, step.terminated.item(), step.success.item()))
        if step.terminated.item():
            break
    assert [end[1:] for end in ends[:-1]] == [(False, False)] * (len(ends) - 1)
    assert ends[-1] == (True, True, True)
    assert ends[-2][0], "it was at rest a step before already"


def test_a_rest_beside_the_goal_is_no_success():
    world = at_goal()
    assert not any(step.terminated.any() for step in idle(world, 1.0))


def test_reach_velocity_has_one_pass():
    world = ah.make_world("reach_velocity", 1)
    world.autoreset = False
    world.reset(0)
    state, memory = world.get_state()
    state.paddle[:], state.paddle_velocity[:] = memory["goal"], 0.0
    world.set_state(state, memory)
    over = [step.terminated.item() for step in idle(world, 0.3)]
    assert over[:5] == [False] * 4 + [True]
    assert not world.episode.success.any()


@pytest.mark.parametrize("task", ["hit_goal", "hit_goal_velocity", "move_block"])
def test_the_touch_after_the_last_shot_ends_the_episode(task):
    world = ah.make_world(task, 1, physics={"tilt": 0.0})
    world.autoreset = False
    world.reset(0)
    shots = world.scenario.shots
    for touches in (shots - 1, shots):
        memory = world.memory["touches"]
        place_puck(
            world, -0.45, 0.0, -1.0, paddle=(-0.55, 0.0),
            touches=np.full_like(memory, touches), apart=9.0,
        )  # fmt: skip
        step = idle(world, 0.05)[0]
        assert world.memory["touches"].item() == touches + 1
        assert step.terminated.item() == (touches == shots)
    assert not world.episode.success.any()


@pytest.mark.parametrize(("speed", "moved"), [(1.5, True), (-1.5, False)])
def test_only_a_rising_puck_moves_the_block_for_the_shooter(speed, moved):
    world = ah.make_world("move_block", 1, physics={"tilt": 0.0})
    world.autoreset = False
    world.reset(0)
    state, memory = world.get_state()
    state.block[:] = (0.2, 0.0)
    memory["touches"][:], memory["any_touch"][:] = 1, True
    world.set_state(state, memory)
    place_puck(world, 0.2 - 0.1 * np.sign(speed), 0.0, speed, paddle=(-0.65, 0.2))
    idle(world, 0.6)
    here = world.state.block[0, 0, 0]
    assert abs(here - 0.2) > 0.04
    assert world.episode.success.item() == moved
    assert (world.memory["moved"].item() > 0.04) == moved


def test_the_best_blind_controllers_succeed_as_often_as_published(blind_baseline):
    """The controllers of the file play today's rules, which keep them under 0.35."""
    with (DATA / "blind.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["profile"] == "ideal"]
    assert len(rows) == 5
    for row in rows:
        numbers = np.tile([float(x) for x in row["numbers"].split()], (400, 1))
        control = blind_baseline.KINDS[row["task"]].control
        driver = blind_baseline.Blind(control, numbers, {})
        found = blind_baseline.play(driver, row["task"], "ideal", 0).success.mean()
        published = float(row["success"])
        assert published < 0.35
        assert abs(found - published) < 0.1, row["task"]


def test_the_goal_of_hit_goal_velocity_says_a_quarter_of_the_restitution():
    world = ah.make_world("hit_goal_velocity", 4096, profile="ur5e")
    world.reset(0)
    memory, wanted = world.memory, world.episode.physics["paddle_restitution"]
    given = [np.ones((4096, 1)), memory["goal"], memory["goal_velocity"]]
    goal = np.concatenate(given, 1)
    fit = goal @ np.linalg.lstsq(goal, wanted, rcond=None)[0]
    assert 1 - np.var(wanted - fit) / np.var(wanted) == pytest.approx(0.25, abs=0.03)

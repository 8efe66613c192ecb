"""rules="paper": success as the paper's published code defines it.

The formulas here are in its frame: x grows towards the robot.
"""

import numpy as np
import pytest

import marl_airhockey as ah
from marl_airhockey.data.benchmark.catalogue import TASKS

DIAGONAL = np.hypot(1.9304, 0.8636)
RADIUS = 0.047625 + 0.03175
"""Distance of paddle and puck that touch (m)"""


def gap(a, b):
    return float(np.hypot(*(a - b)))


def velocity_score(velocity, wanted):
    cosine = velocity @ wanted / (np.hypot(*velocity) * np.hypot(*wanted) + 1e-8)
    error = abs(np.hypot(*velocity) - np.hypot(*wanted)) / np.hypot(2.0, 2.0)
    return ((cosine + 1) / 2 + 1 - error) / 2


def judge(task, paddle, puck, blocks, old_blocks, goal, time):
    """Return the success of a step; bodies are position and velocity, (4,)."""
    p, v = paddle[:2], paddle[2:]
    u, w = (None, None) if puck is None else (puck[:2], puck[2:])
    match task:
        case "reach":
            return gap(p, goal[:2]) < 0.05
        case "reach_velocity":
            near = 1 - gap(p, goal[:2]) / DIAGONAL >= 0.9
            return near and velocity_score(v, goal[2:]) >= 0.8
        case "touch":
            return gap(p, u) < RADIUS + 0.02
        case "strike":
            return min(np.hypot(*w), 2.0) / 2.0 > 0.1
        case "strike_crowd":
            moved = np.hypot(*(blocks - old_blocks[0]).T).sum()
            return 10 * moved / DIAGONAL > 1 and time > 3 * 0.05
        case "juggle":
            inside = -1.9304 / 8 < u[0] < 0
            return inside and p[0] > 4 * 0.047625 and time > 50 * 0.05
        case "puck_velocity":
            return -u[0] > 0.5 and time > 25 * 0.05
        case "move_block":
            moved = gap(blocks[0], old_blocks[-1][0])
            return 5000 * moved / DIAGONAL > 1 and time > 5 * 0.05
        case "hit_goal":
            return gap(u, goal[:2]) < 0.15 and w[0] < 0
        case "hit_goal_velocity":
            return gap(u, goal[:2]) < 0.1012


def seen(world, k):
    """Return paddle, puck, blocks, goal and time of world k, in the paper's frame."""
    state, memory, turn = world.judged, world.memory, np.array([-1.0, 1.0])

    def body(position, velocity):
        return np.concatenate([position[k, 0] * turn, velocity[k, 0] * turn])

    paddle = body(state.paddle, state.paddle_velocity)
    puck = body(state.puck, state.puck_velocity) if state.bodies.pucks else None
    names = [name for name in ("goal", "goal_velocity") if name in memory]
    goal = np.concatenate([np.zeros(0), *(memory[name][k] * turn for name in names)])
    return paddle, puck, state.block[k] * turn, goal, float(state.time[k])


def chase(world, rng):
    """Actions towards the puck or the goal, with noise."""
    state = world.state
    target = state.puck[:, 0] if state.bodies.pucks else world.memory["goal"]
    noise = rng.normal(0.0, 0.3, target.shape)
    return np.clip(8.0 * (target - state.paddle[:, 0]) + noise, -1, 1)[:, None]


@pytest.mark.parametrize("task", TASKS)
def test_success_is_that_of_the_papers_code(task):
    physics = {"tilt": 0.0} if task.startswith("strike") else "authors"
    options = {"rules": "paper", "table": "full_size"}
    world = ah.make_world(task, 64, physics=physics, options=options)
    world.autoreset, rng = False, np.random.default_rng(0)
    world.reset(0)
    state, memory = world.get_state()
    if state.bodies.pucks:  # Half of the pucks rise, so that there is much to judge.
        state.puck_velocity[::2, 0, 0] = rng.uniform(0.5, 3.0, 32)
        world.set_state(state, memory)
    blocks = {k: [seen(world, k)[2]] for k in range(64)}
    live, verdicts = set(range(64)), []
    for _ in range(min(world.max_cycles, 150)):
        step = world.step(chase(world, rng))
        for k in sorted(live):
            paddle, puck, block, goal, time = seen(world, k)
            expected = judge(task, paddle, puck, block, blocks[k], goal, time)
            blocks[k].append(block)
            verdicts.append(bool(expected))
            assert bool(step.success[k].all()) == bool(expected), (k, time)
            if step.terminated[k] or step.truncated[k]:
                live.remove(k)
    assert any(verdicts)
    assert not all(verdicts)


def test_rules_of_the_paper_are_of_its_tasks_alone():
    with pytest.raises(ValueError, match="ten tasks"):
        ah.make_world("duel", options={"rules": "paper"})
    with pytest.raises(ValueError, match="the goal decides"):
        ah.make_world("reach", options={"rules": "paper", "goals": "dict"})
    with pytest.raises(ValueError, match="paper"):
        ah.make_world("reach", options={"rules": "papers"})

"""A state that is set from outside: as if the world had stood so for long."""

from dataclasses import replace

import numpy as np
import pytest

import marl_airhockey as ah

HOME = {"robot": (-0.6, 0.0)}


def placed(world, **bodies):
    """The state of a world with some arrays replaced."""
    state, _ = world.get_state()
    for name, value in bodies.items():
        getattr(state, name)[:] = value
    return state


def test_a_state_that_was_read_brings_the_episode_back(scenario, backend):
    world = ah.make_world(scenario, 3, backend=backend, max_cycles=500)
    world.autoreset = False
    world.reset(0)
    rng = np.random.default_rng(0)
    still = np.zeros((3, len(world.open), 2))
    for _ in range(5):
        world.step(rng.uniform(-1, 1, still.shape))
    kept = world.get_state()
    first = world.set_state(*kept)
    np.testing.assert_array_equal(world.observation(), first)
    one = [world.step(still) for _ in range(10)]
    np.testing.assert_array_equal(world.set_state(*kept), first)
    two = [world.step(still) for _ in range(10)]
    for a, b in zip(one, two, strict=True):
        np.testing.assert_allclose(a.reward, b.reward, atol=1e-9)
        np.testing.assert_allclose(a.observation, b.observation, atol=1e-6)


def test_the_clock_is_that_of_the_state():
    world = ah.make_world("duel", 2, max_cycles=100)
    world.autoreset = False
    world.reset(0)
    late = placed(world, time=[4.9, 1.0])
    world.set_state(late, world.memory)
    assert world.episode.cycles.tolist() == [98, 20]
    steps = [world.step(np.zeros((2, 2, 2))).truncated.tolist() for _ in range(2)]
    assert steps == [[False, False], [True, False]]


def test_returns_and_success_begin_at_none_and_the_episode_goes_on():
    world = ah.make_world("touch", 2)
    world.autoreset = False
    world.reset(0)
    for _ in range(80):
        world.step(np.ones((2, 1, 2)))
    number, physics = world.episode.number.copy(), dict(world.episode.physics)
    kept = world.get_state()
    row = kept[0].map(lambda x: x[1:]), {k: v[1:] for k, v in kept[1].items()}
    before = world.episode
    world.set_state(*row, worlds=np.array([1]))
    after = world.episode
    assert after.returns[1] == 0.0
    assert not after.success[1].any()
    np.testing.assert_array_equal(after.returns[0], before.returns[0])
    np.testing.assert_array_equal(after.number, number)
    for name, value in physics.items():
        np.testing.assert_array_equal(world.episode.physics[name], value)


def test_what_touches_has_touched_for_long(backend):
    world = ah.make_world("juggle", 1, backend=backend, physics={"tilt": 0.0})
    world.autoreset = False
    world.reset(0)
    touch = 0.047625 + 0.03175
    state = placed(world, velocity=0.0)
    state.paddle[:, 0], state.puck[:, 0] = (-0.6, 0.0), (-0.6 + touch - 2e-4, 0.0)
    world.set_state(state)
    assert world.memory["apart"].tolist() == [[[0.0]]]
    world.step(np.zeros((1, 1, 2)))
    assert world.memory["touches"].sum() == 0
    assert world.state.touched.sum() == 0


def test_a_puck_that_leans_on_a_goal_line_does_not_cross_it_anew(backend):
    world = ah.make_world("juggle", 1, backend=backend)
    world.autoreset = False
    world.reset(0)
    state = placed(world, velocity=0.0)
    state.paddle[:, 0], state.puck[:, 0] = (-0.5, 0.2), (-0.8382 + 0.0316, 0.0)
    world.set_state(state)
    result = world.step(np.zeros((1, 1, 2)))
    assert not world.state.crossed.any()
    assert not world.state.banked.any()
    assert not result.terminated.any()


def test_no_delayed_action_is_under_way_and_the_past_is_a_steady_motion():
    physics = {"action_delay": 0.1, "observation_delay": 0.1}
    world = ah.make_world("juggle", 1, physics=physics, observe="history")
    world.autoreset = False
    world.reset(0)
    for _ in range(5):
        world.step(np.ones((1, 1, 2)))
    state = placed(world, velocity=0.0)
    state.paddle[:, 0], state.puck[:, 0] = (-0.6, 0.0), (0.3, 0.1)
    state.puck_velocity[:, 0] = (-0.5, 0.0)
    world.set_state(state)
    np.testing.assert_allclose(world.sensed.puck[0, 0], [0.35, 0.1], atol=1e-12)
    np.testing.assert_allclose(world.sensed.puck_velocity[0, 0], [-0.5, 0.0])
    world.step(np.zeros((1, 1, 2)))
    np.testing.assert_array_equal(world.command, 0.0)


def test_a_memory_of_its_own_begins_an_episode_anywhere(scenario):
    world = ah.make_world(scenario, 4)
    world.autoreset = False
    world.reset(0)
    for _ in range(3):
        world.step(np.ones((4, len(world.open), 2)))
    state, memory = world.get_state()
    world.set_state(state)
    fresh = world.memory
    assert fresh.keys() == memory.keys()
    for name, value in fresh.items():
        assert np.isfinite(value[value != np.inf]).all(), name
        assert value.dtype == memory[name].dtype
    step = world.step(np.zeros((4, len(world.open), 2)))
    assert np.isfinite(step.observation).all()
    assert np.isfinite(step.reward).all()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"position": np.zeros((1, 3, 2))}, "state.position: expected shape"),
        ({"velocity": np.full((1, 2, 2), np.nan)}, "state.velocity: every element"),
        ({"time": np.full(1, np.inf)}, "state.time: every element"),
        ({"time": np.full(1, -3.0)}, "state: its time is 3 s before the episode"),
        ({"time": np.full(1, 1e6)}, "state: its time is 1e.06 s; at most 15 is"),
        ({"spin": np.full((1, 2), 1e300)}, "paddle_0 spins at .* m/s at its rim"),
        (
            {"position": np.zeros((1, 2, 2), complex)},
            "state.position: expected numbers",
        ),
        ({"velocity": np.full((1, 2, 2), "a")}, "state.velocity: expected numbers"),
        ({"velocity": [[[0.0, 0.0], [0.0]]]}, "state.velocity: .*inhomogeneous"),
        ({"angle": None}, "state.angle: expected numbers, got object"),
    ],
)
def test_a_bad_state_is_named(change, words):
    world = ah.make_world("juggle", 1)
    world.reset(0)
    with pytest.raises(ValueError, match=words):
        world.set_state(replace(world.state, **change))


def test_a_bad_memory_is_named():
    world = ah.make_world("juggle", 2)
    world.reset(0)
    state, memory = world.get_state()
    missing = {k: v for k, v in memory.items() if k != "hits"}
    with pytest.raises(ValueError, match="memory: 'hits' is missing"):
        world.set_state(state, missing)
    with pytest.raises(ValueError, match="unknown memory 'hit'"):
        world.set_state(state, memory | {"hit": memory["hits"]})
    with pytest.raises(ValueError, match="memory 'hits': expected shape"):
        world.set_state(state, memory | {"hits": np.zeros(3)})
    with pytest.raises(ValueError, match="memory 'hits': no element may be nan"):
        world.set_state(state, memory | {"hits": np.full(2, np.nan)})
    with pytest.raises(ValueError, match="memory 'hits': expected numbers"):
        world.set_state(state, memory | {"hits": np.array(["a", "b"])})
    with pytest.raises(ValueError, match="expected a State, got dict"):
        world.set_state({"time": 0.0}, memory)


@pytest.mark.parametrize(
    ("worlds", "words"),
    [
        ([0, 7], "there is no world 7; the batch has 3"),
        ([-1], "there is no world -1"),
        ([True, False], "expected indices"),
        ([0.0], "expected indices"),
        (1, "expected indices"),
        ([], "expected indices"),
        ([1, 1], "contains an index twice"),
    ],
)
def test_worlds_that_are_none_are_named(worlds, words, backend):
    world = ah.make_world("juggle", 3, backend=backend)
    world.reset(0)
    state, memory = world.get_state()
    count = np.size(worlds)
    rows = state.map(lambda x: x[:count])
    some = {name: value[:count] for name, value in memory.items()}
    with pytest.raises(ValueError, match=f"worlds: .*{words}"):
        world.set_state(rows, some, worlds)
    np.testing.assert_array_equal(world.state.position, state.position)


def test_a_refused_state_does_not_begin_an_episode():
    vec = ah.make_vec("juggle", 2, max_cycles=3, autoreset_mode="Disabled")
    vec.reset(seed=0)
    for _ in range(3):
        vec.step(np.zeros((2, 2), np.float32))
    states, memories = vec.get_state()
    states.puck[:] = 3.0
    with pytest.raises(ValueError, match="off the table"):
        vec.set_state(states, memories)
    with pytest.raises(RuntimeError, match="ended"):
        vec.step(np.zeros((2, 2), np.float32))


def test_a_state_needs_a_reset_before_it():
    world = ah.make_world("juggle", 1)
    with pytest.raises(RuntimeError, match="call reset"):
        world.set_state(world.state)


def test_environments_take_states_too():
    env = ah.parallel_env("duel")
    env.reset(seed=0)
    for _ in range(10):
        env.step({a: np.ones(2, np.float32) for a in env.agents})
    state, memory = env.get_state()
    assert state.position.shape == (3, 2)
    seen = env.set_state(state, memory)
    again, _ = env.reset(seed=4, options={"state": state, "memory": memory})
    for agent in env.agents:
        np.testing.assert_array_equal(seen[agent], again[agent])
    with pytest.raises(ValueError, match="unknown reset option 'stat'"):
        env.reset(options={"stat": state})
    with pytest.raises(ValueError, match="a memory needs a state"):
        env.reset(options={"memory": memory})
    vec = ah.make_vec("juggle", 3)
    vec.reset(seed=0)
    states, memories = vec.get_state()
    first = vec.set_state(states, memories)
    second, _ = vec.reset(options={"state": states, "memory": memories})
    np.testing.assert_array_equal(first, second)
    one = states.map(lambda x: x[:1]), {k: v[:1] for k, v in memories.items()}
    vec.set_state(*one, worlds=np.array([2]))
    np.testing.assert_array_equal(vec.world.state.position[2], states.position[0])


@pytest.mark.parametrize(
    ("name", "bodies", "words"),
    [
        (
            "duel",
            {"puck_0": (2.0, 0.0)},
            "puck_0 .* 11.. mm; at most 20 is",
        ),
        ("duel", {"puck_0": (0.0, 0.3)}, "puck_0 is off the table by 26.9"),
        ("duel", {"puck_0": (0.9, 0.0)}, "puck_0 is off the table by 61.8"),
        ("duel", {"puck_1": (0.0, -0.06)}, "puck_0 and puck_1 overlap by 63.5"),
        (
            "duel",
            {"paddle_0": (0.3, 0.0)},
            "paddle_0 .* 347.6 mm; at most 30 is",
        ),
        ("duel", {"paddle_1": (3.0, 0.0)}, "paddle_1 is off the table by 2209"),
        ("duel", {"paddle_0": (-0.1, -0.06)}, None),
        ("duel", {"puck_0": (0.83, 0.1)}, None),
        ("move_block", {"block_0": (0.0, 1.0)}, "block_0 is off the table"),
        ("free_for_all", {"paddle_2": (0.0, 0.0)}, "paddle_2 is outside the workspace"),
    ],
)
def test_a_body_is_on_the_table_in_its_reach_and_apart(name, bodies, words, backend):
    options = {"pucks": 2} if name == "duel" else {}
    world = ah.make_world(name, 1, backend=backend, options=options)
    world.reset(0)
    state, memory = world.get_state()
    state.velocity[:] = 0.0
    for body, place in bodies.items():
        kind, k = body.split("_")
        state.position[0, getattr(state.bodies, kind).start + int(k)] = place
    if words is None:
        world.set_state(state, memory)
        return
    before = world.state.position.copy()
    with pytest.raises(ValueError, match=f"state: {words}"):
        world.set_state(state, memory)
    np.testing.assert_array_equal(world.state.position, before)


def test_a_body_is_no_faster_than_any_can_be(backend):
    world = ah.make_world("duel", 3, backend=backend)
    world.reset(0)
    state, memory = world.get_state()
    state.puck_velocity[1, 0] = (500.0, 0.0)
    match = "puck_0 moves at 500 m/s in world 1; at most 50 is"
    with pytest.raises(ValueError, match=match):
        world.set_state(state, memory)


def test_a_paddle_that_has_left_the_game_is_behind_its_side(backend):
    world = ah.make_world("free_for_all", 1, backend=backend)
    world.autoreset = False
    world.reset(0)
    state, memory = world.get_state()
    memory["lives"][:, 2] = 0.0
    world.set_state(state, memory)
    world.step(np.zeros((1, 4, 2)))
    kept = world.get_state()
    assert world.state.paddle[0, 2, 0] > world.scene.table.offsets[2]
    world.set_state(*kept)
    alive = {**kept[1], "lives": np.full((1, 4), 3.0)}
    with pytest.raises(ValueError, match="paddle_2 is off the table"):
        world.set_state(kept[0], alive)


def test_states_of_paddles_that_are_moved_from_outside_can_be_set(backend):
    world = ah.make_world("duel", 16, backend=backend)
    world.reset(0)
    corners = [np.array(seat.reach) for seat in world.scene.seats]
    jammed = 0
    for _ in range(100):
        moved = np.full((16, 2, 4), np.nan)
        for k, rotation in enumerate(world.reach.rotation):
            paddle, puck = world.state.paddle[:, k], world.state.puck[:, 0]
            aim = np.clip(puck @ rotation.T, corners[k].min(0), corners[k].max(0))
            way = aim - paddle @ rotation.T
            far = np.linalg.norm(way, axis=-1, keepdims=True)
            way *= np.minimum(1.0, 0.1 / np.maximum(far, 1e-9))
            moved[:, k] = np.concatenate([paddle @ rotation.T + way, way / 0.05], -1)
        world.step(np.zeros((16, 2, 2)), moved)
        gap = world.state.paddle - world.state.puck
        jammed += (np.linalg.norm(gap, axis=-1) < 0.06).sum()
        world.set_state(*world.get_state())
    if backend == "numba":
        assert jammed > 3, "no puck was jammed by more than 2 cm"
    moved[0, 0] = np.inf
    with pytest.raises(
        ValueError, match="position-driven seat: no element may be infinite"
    ):
        world.step(np.zeros((16, 2, 2)), moved)


@pytest.mark.parametrize("name", ["duel", "doubles", "strike_crowd", "move_block"])
def test_any_state_of_an_episode_can_be_set(name, backend):
    world = ah.make_world(name, 4, backend=backend)
    world.reset(0)
    rng = np.random.default_rng(1)
    for _ in range(100):
        world.step(rng.uniform(-1.0, 1.0, (4, len(world.open), 2)))
        state, memory = world.get_state()
        world.set_state(state, memory)
        np.testing.assert_array_equal(world.state.position, state.position)

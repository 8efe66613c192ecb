"""What games need of the core: seats, ends, serving inside an episode."""

import numpy as np
import pytest
from pair import Pair
from pettingzoo.test import parallel_api_test

import marl_airhockey as ah


def test_two_open_seats_pass_pettingzoos_test():
    parallel_api_test(ah.parallel_env(Pair()), num_cycles=400)


def test_a_driven_seat_makes_it_a_single_agent_environment():
    env = ah.parallel_env(Pair(), drivers={"paddle_0": "goalkeeper"})
    env.reset(seed=0)
    assert env.agents == ["paddle_1"]
    assert env.teams == {0: ["paddle_0"], 1: ["paddle_1"]}
    assert env.group_map == {"team_1": ["paddle_1"]}
    vec = ah.make_vec(Pair(), 4, drivers={"paddle_0": "random"})
    seen, _ = vec.reset(seed=0)
    assert seen.shape == (4, len(env.observation_labels("paddle_1")))
    with pytest.raises(ValueError, match="needs exactly one"):
        ah.make_vec(Pair(), 4)


def mirrored(world):
    """The same worlds, seen from the other end."""
    flipped = world.state
    for name in ("position", "velocity"):
        getattr(flipped, name)[:] = -getattr(world.state, name)[:, [1, 0, 2]]
    other = ah.make_world(Pair(), world.num_worlds)
    other.reset(0)
    other.set_state(flipped)
    return other


def test_swapping_the_ends_swaps_observations_and_rewards():
    world = ah.make_world(Pair(), 6)
    world.reset(3)
    other = mirrored(world)
    rng = np.random.default_rng(0)
    scored = 0
    for _ in range(120):
        gap = world.state.puck - world.state.paddle
        gap[:, 1] *= -1
        actions = np.clip(6 * gap, -1, 1) + rng.normal(0, 0.3, (6, 2, 2))
        one, two = world.step(actions), other.step(actions[:, ::-1])
        # Until the first serve, which each draws for itself.
        np.testing.assert_allclose(one.reward, two.reward[:, ::-1], atol=1e-9)
        scored += int(np.abs(one.reward).sum())
        if scored:
            break
        np.testing.assert_allclose(one.observation, two.observation[:, ::-1], atol=1e-5)
    assert scored


def test_the_game_goes_on_after_a_goal():
    world = ah.make_world(Pair(), 8, max_cycles=200)
    world.autoreset = False
    world.reset(1)
    goals = np.zeros((8, 2))
    for _ in range(200):
        gap = world.state.puck - world.state.paddle
        gap[:, 1] *= -1
        before = world.state
        step = world.step(np.clip(8 * gap, -1, 1))
        goals += step.reward > 0
        served = world.state.time[:, None] * np.ones((1, 1))
        assert (served[:, 0] > before.time).all()
        np.testing.assert_allclose(step.reward.sum(-1), 0.0)
    np.testing.assert_array_equal(goals, world.memory["goals"])
    assert goals.sum() > 4
    assert step.truncated.all()
    assert not step.terminated.any()


def test_opponents_are_seen_from_ones_own_end():
    world = ah.make_world(Pair(), 1)
    seen = world.reset(0)
    labels = world.observer.layout.labels
    own = [labels.index("own.x"), labels.index("own.y")]
    other = [labels.index("other_0.x"), labels.index("other_0.y")]
    np.testing.assert_allclose(seen[0, 0, own], [-0.5, 0.0], atol=1e-6)
    np.testing.assert_allclose(seen[0, 1, own], [-0.5, 0.0], atol=1e-6)
    np.testing.assert_allclose(
        seen[0, :, other],
        [[0.5, 0.5], [0.0, 0.0]],
        atol=1e-6,
    )


def place_puck(world, x, y, vx=0.0, vy=0.0, **memory):
    """Put puck 0 of every world somewhere, with something else in the memory."""
    rows, kept = world.get_state()
    rows.puck[:, 0], rows.puck_velocity[:, 0] = (x, y), (vx, vy)
    for name, value in memory.items():
        kept[name][:] = value
    world.set_state(rows, kept)


def idle(world, seconds):
    """Steps of worlds in which nobody moves."""
    still = np.zeros((world.num_worlds, len(world.open), 2))
    return [world.step(still) for _ in range(round(seconds / world.control_dt))]


def test_a_goal_in_a_duel_pays_and_is_served_to_who_conceded(backend):
    world = ah.make_world("duel", 4, backend=backend)
    world.reset(0)
    place_puck(world, 0.75, 0.0, 2.0)
    steps = idle(world, 0.2)
    assert sum(s.reward for s in steps).tolist() == [[1.0, -1.0]] * 4
    assert (world.memory["goals"] == [1, 0]).all()
    assert (world.state.puck_velocity[:, 0, 0] > 0.45).all()
    assert (np.abs(world.state.puck[:, 0, 0]) < 0.1).all()
    angle = np.arctan2(*world.state.puck_velocity[:, 0].T[::-1])
    assert (np.abs(angle) <= 0.3).all()
    assert len(np.unique(angle)) == 4


def test_holding_the_puck_in_a_duel_is_a_foul_and_a_dead_puck_is_served(backend):
    world = ah.make_world("duel", 2, backend=backend)
    world.reset(0)
    place_puck(world, -0.3, 0.15)
    steps = idle(world, 4.95)
    np.testing.assert_allclose(world.state.puck[:, 0], [[-0.3, 0.15]] * 2, atol=1e-6)
    held = world.observer.layout.labels.index("held_0")
    np.testing.assert_allclose(steps[-1].observation[:, :, held], [[4.95, 0.0]] * 2)
    last = idle(world, 0.05)[0]
    assert not last.reward.any()
    np.testing.assert_allclose(world.state.puck[:, 0], 0.0)
    assert (world.state.puck_velocity[:, 0, 0] > 0.45).all()
    robots = ah.make_world("duel", 2, backend=backend, seats="robot")
    robots.reset(0)
    place_puck(robots, 0.05, 0.2)
    idle(robots, 0.95)
    np.testing.assert_allclose(robots.state.puck[:, 0], [[0.05, 0.2]] * 2, atol=1e-6)
    idle(robots, 0.05)
    np.testing.assert_allclose(robots.state.puck[:, 0], 0.0)


def test_a_duel_ends_at_seven_goals_and_the_better_has_won(backend):
    world = ah.make_world("duel", 2, backend=backend, options={"goals_to_win": 2})
    world.autoreset = False
    world.reset(0)
    reward = 0.0
    for _ in range(2):
        place_puck(world, -0.78, 0.0, -2.0)
        steps = idle(world, 0.1)
        reward += sum(step.reward for step in steps)
    assert any(s.terminated.all() for s in steps)
    assert world.episode.success.tolist() == [[False, True]] * 2
    assert reward.tolist() == [[-2.0, 2.0]] * 2
    assert world.memory["goals"].tolist() == [[0.0, 2.0]] * 2


GAMES = {"duel": 2, "doubles": 2, "rally": 2, "free_for_all": 4}
"""Games and in how many rotations their table comes to itself again."""


@pytest.mark.parametrize("name", GAMES)
def test_a_rotated_game_gives_rotated_rewards(name, backend):
    rotations, count = GAMES[name], 64
    worlds = [ah.make_world(name, count, backend=backend) for _ in range(2)]
    for world in worlds:
        world.autoreset = False
        world.reset(0)
    seats = len(worlds[0].open)
    angle, shift = 2 * np.pi / rotations, seats // rotations
    c, s = np.cos(angle), np.sin(angle)
    rotation = np.array([[c, -s], [s, c]])
    rng = np.random.default_rng(0)
    angle = rng.uniform(-np.pi, np.pi, count)
    launch = np.stack([np.cos(angle), np.sin(angle)], -1)
    for world, matrix in zip(worlds, (np.eye(2), rotation), strict=True):
        rows = world.state
        rows.puck[:, 0] = 0.2 * launch @ matrix.T
        rows.puck_velocity[:, 0] = 2.0 * launch[:, ::-1] @ matrix.T
        world.set_state(rows, world.memory)
    paid = np.zeros(count, bool)
    for _ in range(30):
        action = rng.uniform(-1, 1, (count, seats, 2))
        one = worlds[0].step(action)
        two = worlds[1].step(np.roll(action, shift, axis=1))
        live = ~paid & ~one.terminated
        # A goal is served again with luck of its own, so that is where it ends.
        paid |= (one.reward != 0).any(-1)
        rolled = np.roll(one.reward, shift, axis=1)
        np.testing.assert_allclose(rolled[live], two.reward[live], atol=1e-9)
        np.testing.assert_array_equal(one.terminated[live], two.terminated[live])
    assert paid.sum() > 5


@pytest.mark.parametrize("name", ["duel", "doubles"])
def test_what_one_team_wins_the_other_loses(name, backend):
    world = ah.make_world(name, 16, backend=backend)
    world.reset(0)
    rng, paid = np.random.default_rng(0), 0.0
    for _ in range(300):
        reward = world.step(rng.uniform(-1, 1, (16, len(world.open), 2))).reward
        team = world.scenario.teams
        np.testing.assert_array_equal(
            reward[:, team == 0].sum(-1), -reward[:, team == 1].sum(-1)
        )
        assert (np.ptp(reward[:, team == 0], axis=-1) == 0).all()
        paid += np.abs(reward).sum()
    assert paid > 0


def test_two_pucks_are_served_apart_and_both_count(backend):
    world = ah.make_world("duel", 4, backend=backend, options={"pucks": 2})
    world.reset(0)
    rows = world.state
    rows.puck[:], rows.puck_velocity[:] = (
        [(0.75, 0.06), (-0.75, 0.06)],
        [(2, 0), (-2, 0)],
    )
    world.set_state(rows, world.memory)
    idle(world, 0.2)
    assert (world.memory["goals"] == 1).all()
    gap = world.state.puck[:, 0] - world.state.puck[:, 1]
    assert (np.hypot(*gap.T) > 0.1).all()
    assert (world.state.puck_velocity[:, 0, 0] > 0.3).all()
    assert (world.state.puck_velocity[:, 1, 0] < -0.3).all()


def shoot(world, side, speed=2.5):
    """Send the puck through the middle of a side of a polygon, past its paddle."""
    normal, offset = world.scene.table.normals[side], world.scene.table.offsets[side]
    place_puck(world, *(-normal * (offset - 0.04)), *(-normal * speed))


@pytest.mark.parametrize("sides", [3, 4, 5])
def test_lives_are_lost_goals_shut_and_the_last_one_wins(backend, sides):
    options = {"sides": sides, "lives": 2}
    world = ah.make_world("free_for_all", 3, backend=backend, options=options)
    world.autoreset = False
    world.reset(0)
    total = np.zeros(sides)
    for side in range(sides - 1):
        for life in range(2):
            assert (world.memory["lives"][:, side] == 2 - life).all()
            shoot(world, side)
            steps = idle(world, 0.1)
            total += sum(s.reward for s in steps)[0]
            heir = side if life == 0 else (side + 1) % sides
            if heir < sides - 1:
                out = -world.scene.table.normals[heir]
                assert (world.state.puck_velocity[:, 0] @ out > 0.45).all()
    assert total.tolist() == [-2.0] * (sides - 1) + [0.0]
    assert steps[0].terminated.all() or steps[1].terminated.all()
    winners = [False] * (sides - 1) + [True]
    assert world.episode.success.tolist() == [winners] * 3


def test_a_goal_without_an_owner_is_a_wall_and_its_paddle_is_away(backend):
    world = ah.make_world("free_for_all", 2, backend=backend, options={"lives": 1})
    world.reset(0)
    shoot(world, 1)
    idle(world, 0.15)
    assert (world.memory["lives"] == [1, 0, 1, 1]).all()
    normal, offset = world.scene.table.normals[1], world.scene.table.offsets[1]
    assert (world.state.paddle[:, 1] @ normal < -offset).all()
    shoot(world, 1, 1.0)
    idle(world, 0.2)
    assert (world.memory["lives"] == [1, 0, 1, 1]).all()
    assert (world.state.puck_velocity[:, 0] @ normal > 0.5).all()
    # Whoever is out cannot act, and comes back with the next episode.
    action = np.ones((2, 4, 2))
    world.step(action)
    assert (world.state.paddle[:, 1] @ normal < -offset).all()
    world.reset(1)
    assert (world.state.paddle[:, 1] @ normal > -offset).all()


def test_a_goal_pays_who_touched_the_puck_last(backend):
    world = ah.make_world("free_for_all", 2, backend=backend)
    world.reset(0)
    # Seat 0 pushes the puck across to side 2, whose paddle stands aside.
    rows = world.state
    rows.paddle[:, 0], rows.paddle[:, 2] = (-0.2, 0.0), (0.3, 0.3)
    rows.puck[:, 0], rows.puck_velocity[:, 0] = (-0.1, 0.0), (0.0, 0.0)
    world.set_state(rows, world.memory)
    action = np.zeros((2, 4, 2))
    total = np.zeros((2, 4))
    for step in range(20):
        action[:, 0, 0] = 1.0 if step < 3 else 0.0
        total += world.step(action).reward
    assert total.tolist() == [[1.0, 0.0, -1.0, 0.0]] * 2


def test_a_rally_counts_crossings_by_turns(backend):
    world = ah.make_world("rally", 2, backend=backend)
    world.autoreset = False
    world.reset(0)
    place_puck(world, -0.2, 0.2, 1.0)
    assert not sum(s.reward for s in idle(world, 0.5)).any(), "nobody had struck it"
    for toucher, paid in ((1, 1.0), (1, 0.0), (2, 1.0), (1, 1.0)):
        heading = 1.0 if toucher == 1 else -1.0
        place_puck(world, -0.1 * heading, 0.2, heading, toucher=toucher)
        reward = sum(s.reward for s in idle(world, 0.3))
        assert reward.tolist() == [[paid, paid]] * 2
    place_puck(world, -0.1, 0.2, 0.04)
    assert idle(world, 0.05)[0].terminated.all()


def test_mates_are_paid_for_striking_in_turn(backend):
    world = ah.make_world("team_juggle", 2, backend=backend)
    world.autoreset = False
    world.reset(0)
    for striker, paid in ((1, 0.0), (2, 1.0), (2, 0.0), (1, 1.0)):
        lifted = {"armed": 1.0, "struck_at": -0.5, "striker": striker}
        place_puck(world, -0.35, 0.0, 2.0, **lifted)
        terms = [s.terms["pass"] for s in idle(world, 0.1)]
        assert sum(terms).tolist() == [[paid, paid]] * 2
    assert (world.memory["passes"] == 2).all()
    reaches = [np.asarray(seat.reach)[:, 1] for seat in world.scene.seats]
    assert reaches[0].min() > 0.049
    assert reaches[1].max() < -0.049

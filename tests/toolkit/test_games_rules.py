"""Rules of games: goals, fouls, lives, who is paid."""

import numpy as np
import pytest
from situations import idle, place_puck, shoot

import marl_airhockey as ah


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


@pytest.mark.parametrize("sides", [3, 4, 5])
def test_lives_are_lost_goals_close_and_the_last_one_wins(backend, sides):
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


def test_a_rally_counts_alternating_crossings(backend):
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


def test_mates_are_paid_for_striking_alternately(backend):
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

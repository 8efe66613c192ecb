"""Rules of games: goals, fouls, lives, who is paid."""

import numpy as np
import pytest
from situations import idle, place_puck, shoot

import marl_airhockey as ah

pytestmark = pytest.mark.usefixtures("uncompiled")


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


def test_goals_can_be_worth_less_than_those_conceded(backend):
    options = {"scored_weight": 0.25}
    world = ah.make_world("duel", 2, backend=backend, options=options)
    world.reset(0)
    place_puck(world, 0.75, 0.0, 2.0)
    assert sum(s.reward for s in idle(world, 0.2)).tolist() == [[0.25, -1.0]] * 2


def test_holding_the_puck_in_a_duel_is_a_foul_and_a_dead_puck_is_served(backend):
    prompt = {"reaction": 0.0}
    world = ah.make_world("duel", 2, backend=backend, options=prompt)
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
    idle(robots, 0.45)
    np.testing.assert_allclose(robots.state.puck[:, 0], [[0.05, 0.2]] * 2, atol=1e-6)
    idle(robots, 0.05)
    np.testing.assert_allclose(robots.state.puck[:, 0], 0.0)


@pytest.mark.parametrize("name", ["duel", "doubles"])
@pytest.mark.parametrize(("aside", "served"), [(0.04, True), (0.08, False)])
def test_a_puck_that_rests_in_a_corner_is_served(name, aside, served, backend):
    world = ah.make_world(name, 2, backend=backend)
    world.reset(0)
    length, width = world.scene.table.size
    inside = world.scene.table.puck_radius + np.array([0.04, aside])
    corner = np.array([length, width]) / 2.0 - inside
    place_puck(world, *corner)
    idle(world, 0.45)
    np.testing.assert_allclose(world.state.puck[:, 0], [corner] * 2, atol=1e-6)
    idle(world, 0.05)
    goes_on = np.allclose(world.state.puck[:, 0], [corner] * 2, atol=1e-6)
    assert goes_on != served
    if served:
        assert (world.state.puck_velocity[:, 0, 0] > 0.45).all()


@pytest.mark.parametrize("end", [-1.0, 1.0])
def test_a_goal_counts_before_a_foul_of_the_same_step(end, backend):
    world = ah.make_world("duel", 2, backend=backend)
    world.reset(0)
    seat = 0 if end < 0 else 1
    held = np.zeros((2, 2, 1))
    held[:, seat] = 4.96
    place_puck(world, 0.8 * end, 0.0, 2.0 * end, held=held)
    idle(world, 0.05)
    assert world.memory["goals"][0, 1 - seat] == 1.0
    assert (world.state.puck_velocity[:, 0, 0] * end > 0.45).all()
    assert (np.abs(world.state.puck[:, 0, 0]) < 0.1).all()


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


@pytest.mark.parametrize("name", ["duel", "doubles"])
@pytest.mark.parametrize("cycles", [1, 40])
def test_a_level_game_goes_to_who_had_more_shots_on_goal(name, cycles, backend):
    world = ah.make_world(name, 4, backend=backend, max_cycles=cycles)
    world.autoreset = False
    world.reset(0)
    rows, kept = world.get_state()
    rows.puck_velocity[:], rows.puck[:, 0] = 0.0, (-0.3, 0.2)
    kept["stopped"][:] = [(1, 0), (3, 4), (2, 2), (0, 5)]
    kept["goals"][3] = (1, 0)  # goals come first
    world.set_state(rows, kept)
    steps = idle(world, cycles * world.control_dt)
    assert steps[-1].truncated.all()
    assert not any(step.success.any() for step in steps[:-1])
    team = world.scenario.teams
    winner = np.array([0, 1, -1, 0])
    np.testing.assert_array_equal(world.episode.success, team == winner[:, None])


@pytest.mark.parametrize(
    ("toucher", "x", "y", "speed", "counts"),
    [
        (2, -0.3, 0.05, 3.0, 1.0),
        (2, -0.3, 0.05, 0.9, 0.0),
        (1, -0.3, 0.05, 3.0, 0.0),
        (0, -0.3, 0.05, 3.0, 0.0),
        (2, -0.3, 0.2, 3.0, 0.0),
    ],
)
def test_a_shot_on_goal_that_is_stopped_counts(toucher, x, y, speed, counts, backend):
    options = {"shot_weight": 0.1}
    world = ah.make_world("duel", 2, backend=backend, options=options)
    world.reset(0)
    rows, kept = world.get_state()
    rows.paddle[:, 0], rows.velocity[:, 0] = (x, y), 0.0
    rows.puck[:, 0], rows.puck_velocity[:, 0] = (x + 0.2, y), (-speed, 0.0)
    kept["toucher"][:] = toucher
    world.set_state(rows, kept)
    steps = idle(world, 0.25)
    assert (world.memory["touches"][:, 0] > 0).all(), "it was stopped"
    assert (world.memory["stopped"] == [0.0, counts]).all()
    paid = sum(step.reward for step in steps)
    np.testing.assert_allclose(paid, [[-0.1 * counts, 0.1 * counts]] * 2)


def test_two_goals_at_once_name_no_two_winners(backend):
    options = {"pucks": 2, "goals_to_win": 3}
    world = ah.make_world("duel", 2, backend=backend, options=options)
    world.autoreset = False
    world.reset(0)
    for goals in (1, 2, 3):
        rows, kept = world.get_state()
        rows.puck[:] = [(0.8, 0.0), (-0.8, 0.0)]
        rows.puck_velocity[:] = [(3.0, 0.0), (-3.0, 0.0)]
        world.set_state(rows, kept)
        step = idle(world, world.control_dt)[0]
        assert (world.memory["goals"] == goals).all()
        assert not step.terminated.any()
        assert not world.episode.success.any()
    place_puck(world, 0.8, 0.0, 3.0)
    assert idle(world, world.control_dt)[0].terminated.all()
    assert world.episode.success.tolist() == [[True, False]] * 2


@pytest.mark.parametrize("x", [0.0, 0.04, -0.04])
def test_a_puck_that_rests_between_two_paddles_is_served_again(x, backend):
    world = ah.make_world("duel", 2, backend=backend)
    world.reset(0)
    place_puck(world, x, 0.2)
    idle(world, 4.95)
    np.testing.assert_allclose(world.state.puck[:, 0], [[x, 0.2]] * 2, atol=1e-6)
    idle(world, 0.05)
    np.testing.assert_allclose(world.state.puck[:, 0], 0.0)
    assert (np.abs(world.state.puck_velocity[:, 0, 0]) > 0.45).all()


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
    count = 16 if backend == "numba" else 6
    world = ah.make_world(name, count, backend=backend)
    world.reset(0)
    rng, paid = np.random.default_rng(0), 0.0
    for _ in range(300):
        reward = world.step(rng.uniform(-1, 1, (count, len(world.open), 2))).reward
        team = world.scenario.teams
        np.testing.assert_array_equal(
            reward[:, team == 0].sum(-1), -reward[:, team == 1].sum(-1)
        )
        assert (np.ptp(reward[:, team == 0], axis=-1) == 0).all()
        paid += np.abs(reward).sum()
    assert paid > 0


MORE_SIDES = [pytest.param(count, marks=pytest.mark.slow) for count in (4, 5)]


@pytest.mark.parametrize("sides", [3, *MORE_SIDES])
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


def test_the_clock_ends_a_free_for_all_with_one_winner(backend):
    options = {"sides": 3}
    world = ah.make_world("free_for_all", 4, backend=backend, options=options)
    world.autoreset, world.max_cycles = False, 5
    world.reset(0)
    lives = [(1, 2, 2), (3, 1, 2), (2, 2, 2), (2, 2, 2)]
    shots = [(9, 1, 2), (0, 9, 9), (3, 4, 3), (5, 5, 5)]
    rows, kept = world.get_state()
    rows.puck_velocity[:] = 0.0
    rows.puck[:, 0] = -0.2 * world.scene.table.normals[2]
    kept["lives"][:], kept["shots"][:] = lives, shots
    world.set_state(rows, kept)
    steps = idle(world, 0.25)
    assert steps[-1].truncated.all()
    assert not any(step.success.any() for step in steps[:-1])
    expected = [*np.eye(3, dtype=bool)[[2, 0, 1]].tolist(), [False] * 3]
    assert world.episode.success.tolist() == expected


def test_a_puck_that_rests_before_a_seat_that_is_out_is_served_again(backend):
    world = ah.make_world("free_for_all", 2, backend=backend)
    world.reset(0)
    rows, kept = world.get_state()
    rows.puck[:, 0] = -0.25 * world.scene.table.normals[2]
    rows.puck_velocity[:] = 0.0
    kept["lives"][:, 2] = 0.0
    world.set_state(rows, kept)
    idle(world, 0.5)
    np.testing.assert_allclose(world.state.puck[:, 0], 0.0, atol=1e-9)
    assert (np.hypot(*world.state.puck_velocity[:, 0].T) > 0.45).all()


@pytest.mark.parametrize(("speed", "seconds"), [(0.0, 0.5), (0.1, 1.5)])
def test_a_puck_that_rests_or_is_held_goes_to_the_next_player(backend, speed, seconds):
    world = ah.make_world("free_for_all", 2, backend=backend)
    world.reset(0)
    rows, kept = world.get_state()
    # Along the side of seat 2, which has it within reach.
    out = world.scene.table.normals[2]
    rows.puck[:, 0] = -0.25 * out
    rows.puck_velocity[:, 0] = speed * np.array([-out[1], out[0]])
    rows.paddle[:, 2] = -0.38 * out
    kept["held"][:], kept["lying"][:] = 0.0, 0.0
    kept["served"][:] = 2.0
    world.set_state(rows, kept)
    idle(world, seconds - 0.1)
    assert (np.abs(world.state.puck[:, 0]) > 0.01).any(-1).all()
    idle(world, 0.1)
    np.testing.assert_allclose(world.state.puck[:, 0], 0.0, atol=1e-9)
    away = world.state.puck_velocity[:, 0] @ -world.scene.table.normals[3]
    assert (away > 0.45).all()


def test_a_goal_pays_who_touched_the_puck_last(backend):
    world = ah.make_world("free_for_all", 2, backend=backend)
    world.reset(0)
    # Seat 0 pushes the puck across to side 2, whose paddle stands aside.
    rows = world.state
    rows.paddle[:, 0], rows.paddle[:, 2] = (-0.2, 0.0), (0.35, 0.25)
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
    # From an end, but not twice by one seat, and not from near the middle.
    for toucher, x, paid in (
        (1, 0.4, 1.0),
        (1, 0.4, 0.0),
        (2, 0.4, 1.0),
        (1, 0.25, 0.0),
        (1, 0.4, 1.0),
    ):
        heading = 1.0 if toucher == 1 else -1.0
        place_puck(world, -x * heading, 0.2, 1.5 * heading, toucher=toucher, deep=0.0)
        reward = sum(s.reward for s in idle(world, 0.35))
        assert reward.tolist() == [[paid, paid]] * 2
    place_puck(world, -0.1, 0.2, 0.04)
    assert idle(world, 0.05)[0].terminated.all()


@pytest.mark.parametrize(("x", "paid"), [(-0.36, 1.0), (-0.2, 0.0)])
def test_a_fast_rally_counts_where_the_puck_was_struck(x, paid, backend):
    world = ah.make_world("rally", 2, backend=backend)
    world.autoreset = False
    world.reset(0)
    # Struck there in the middle of a step, it is nearer to the middle before and after.
    rows, kept = world.get_state()
    gap = world.scene.table.paddle_radius + world.scene.table.puck_radius
    half = world.control_dt / 2
    rows.paddle[:, 0], rows.velocity[:, 0] = (x - gap - 4.9 * half, 0.2), (4.9, 0.0)
    rows.puck[:, 0], rows.puck_velocity[:, 0] = (x + 7.0 * half, 0.2), (-7.0, 0.0)
    world.set_state(rows, kept)
    action = np.tile([[1.0, 0.0], [0.0, 0.0]], (2, 1, 1))
    reward = sum(world.step(action).reward for _ in range(4))
    assert (world.memory["toucher"] == 1.0).all()
    assert (world.state.puck[:, 0, 0] > 0.0).all()
    assert reward.tolist() == [[paid, paid]] * 2


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

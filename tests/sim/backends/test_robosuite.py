"""A UR5e in MuJoCo: contact kept, physics as set, the same on both paths, refusals."""

import numpy as np
import pytest
from bench import DT, FLAT, TABLE, Bench
from pages import aim, line

import marl_airhockey as ah
from marl_airhockey.play.live_match import RATE, LiveMatch
from marl_airhockey.play.open_table import open_table
from marl_airhockey.registry import find_backend
from marl_airhockey.sim.core.geometry import half_planes
from marl_airhockey.sim.core.parameters import PARAMETERS
from marl_airhockey.sim.core.scene import GoalLine, Scene
from marl_airhockey.sim.core.seat import make_seat
from marl_airhockey.sim.core.table import GRAVITY, TABLES
from marl_airhockey.sim.jit.threads import use_threads

mujoco = pytest.importorskip("mujoco")
pytest.importorskip("robosuite")

from marl_airhockey.sim.backends.robosuite.env import AirHockey  # noqa: E402
from marl_airhockey.sim.backends.robosuite.osc import subtract_payload  # noqa: E402

HOME = make_seat("robot", TABLE, 0)
FASTEST = 0.9 * np.pi
"""Largest speed of a UR5e's joints that the robot seat promises (rad/s)."""
HEIGHT, TILT, FORCE, JOINT, SHARE, SPEED = range(6)


@pytest.fixture(scope="module")
def puck():
    return Bench("robosuite")


def drive(world, driver, steps):
    """Return the trace (steps * substeps, seats, 6) of a world under a rule."""
    rows, positions = [], []
    world.reset(0)
    for k in range(steps):
        world.step(driver(k, world))
        rows.append(world.backend.trace[0].copy())
        positions.append(world.state.paddle[0].copy())
    return np.concatenate(rows), np.array(positions)


def unsteady(rng):
    return lambda k, world: rng.uniform(-1, 1, (1, len(world.open), 2))


def sweeping(rng):
    way = {}

    def action(k, world):
        if k % 12 == 0:
            angle = rng.uniform(0, 2 * np.pi, len(world.open))
            way["now"] = np.stack([np.cos(angle), np.sin(angle)], -1)[None]
        return way["now"]

    return action


@pytest.mark.parametrize("rule", [unsteady, sweeping])
def test_the_paddle_stays_on_the_table(rule):
    world = ah.make_world("juggle", backend="robosuite")
    trace, positions = drive(world, rule(np.random.default_rng(1)), 200)
    assert np.abs(trace[..., HEIGHT]).max() < 1e-3
    assert np.degrees(trace[..., TILT].max()) < 1.0
    assert trace[..., FORCE].mean() == pytest.approx(40.0, rel=0.2)
    assert trace[..., JOINT].max() < FASTEST
    assert trace[..., SPEED].max() < 0.7 + 0.05
    corners = np.array(HOME.reach)
    assert (positions[:, 0] > corners.min(0) - 0.003).all()
    assert (positions[:, 0] < corners.max(0) + 0.003).all()
    world.close()


def test_a_paddle_follows_its_command(puck):
    puck.reset((-0.6, 0.0), (0.5, 0.2, 0.0, 0.0))
    states = puck.run(0.4, velocity=(0.3, -0.2))
    np.testing.assert_allclose(states[-1].paddle_velocity[0, 0], (0.3, -0.2), atol=0.01)
    way = np.array((0.3, -0.2)) * (0.4 - DT / 2)
    np.testing.assert_allclose(
        states[-1].paddle[0, 0], np.array((-0.6, 0.0)) + way, atol=0.005
    )


def test_a_puck_falls_as_the_table_is_tilted():
    bench = Bench("robosuite", {"tilt": 5.5})
    pull = GRAVITY * np.sin(np.radians(5.5))
    bench.reset((-0.7, 0.2), (0.5, -0.2, 0.0, 0.0))
    last = bench.run(0.5)[-1]
    np.testing.assert_allclose(last.puck_velocity[0, 0, 0], -0.5 * pull, rtol=1e-3)
    assert abs(last.puck_velocity[0, 0, 1]) < 1e-9


@pytest.mark.parametrize("speed", [0.3, 1.0, 3.0, 5.0])
@pytest.mark.parametrize("share", [0.1, 0.3, 0.6, 0.9])
def test_walls_and_paddles_return_their_share(puck, speed, share):
    names = ("wall_restitution", "paddle_restitution")
    puck.backend.worlds[0].table_physics.set_physics(FLAT | dict.fromkeys(names, share))
    puck.reset((-0.7, 0.15), (0.0, 0.0, 0.0, speed))
    states = puck.run(0.3 / speed + 3 * DT)
    turned = [s.puck_velocity[0, 0, 1] for s in states if s.puck_velocity[0, 0, 1] < 0]
    # The first of these may lie within the contact.
    assert -turned[1] / speed == pytest.approx(share, abs=0.03)
    puck.reset((-0.6, 0.0), (-0.4, 0.0, -speed, 0.0))
    states = puck.run(0.13 / speed + 2 * DT)
    assert states[-1].puck_velocity[0, 0, 0] / speed == pytest.approx(share, abs=0.03)
    assert sum(s.touched[0, 0, 0] for s in states) == 1


@pytest.mark.parametrize("what", ["wall", "paddle"])
def test_bounces_with_spin_and_friction_are_those_of_the_table(what):
    rng = np.random.default_rng(0)
    laws = {name: p.default for name, p in PARAMETERS.items()} | {"tilt": 0.0}
    benches = [Bench(name, laws) for name in ("numba", "robosuite")]
    axis, home = (1, (-0.7, 0.15)) if what == "wall" else (0, (-0.6, 0.0))
    for speed in (0.4, 0.7, 1.0, 2.0, 3.0):
        for _ in range(3):
            aside, edge = rng.uniform(-1, 1) * speed, rng.uniform(-2, 2)
            row = (0.0, 0.0, aside, speed) if axis else (-0.4, 0.0, -speed, 0.0)
            ends = []
            for bench in benches:
                state = bench.reset(home, row)
                state.spin[0, 1] = edge / TABLE.puck_radius
                bench.backend.reset(state, np.arange(1))
                ends.append(bench.run((0.28 if axis else 0.13) / speed + 2 * DT)[-1])
            found = [(*s.puck_velocity[0, 0], s.puck_edge[0, 0]) for s in ends]
            gap = np.abs(np.subtract(*found))
            assert gap[axis] < 0.03 * speed
            assert (np.delete(gap, axis) < 0.03 + 0.05 * speed).all()


def test_drag_and_friction_are_those_of_the_other_backends():
    bench = Bench("robosuite", {"puck_damping": 0.8}, blocks=1)
    bench.reset((-0.7, 0.2), (-0.3, 0.0, 0.5, 0.0), (0.0, 0.2, 0.6, 0.0))
    states = bench.run(1.0)
    np.testing.assert_allclose(
        states[-1].puck_velocity[0, 0, 0], 0.5 * np.exp(-0.8), rtol=5e-3
    )
    way = 0.6 / 0.8 - 2.4 / 0.8**2 * np.log(1 + 0.8 * 0.6 / 2.4)
    assert states[-1].block[0, 0, 0] == pytest.approx(way, rel=0.02)
    still = states[-1].block[0, 0]
    np.testing.assert_allclose(bench.run(0.5)[-1].block[0, 0], still, atol=1e-6)


def test_nothing_escapes():
    rng, bench = np.random.default_rng(0), Bench("robosuite", path=True)
    for _ in range(200):
        angle, at = rng.uniform(0, 2 * np.pi), rng.uniform(-0.2, 0.2, 2)
        way = 5 * np.cos(angle), 5 * np.sin(angle)
        bench.reset((-0.6, 0.0), (*at, *way))
        for state in bench.run(0.5):
            x, y = np.abs(state.path[0, :, 1, :2]).max(0)
            assert x < 0.8382
            assert y < 0.3048


def test_a_puck_in_a_corner_does_not_tip_the_paddle():
    # Pressed on at full speed, from all sides that there are.
    world = ah.make_world(
        "duel",
        6,
        backend="robosuite",
        profile="ur5e",
        options={"seats": "robot"},
        drivers={"paddle_1": "still"},
    )
    world.reset(0)
    state, memory = world.get_state()
    rng = np.random.default_rng(0)
    state.position[:, 0] = (-0.66, -0.15) + 0.03 * rng.uniform(-1.0, 1.0, (6, 2))
    state.position[:, 2] = -0.79, -0.265
    world.set_state(state, memory)
    overlaps = []
    for _ in range(26):
        way = world.state.puck[:, 0] - world.state.paddle[:, 0]
        gap = np.linalg.norm(way, axis=-1)
        overlaps.append(TABLE.paddle_radius + TABLE.puck_radius - gap)
        world.step((way / gap[:, None])[:, None])
        trace = world.backend.trace[:, :, 0]
        assert np.degrees(trace[..., TILT].max()) < 1.0
        assert trace[..., JOINT].max() < FASTEST
    assert np.max(overlaps) > 0.005, "no puck was jammed"
    world.close()


@pytest.mark.parametrize("table", ["standard", "full_size"])
@pytest.mark.parametrize("tilt", [0.0, 5.5])
def test_the_robot_seat_is_what_an_arm_can_hold(tilt, table):
    """Seen from its side, an arm stands at any table as it does at the standard one."""
    from marl_airhockey.sim.backends.robosuite.inverse_kinematics import (
        find_joint_angles,
    )

    seats = (HOME, make_seat("robot", TABLE, 2))
    shift = float(TABLES[table].offsets[0] - TABLE.offsets[0])
    polygon = np.array(make_seat("robot", TABLES[table], 0).reach)
    polygon[:, 0] += shift
    env = AirHockey(scene=Scene(TABLE, seats, physics={"tilt": tilt}))
    env.reset()
    model, data = env.sim.model._model, env.sim.data._data
    for i, seat in enumerate(seats):
        robot = env.robots[i]
        site = robot.eef_site_id["right"]
        joints, dofs = robot._ref_joint_pos_indexes, robot._ref_joint_vel_indexes
        angles, jacobian = np.array(robot.init_qpos), np.zeros((6, model.nv))
        normals, offsets = half_planes(polygon)
        corners = polygon
        for x, y in np.ndindex(9, 9):
            share = np.array([x, y]) / 8
            ego = corners.min(0) + share * np.ptp(corners, axis=0)
            if (normals @ ego + offsets < -1e-9).any():
                continue
            at = env.frame.to_world(*(TABLE.rotation(seat.side).T @ ego))
            foot = env.hands[i].foot_rotation
            pose = at, foot, angles
            angles = find_joint_angles(model, data, site, joints, dofs, *pose)
            mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], site)
            plane = np.linalg.inv(jacobian[:, dofs])[:, :3] @ env.frame.rotation[:, :2]
            assert seat.speed * np.linalg.norm(plane, axis=1).max() < FASTEST


def test_robosuites_own_steps_are_the_same():
    rng, bench = np.random.default_rng(3), Bench("robosuite")
    env = bench.backend.env
    env.reset()
    env.table_physics.set_physics(FLAT)
    home = env.hands[0].home
    bench.reset(home, (-0.3, 0.02, 0.0, 0.0))
    data, own = env.sim.data._data, bench.backend.worlds[0].data
    data.qpos[:], data.qvel[:] = own.qpos, own.qvel
    env.sim.forward()
    env.hands[0].hold()
    furthest = 0.0
    for _ in range(40):
        env.step(rng.uniform(-1, 1, 2))
        state = bench.backend.step(bench.command(env.hands[0].new))
        hand = env.hands[0]
        mujoco.mj_kinematics(env.sim.model._model, data)
        furthest = max(furthest, np.abs(hand.position[:2] - state.paddle[0, 0]).max())
        np.testing.assert_allclose(
            data.qpos[bench.backend.worlds[0].table_physics.qpos_index[0]],
            state.puck[0, 0, 0],
            atol=1e-6,
        )
    assert furthest < 1e-6


def test_two_arms_play_at_both_ends():
    world = ah.make_world(
        "rally", backend="robosuite", options={"seats": "robot"}, num_worlds=1
    )
    trace, positions = drive(world, unsteady(np.random.default_rng(0)), 60)
    assert np.abs(trace[..., HEIGHT]).max() < 1e-3
    assert (positions[:, 0, 0] < -0.3).all()
    assert (positions[:, 1, 0] > 0.3).all()
    world.close()


def test_a_row_does_not_depend_on_the_others():
    def run(worlds):
        world = ah.make_world("touch", num_worlds=worlds, backend="robosuite")
        world.reset(5)
        for k in range(10):
            world.step(np.full((worlds, 1, 2), np.sin(k)))
        return world.state.position[0]

    np.testing.assert_array_equal(run(1), run(3))


def test_an_episode_knows_nothing_of_the_one_before():
    world = ah.make_world("juggle", num_worlds=2, backend="robosuite")

    def play(steps):
        rng, seen = np.random.default_rng(0), [world.reset(3)]
        for _ in range(steps):
            seen.append(world.step(rng.uniform(-1, 1, (2, 1, 2))).observation)
        return np.array(seen)

    first = play(40)
    np.testing.assert_array_equal(play(40), first)
    world.reset(8)
    np.testing.assert_array_equal(play(40), first)


def test_workers_change_nothing(monkeypatch):
    def run():
        world = ah.make_world("juggle", num_worlds=3, backend="robosuite")
        world.reset(5)
        for k in range(20):
            world.step(np.full((3, 1, 2), np.sin(k)))
        return world.state.position

    monkeypatch.setenv("MARL_AIRHOCKEY_THREADS", "1")
    alone = run()
    try:
        use_threads(2)
        np.testing.assert_array_equal(run(), alone)
    finally:
        use_threads(1)


def test_the_law_does_not_know_of_a_payload():
    bench = Bench("robosuite")
    world, mass = bench.backend.worlds[0], {}
    bench.reset((-0.6, 0.0), (0.5, 0.2, 0.0, 0.0))
    for load in (0.0, 0.6):
        world.set_physics(FLAT | {"arm_payload": load})
        first = world.views.arms[0, 1]
        own = slice(first, first + 6)
        speeds = world.data.qvel[own]
        speeds[:] = (0.3, -0.2, 0.4, 0.1, -0.5, 0.2)
        mujoco.mj_step1(world.model, world.data)
        jacobian, rate = np.zeros((2, 6, world.model.nv))
        site = world.views.arms[0, 3]
        point, body = world.data.site_xpos[site], world.model.site_bodyid[site]
        mujoco.mj_jacSite(world.model, world.data, jacobian[:3], jacobian[3:], site)
        mujoco.mj_jacDot(world.model, world.data, rate[:3], rate[3:], point, body)
        full = np.zeros((world.model.nv, world.model.nv))
        mujoco.mj_fullM(world.model, full, world.data.qM)
        felt, bias = full[own, own].copy(), world.data.qfrc_bias[own].copy()
        mass[load] = felt.copy(), bias.copy()
        down, drift = world.model.opt.gravity, rate[:, own] @ speeds
        subtract_payload(load, down, jacobian[:, own].copy(), drift, felt, bias)
        np.testing.assert_allclose(felt, mass[0.0][0], atol=1e-9)
        np.testing.assert_allclose(bias, mass[0.0][1], atol=1e-9)
    assert np.abs(mass[0.6][0] - mass[0.0][0]).max() > 0.05
    assert np.abs(mass[0.6][1] - mass[0.0][1]).max() > 1.0


def test_arms_differ_from_world_to_world():
    pushed = {}
    for name, value in (("arm_force", 20.0), ("arm_payload", 1.0), ("tilt", 5.5)):
        world = ah.make_world("juggle", backend="robosuite", physics={name: value})
        trace, _ = drive(world, unsteady(np.random.default_rng(1)), 40)
        assert np.abs(trace[..., HEIGHT]).max() < 1e-3
        pushed[name] = trace[..., FORCE].mean()
    assert pushed["arm_force"] == pytest.approx(20.0, rel=0.1)
    assert pushed["arm_payload"] - pushed["tilt"] == pytest.approx(GRAVITY, rel=0.1)
    arms = ah.make_world("juggle", 4, backend="robosuite", profile="ur5e")
    arms.reset(0)
    stiff = [world.views.gains[0, 0] for world in arms.backend.worlds]
    np.testing.assert_allclose(stiff, arms.episode.physics["arm_stiffness"])
    assert len(set(stiff)) == 4
    with pytest.raises(ValueError, match=r"'arm_force'. needs a.*backend='robos"):
        ah.make_world("juggle", backend="numba", physics={"arm_force": 30.0})


def test_obstacles_are_seen():
    posts = [[0.2, 0.1, 0.05], [0.1, 0.0, 0.02, 0.4, -0.2], [0.3, 0.2, 0.04, 0.3, 0.2]]
    kinds = ("hit_goal", "rgb_array", "birdview")
    plain = ah.parallel_env(*kinds, backend="robosuite")
    env = ah.parallel_env(*kinds, backend="robosuite", options={"obstacles": posts})
    try:
        pictures = []
        for each in (plain, env):
            each.reset(seed=0)
            pictures.append(each.render().astype(int))
            each.close()
    except RuntimeError as error:
        pytest.skip(str(error))
    # Nothing else differs: bodies and goals start where the posts leave room.
    assert 3000 < (np.abs(pictures[0] - pictures[1]).max(-1) > 20).sum() < 12000


def test_it_is_seen_from_three_viewpoints():
    env = ah.parallel_env("hit_goal", "rgb_array", "agentview", backend="robosuite")
    env.reset(seed=0)
    try:
        picture = env.render()
    except RuntimeError as error:
        pytest.skip(str(error))
    assert picture.shape == (528, 880, 3)
    assert picture.std() > 20
    env.close()
    with pytest.raises(ValueError, match=r"unknown viewpoint 'agentview'.*top"):
        ah.parallel_env("hit_goal", "rgb_array", "agentview")
    with pytest.raises(ValueError, match=r"unknown viewpoint 'sky'.*birdview"):
        ah.parallel_env("hit_goal", "rgb_array", "sky", backend="robosuite")


def test_a_person_moves_an_arm():
    match = LiveMatch("juggle", {}, {"backend": "robosuite"}, seed=0)
    session = open_table(match)
    client = session.connect()
    session.receive(client, line("hello", key="k"))
    session.receive(client, aim(-0.5, 0.15))
    session.receive(client, line("start"))
    for _ in range(5 * RATE):
        session.tick()
    np.testing.assert_allclose(match.world.state.paddle[0, 0], (-0.5, 0.15), atol=0.01)
    match.close()


def test_what_is_missing_is_named_with_its_fix(monkeypatch):
    backend = find_backend("robosuite")
    monkeypatch.setattr("importlib.metadata.version", lambda name: "3.10.0")
    assert "pip install mujoco==3.9.0" in backend.available()
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(
        RuntimeError, match=r"pip install 'marl_airhockey\[robosuite\]'"
    ):
        ah.make_world("juggle", backend="robosuite")


def test_what_an_arm_cannot_do_is_refused():
    for game, options, words in (
        ("duel", {}, "seats='robot'"),
        ("team_juggle", {}, "one arm at each end"),
        ("free_for_all", {}, "standard table"),
    ):
        with pytest.raises(ValueError, match=words):
            ah.make_world(game, backend="robosuite", options=options)
    with pytest.raises(ValueError, match=r"substeps: 5 are too few.*at least 13"):
        ah.make_world("juggle", backend="robosuite", substeps=5)
    with pytest.raises(ValueError, match="by as many UR5e"):
        AirHockey(robots="Panda")
    far = Scene(
        TABLE, (HOME,), pucks=1, goal_lines=(GoalLine("goal", 2, 0.3),), blocks=1
    )
    assert "slide into a goal" in find_backend("robosuite").supports(far)

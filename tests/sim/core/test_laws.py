"""The laws of a real table against closed forms and an integrator."""

import numpy as np
import pytest
from bench import DT, Bench

from marl_airhockey.sim.core.laws import cap, fly, slide, wall_restitution
from marl_airhockey.sim.core.parameters import PRESETS, PUCK_SPEED_CAP
from marl_airhockey.sim.core.physics import Physics, load_physics
from marl_airhockey.sim.core.table import GRAVITY, Table

RADIUS = 0.03175


def bounce(vt, vn, edge, restitution, friction):
    """The textbook's: a disc at a wall, t = n turned by +90 degrees."""
    normal = (1 + restitution) * vn
    push = np.clip(-(vt - edge) / 3, -friction * normal, friction * normal)
    return vt + push, restitution * vn, edge - 2 * push


@pytest.mark.parametrize("preset", ["professional", "wooden", "frictionless"])
def test_a_bounce_with_spin_sticks_or_slides(preset):
    rng = np.random.default_rng(0)
    values = {**PRESETS[preset], "puck_drag": 0.0}
    bench, stuck = Bench("numba", values), 0
    for _ in range(100):
        vt, vn, edge = rng.uniform((-3, 0.5, -3), (3, 6, 3))
        state = bench.reset((-0.7, 0.2), (0.0, -0.3048 + RADIUS + 0.02, -vt, -vn))
        state.spin[0, 1] = edge / RADIUS
        bench.backend.reset(state, np.arange(1))
        after = bench.backend.step(bench.command())
        e = values["wall_restitution"]
        e -= values["wall_restitution_slope"] * np.log(max(vn, 0.4))
        wanted = bounce(vt, vn, edge, e, values["wall_friction"])
        along, spin = -after.puck_velocity[0, 0, 0], RADIUS * after.spin[0, 1]
        found = along, after.puck_velocity[0, 0, 1], spin
        np.testing.assert_allclose(found, wanted, atol=1e-9)
        stuck += abs(along - spin) < 1e-9
    if preset != "frictionless":
        assert 10 < stuck < 95


def test_two_pucks_exchange_momentum_and_spin():
    rng = np.random.default_rng(1)
    bench = Bench("numba", PRESETS["professional"] | {"puck_drag": 0.0}, pucks=2)
    hits = 0
    for _ in range(50):
        off = rng.uniform(-0.9, 0.9) * 2 * RADIUS
        speed, edge = rng.uniform(0.5, 5), rng.uniform(-2, 2, 2)
        state = bench.reset((-0.7, 0.2), (-0.1, off, speed, 0.0), (0.0, 0.0, 0.0, 0.0))
        state.spin[0, 1:] = edge / RADIUS
        bench.backend.reset(state, np.arange(1))
        before, after = state, bench.backend.step(bench.command())
        while not (after.puck_velocity[0, 1]).any() and after.time[0] < 0.3:
            before, after = after, bench.backend.step(bench.command())
        if not after.puck_velocity[0, 1].any():
            continue
        hits += 1
        momentum = before.puck_velocity.sum(1), after.puck_velocity.sum(1)
        np.testing.assert_allclose(*momentum, atol=1e-9)
        energy = [
            (s.puck_velocity**2).sum() + 0.5 * ((RADIUS * s.spin[0, 1:]) ** 2).sum()
            for s in (before, after)
        ]
        assert energy[1] <= energy[0] + 1e-12
    assert hits > 40


@pytest.mark.parametrize("pull", [(0.0, 0.0), (-0.94, 0.0), (-0.6, 0.3)])
@pytest.mark.parametrize("law", [(0.0, 0.02), (0.1, 0.027), (0.35, 0.0)])
def test_drag_agrees_with_an_integrator(pull, law):
    for start in ((3.0, 1.0), (0.5, 4.0), (11.0, 0.0)):
        place, v, steps = np.zeros(2), np.array(start), 10_000
        exact, w, h = np.zeros(2), np.array(start), 2.0 / steps
        for _ in range(40):
            x, y, *v = fly(*v, 0.05, *pull, *law)
            place += (x, y)
        for _ in range(steps):
            middle = w + 0.5 * h * _slowed(w, pull, law)
            exact += h * middle
            w = w + h * _slowed(middle, pull, law)
        assert np.hypot(*(place - exact)) < 1e-3
        np.testing.assert_allclose(v, w, atol=2e-3)


def _slowed(v, pull, law):
    return np.array(pull) - (law[0] + law[1] * np.hypot(*v)) * v


def test_flight_is_a_flow_and_goes_back():
    whole = fly(2.0, -1.0, 0.4, 0.0, 0.0, 0.1, 0.03)
    x, y, vx, vy = fly(2.0, -1.0, 0.15, 0.0, 0.0, 0.1, 0.03)
    x2, y2, vx, vy = fly(vx, vy, 0.25, 0.0, 0.0, 0.1, 0.03)
    np.testing.assert_allclose((x + x2, y + y2, vx, vy), whole, atol=1e-12)
    back = fly(*whole[2:], -0.4, 0.0, 0.0, 0.1, 0.03)
    np.testing.assert_allclose(back, (-whole[0], -whole[1], 2.0, -1.0), atol=1e-12)


def test_restitution_falls_with_speed_and_never_makes_energy():
    assert wall_restitution(1.0, 0.85, 0.02) == 0.85
    assert wall_restitution(3.0, 0.85, 0.02) == pytest.approx(0.85 - 0.02 * np.log(3))
    slowest = wall_restitution(0.4, 0.85, 0.02)
    assert wall_restitution(1e-6, 0.85, 0.02) == slowest < 1.0
    assert wall_restitution(1e-6, 0.99, 0.2) == 1.0
    assert wall_restitution(1e9, 0.1, 0.2) == 0.0


def test_friction_stops_and_holds_a_block():
    x, _, vx, _ = slide(1.0, 0.0, 1.0, 0.0, 0.0, 2.0)
    assert (x, vx) == (pytest.approx(0.25), 0.0)
    assert slide(0.0, 0.0, 1.0, -1.0, 0.0, 2.0) == (0.0, 0.0, 0.0, 0.0)
    assert slide(0.0, 0.0, 1.0, -3.0, 0.0, 2.0)[2] == pytest.approx(-1.0)


def test_no_state_is_faster_than_the_cap(backend):
    assert cap(30.0, 40.0) == pytest.approx(PUCK_SPEED_CAP / 50)
    bench = Bench(backend)
    bench.reset((-0.7, 0.2), (0.0, 0.0, 30.0, 0.0))
    speed = np.hypot(*bench.backend.step(bench.command()).puck_velocity[0, 0])
    assert speed <= PUCK_SPEED_CAP + 1e-9


def test_a_table_can_slope_to_the_side(backend):
    bench = Bench(backend, {"cross_tilt": 2.0})
    bench.reset((-0.7, 0.2), (0.0, 0.1, 0.0, 0.0))
    state = bench.run(4 * DT)[-1]
    pull = -GRAVITY * np.sin(np.radians(2.0))
    np.testing.assert_allclose(state.puck_velocity[0, 0], [0, pull * 0.2], atol=1e-9)


def test_physics_can_be_a_preset_a_file_or_values(tmp_path):
    wooden = Physics({}, given="wooden").ranges
    assert wooden["wall_friction"] == (0.29, 0.29)
    file = tmp_path / "mine.toml"
    file.write_text('preset = "wooden"\nwall_friction = [0.2, 0.3]\n')
    mine = Physics({"tilt": 1.0}, given=file).ranges
    assert mine["wall_friction"] == (0.2, 0.3)
    assert (mine["puck_drag"], mine["tilt"]) == ((0.027, 0.027), (1.0, 1.0))
    assert load_physics("wooden") == {"preset": "wooden"}
    with pytest.raises(ValueError, match=r"preset.*wooden.*TOML"):
        Physics({}, given="plastic")
    with pytest.raises(ValueError, match="physics preset"):
        Physics({}, given={"preset": "plastic"})


def test_a_bounce_is_where_it_should_be_at_any_phase_of_the_step():
    bench = Bench("numba", PRESETS["professional"] | {"tilt": 5.5, "puck_drag": 0.0})
    pull = GRAVITY * np.sin(np.radians(5.5))
    wall = -Table.rectangle(1.6764, 0.6096).offsets[0] + RADIUS
    worst = 0.0
    for phase in np.linspace(0.0, 1.0, 1000):
        distance, speed = 0.02 + 0.2 * phase, 1.7
        bench.reset((-0.3, 0.2), (wall + distance, 0.0, -speed, 0.0))
        hit = (np.sqrt(speed**2 + 2 * pull * distance) - speed) / pull
        last = bench.run(0.3)[-1]
        fast = speed + pull * hit
        e, left = 0.85 - 0.02 * np.log(fast), 0.3 - hit
        wanted = wall + e * fast * left - 0.5 * pull * left**2
        worst = max(worst, abs(last.puck[0, 0, 0] - wanted))
    assert worst < 1e-4

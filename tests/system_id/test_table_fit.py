"""Laws of a table from rows t,x,y: those with which the puck was simulated."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

import marl_airhockey as ah
from marl_airhockey.cli.main import app
from marl_airhockey.registry import find_backend
from marl_airhockey.sim.contracts.backend import Command
from marl_airhockey.sim.core.parameters import PARAMETERS
from marl_airhockey.sim.core.physics import Physics, load_physics
from marl_airhockey.sim.core.profiles import find_profile
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.seat import make_seat
from marl_airhockey.sim.core.table import TABLES
from marl_airhockey.system_id.corrected_fit import fit_corrected
from marl_airhockey.system_id.table_fit import fit_table
from marl_airhockey.system_id.track import read_track

TABLE = TABLES["ubc_pro"]
LAWS = {"wall_restitution": 0.78, "wall_restitution_slope": 0.04, "tilt": 1.0}
LAWS |= {"wall_friction": 0.2, "puck_drag": 0.03}


def write_rows(path, noise, worlds=120, seconds=2.5, corner=False):
    """Shoot pucks over a table of `LAWS` and write where they were, 120 times a s."""
    rng, dt = np.random.default_rng(0), 1 / 120
    scene = Scene(TABLE, (make_seat("arcade", TABLE, 0),), pucks=1)
    backend = find_backend("numba")(scene, worlds, dt)
    given = {name: p.default for name, p in PARAMETERS.items()} | LAWS
    columns = {name: np.full(worlds, value) for name, value in given.items()}
    backend.set_physics(columns, np.arange(worlds))
    state = scene.still_state(worlds)
    state.position[:, 0] = (0.0, 100.0)
    angle = rng.uniform(-np.pi, np.pi, worlds)
    motion = rng.uniform(1.0, 5.0, (worlds, 1))
    state.velocity[:, 1] = motion * np.stack([np.cos(angle), np.sin(angle)], 1)
    state.spin[:, 1] = rng.normal(0.0, 0.3, worlds) * motion[:, 0] / TABLE.puck_radius
    backend.reset(state, np.arange(worlds))
    still, ways = Command.still(scene, worlds), []
    for _ in range(round(seconds / dt)):
        ways.append(backend.step(still).puck[:, 0].copy())
    shift = TABLE.size / 2 if corner else 0.0
    places = np.array(ways) + rng.normal(0.0, noise, (len(ways), worlds, 2)) + shift
    times = dt * np.arange(len(ways))[:, None] + 100.0 * np.arange(worlds)
    rows = np.stack([times, *np.moveaxis(places, -1, 0)], -1)
    np.savetxt(
        path,
        rows.swapaxes(0, 1).reshape(-1, 3),
        delimiter=",",
        header="t,x,y",
        comments="",
        fmt="%.6f",
    )


@pytest.mark.parametrize("noise", [0.0, 0.0005])
def test_the_laws_of_a_table_are_found_with_their_intervals(tmp_path, noise):
    path = tmp_path / "rows.csv"
    write_rows(path, noise)
    found = fit_table([read_track(path, TABLE)], TABLE)
    slack = {"tilt": 0.1, "puck_drag": 0.003, "wall_friction": 0.02}
    for name, value in LAWS.items():
        estimate = found.found[name]
        assert estimate.value == pytest.approx(value, abs=slack.get(name, 0.012)), name
        assert estimate.low <= estimate.value <= estimate.high
        assert estimate.high - estimate.low < 4 * slack.get(name, 0.012)
    for side in found.by_side.values():
        assert side.value == pytest.approx(0.78, abs=0.02)
    assert "hits of a recorded paddle" in found.missing["paddle_restitution"]
    assert "not identifiable" in found.missing["paddle_friction"]


def test_a_fit_is_corrected_by_what_it_makes_of_twins(tmp_path):
    path = tmp_path / "rows.csv"
    write_rows(path, 0.0005)
    track = read_track(path, TABLE)
    raw, found = fit_table([track], TABLE), fit_corrected([track], TABLE)
    for name, value in LAWS.items():
        estimate = found.found[name]
        assert estimate.low <= value <= estimate.high, name
        before = raw.found[name]
        assert estimate.high - estimate.low >= before.high - before.low
    # Drag of a mean velocity is less than the mean drag.
    drag = LAWS["puck_drag"]
    nearer = abs(found.found["puck_drag"].value - drag)
    assert nearer < abs(raw.found["puck_drag"].value - drag)


def test_a_profile_of_a_table_is_written_and_played(tmp_path):
    path, out, delays = (tmp_path / n for n in ("rows.csv", "lab.toml", "delay.json"))
    write_rows(path, 0.0003)
    spread = {"mean": 0.03, "sd": 0.001, "least": 0.028, "most": 0.032}
    delays.write_text(json.dumps({"camera": spread, "arm": {**spread, "mean": 0.067}}))
    words = ["fit-table", str(path), "--table", "ubc_pro", "--base", "ur5e"]
    words += ["--delays", str(delays), "--out", str(out)]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    profile, base = find_profile(str(out)), find_profile("ur5e")
    low, high = profile.ranges["wall_restitution"]
    assert low < LAWS["wall_restitution"] < high
    assert high - low < 0.1
    assert profile.ranges["observation_delay"] == (0.028, 0.032)
    assert profile.ranges["servo_time"] == pytest.approx((0.0453, 0.0554), abs=1e-3)
    assert profile.ranges["slope"] == (0.0, 0.0)
    assert profile.ranges["position_noise"] == base.ranges["position_noise"]
    assert "wall_restitution_slope" not in profile.follows
    world = ah.make_world("touch", 3, profile=str(out), options={"table": "full_size"})
    world.reset(0)
    drawn = world.episode.physics["wall_restitution"]
    assert ((drawn >= low) & (drawn <= high)).all()
    assert len(set(drawn)) == 3
    listed = CliRunner().invoke(app, ["list", str(out)])
    assert "fitted to" in listed.output
    arm = tmp_path / "arm.json"
    lags = {"action_delay": {**spread, "most": 0.03}, "servo_time": spread}
    arm.write_text(json.dumps(lags))
    assert CliRunner().invoke(app, [*words, "--delays", str(arm)]).exit_code == 0
    profile = find_profile(str(out))
    assert profile.ranges["action_delay"] == (0.028, 0.03)
    assert profile.ranges["servo_time"] == (0.028, 0.032)
    assert profile.ranges["observation_delay"] == (0.028, 0.032)


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("base = 'moon'", "base 'moon'"),
        ("[ranges]\nglue = [0, 1]", "parameter 'glue'"),
        ("[ranges]\ntilt = '3'", r"tilt: expected a number or \(low, high\)"),
        ("[ranges]\nwall_restitution = [0.5, 1.5]", "must lie within"),
        ("[ranges]\nwall_restitution = [0.9, 0.5]", "must lie within"),
        ("rangs = 1", "field 'rangs'"),
        ("= 1", "Invalid"),
    ],
)
def test_what_is_wrong_with_a_profile_is_said(tmp_path, text, error):
    path = tmp_path / "lab.toml"
    path.write_text(text)
    with pytest.raises(ValueError, match=error):
        find_profile(str(path))
    with pytest.raises(ValueError, match="profile 'nowhere'"):
        find_profile("nowhere")


def test_the_command_writes_physics_that_can_be_played(tmp_path):
    path, out = tmp_path / "rows.csv", tmp_path / "mine.toml"
    write_rows(path, 0.0003, corner=True)
    words = ["fit-table", str(path), "--table", "ubc_pro", "--origin", "corner"]
    result = CliRunner().invoke(app, [*words, "--out", str(out)])
    assert result.exit_code == 0, result.output
    assert "not identifiable" in " ".join(result.output.split())
    played = Physics({}, given=load_physics(out))
    assert played.highest("wall_friction") == pytest.approx(0.2, abs=0.02)


def test_a_table_of_which_nothing_is_found_gets_no_file(tmp_path):
    path, out = tmp_path / "rows.csv", tmp_path / "mine.toml"
    path.write_text("t,x,y\n" + "".join(f"{k * 0.01},0.1,0\n" for k in range(100)))
    result = CliRunner().invoke(app, ["fit-table", str(path), "--out", str(out)])
    assert "no parameter of the table could be identified" in str(result.exception)
    assert not out.exists()


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("t,x\n0,1\n", "column 'y' is missing"),
        ("t,x,y\n0,1,a\n", "line 2: 'a'; expected a number"),
        ("t,x,y\n0,1,2\n", "1 rows; expected at least"),
        (
            "t,x,y\n" + "".join(f"{k * 0.1},0,0\n" for k in range(20)),
            "10 rows per second",
        ),
        (
            "t,x,y\n" + "".join(f"{k * 0.01},{k},0\n" for k in range(20)),
            r"row 2: the puck at \[2\.0, 0\.0\] m is off the table; .* in metres",
        ),
    ],
)
def test_what_is_wrong_with_a_file_is_said(tmp_path, text, error):
    path = tmp_path / "rows.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=error):
        read_track(path, TABLE)

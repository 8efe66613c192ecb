"""Laws of a table from rows t,x,y: those with which the puck was simulated."""

import numpy as np
import pytest
from typer.testing import CliRunner

from marl_airhockey.cli.main import app
from marl_airhockey.contracts.backend import Command
from marl_airhockey.core.parameters import PARAMETERS
from marl_airhockey.core.physics import Physics, load_physics
from marl_airhockey.core.scene import Scene
from marl_airhockey.core.seat import make_seat
from marl_airhockey.core.table import TABLES
from marl_airhockey.registry import find_backend
from marl_airhockey.transfer.table_fit import fit_table
from marl_airhockey.transfer.track import read_track

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


def test_the_command_writes_physics_that_can_be_played(tmp_path):
    path, out = tmp_path / "rows.csv", tmp_path / "mine.toml"
    write_rows(path, 0.0003, corner=True)
    words = ["fit", str(path), "--table", "ubc_pro", "--origin", "corner"]
    result = CliRunner().invoke(app, [*words, "--out", str(out)])
    assert result.exit_code == 0, result.output
    assert "not identifiable" in " ".join(result.output.split())
    played = Physics({}, given=load_physics(out))
    assert played.highest("wall_friction") == pytest.approx(0.2, abs=0.02)


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("t,x\n0,1\n", "column 'y' is missing"),
        ("t,x,y\n0,1,a\n", "line 2: expected numbers"),
        ("t,x,y\n0,1,2\n", "1 rows whose times must grow"),
        (
            "t,x,y\n" + "".join(f"{k * 0.1},0,0\n" for k in range(20)),
            "10 rows a second",
        ),
    ],
)
def test_what_is_wrong_with_a_file_is_said(tmp_path, text, error):
    path = tmp_path / "rows.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=error):
        read_track(path, TABLE)

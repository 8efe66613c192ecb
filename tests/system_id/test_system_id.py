"""Physics found from play: those with which it was played."""

import numpy as np
import pytest

from marl_airhockey.data.files import recordings_in
from marl_airhockey.play.live_match import RATE, LiveMatch
from marl_airhockey.play.open_table import open_table
from marl_airhockey.play.recorder import Recorder
from marl_airhockey.registry import make_driver
from marl_airhockey.sim.core.physics import load_physics
from marl_airhockey.system_id.recorded_play import load_recordings, record_play
from marl_airhockey.system_id.system_id import FITTED, fit_physics

pytest.importorskip("scipy")
OTHER = {
    "tilt": 4.8,
    "puck_damping": 0.4,
    "wall_restitution": 0.75,
    "paddle_restitution": 0.7,
}


def test_the_physics_of_another_table_are_found(tmp_path):
    table = {"backend": "pymunk", "physics": OTHER}
    seen = record_play("juggle", make_driver("zoo/juggle"), 1500, 0, table)
    found = fit_physics(seen)
    for name in FITTED:
        assert found.physics[name] == pytest.approx(OTHER[name], rel=0.12), name
    assert found.physics["action_delay"] < 0.003
    assert found.error_reduction > 0.8
    path = tmp_path / "fit.toml"
    path.write_text(found.to_toml())
    assert load_physics(path) == pytest.approx(found.physics, rel=1e-4)
    path.write_text("tilt =")
    with pytest.raises(ValueError, match="no TOML file"):
        load_physics(path)


def test_an_arm_is_nearer_to_the_fitted_table():
    pytest.importorskip("robosuite")
    there = {"backend": "robosuite", "physics": OTHER}
    seen = record_play("juggle", make_driver("zoo/juggle"), 1000, 0, there)
    found = fit_physics(seen)
    assert found.physics["tilt"] == pytest.approx(4.8, abs=0.2)
    assert found.error_reduction > 0.5


def test_recordings_are_fitted_to(tmp_path):
    seats = {"paddle_0": "striker"}
    match = LiveMatch("juggle", seats, {"physics": OTHER}, seed=0)
    session = open_table(match, Recorder(tmp_path))
    for _ in range(6):
        match.start()
        while match.phase != "done":
            session.tick()
        session.tick()
    seen = load_recordings(recordings_in([tmp_path]))
    assert seen.control_dt == pytest.approx(1 / RATE)
    assert not seen.follows[0]
    assert np.isfinite(seen.position).all()
    with pytest.raises(ValueError, match="one scenario are needed"):
        load_recordings([])
    found = fit_physics(seen)
    assert found.physics["tilt"] == pytest.approx(4.8, abs=0.1)
    with pytest.raises(ValueError, match="too few"):
        fit_physics(record_play("juggle", make_driver("striker"), 100, 0, {}))
    with pytest.raises(ValueError, match="blocks"):
        fit_physics(record_play("move_block", make_driver("striker"), 10, 0, {}))


def test_a_puck_that_is_served_is_not_fitted_to():
    drivers = {"paddle_1": "still"}
    options = {"drivers": drivers, "options": {"seats": "arcade"}}
    seen = record_play("duel", make_driver("striker"), 1500, 0, options)
    way = np.hypot(*np.diff(seen.position[:, 2], axis=0).T)
    served = np.flatnonzero(way > 0.4) + 1
    assert len(served) > 2
    for first in seen.segment_starts(5):
        assert not ((served > first) & (served <= first + 5)).any()

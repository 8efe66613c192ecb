"""Games that the page without a server has saved."""

import base64
import hashlib
import json

import numpy as np
import pytest

from marl_airhockey.build import build_world
from marl_airhockey.data.reader import read_recording
from marl_airhockey.data.saved_games import FORMAT, import_games

HEAD = {
    "format": FORMAT,
    "scenario": "juggle",
    "control_dt": 1 / 60,
    "players": [{"driver": "person", "handicap": {}, "person": "anonymous"}],
}
SEEDS = 3, 5
STEPS = 15


def write(path, steps=STEPS, reason="ended by a player", **changes):
    """Write saved games of random actions, with their hash."""
    rng = np.random.default_rng(0)
    actions = rng.uniform(-1.0, 1.0, (2, STEPS, 1, 2)).astype(np.float32)
    coded = base64.b64encode(actions.tobytes()).decode()
    episodes = [{"seed": seed, "steps": steps, "reason": reason} for seed in SEEDS]
    head = {**HEAD, "episodes": episodes, "actions": coded, **changes}
    line = json.dumps(head)
    digest = hashlib.sha256(line.encode())
    world = build_world("juggle", 1, False, {"control_dt": 1 / 60})
    for seed, rows in zip(SEEDS, actions, strict=True):
        world.reset(seed=seed)
        for row in rows:
            world.step(row[None].astype(float))
            state = world.state
            for array in (state.position, state.velocity, state.angle, state.spin):
                digest.update((array + 0.0).tobytes())
            digest.update((world.outcome["reward"] + 0.0).tobytes())
    path.write_text(f"{line}\n{digest.hexdigest()}\n")
    return actions


def test_a_saved_game_becomes_a_recording_with_its_actions(tmp_path):
    actions = write(tmp_path / "game.airhockey")
    out = import_games(tmp_path / "game.airhockey", tmp_path / "recording")
    recording = read_recording(out)
    assert recording.head["players"] == HEAD["players"]
    for episode, given in zip(recording.episodes, actions, strict=True):
        assert episode.reason == "ended by a player"
        np.testing.assert_array_equal(episode.columns["action"], given)


def test_a_saved_game_is_an_error_after_any_byte_has_changed(tmp_path):
    path = tmp_path / "game.airhockey"
    write(path)
    data = path.read_bytes()
    rng = np.random.default_rng(1)
    for at in rng.integers(0, len(data) - 1, 40):
        other = 32 + (data[at] - 31) % 90
        path.write_bytes(data[:at] + bytes([other]) + data[at + 1 :])
        with pytest.raises(ValueError, match=r"saved game|hash|scenario|control_dt"):
            import_games(path, tmp_path / "recording")
        assert not (tmp_path / "recording").exists()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"format": "another"}, "its format is 'another'"),
        ({"scenario": "chess"}, "chess"),
        ({"actions": "!"}, "not a saved game"),
        ({"players": HEAD["players"] * 2}, "not a saved game"),
        ({"players": [1]}, "not a saved game"),
        ({"actions": base64.b64encode(b"\xff" * 240).decode()}, "finite"),
        ({"steps": 0, "actions": ""}, "0 actions for episodes"),
        ({"steps": 14}, "30 actions for episodes"),
        ({"episodes": [{"seed": -1, "steps": 30, "reason": ""}]}, "seed"),
        ({"episodes": []}, "not a saved game"),
    ],
)
def test_other_content_is_an_error_that_names_the_reason(tmp_path, changes, words):
    path = tmp_path / "game.airhockey"
    write(path, **changes)
    with pytest.raises(ValueError, match=words):
        import_games(path, tmp_path / "recording")


def test_other_files_are_an_error_with_their_path(tmp_path):
    for name, content in {"empty": b"", "bytes": b"\xff\x00", "list": b"[]\n0"}.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(ValueError, match=f"{name}: this is not a saved game"):
            import_games(tmp_path / name, tmp_path / "recording")
    with pytest.raises(ValueError, match=r"none\.airhockey: No such file"):
        import_games(tmp_path / "none.airhockey", tmp_path / "recording")

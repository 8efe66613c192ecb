"""The page without a server: the same games in the browser as in Python."""

import base64
import hashlib
import json
import shutil
import subprocess
import time
import zipfile
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import numpy as np
import pytest
from helpers.modules import modules

from marl_airhockey.build import build_world
from marl_airhockey.data.reader import read_recording
from marl_airhockey.data.saved_games import FORMAT, import_games
from marl_airhockey.play.live_match import LiveMatch
from marl_airhockey.play.static_page import write_static_page
from marl_airhockey.policies.load import ZOO
from marl_airhockey.policies.numpy_policy import NumpyPolicy

NODE = shutil.which("node")
HELPERS = Path(__file__).parents[1] / "helpers"
GAMES = "duel", "juggle", "hit_goal"


def node(script, *words):
    """Parsed output of a script in Node."""
    words = [NODE, HELPERS / script, *map(str, words)]
    return json.loads(subprocess.run(words, check=True, capture_output=True).stdout)


@pytest.mark.skipif(NODE is None, reason="there is no Node")
@pytest.mark.parametrize("name", ["duel", "free_for_all", "strike_crowd"])
def test_policies_in_javascript_return_the_actions_of_python(name, tmp_path):
    policy = NumpyPolicy.load(ZOO / f"{name}.npz")
    size = len(policy.centre)
    rows = np.random.default_rng(0).normal(0.0, 1.0, (200, size)).astype(np.float32)
    (tmp_path / "rows").write_bytes(rows.tobytes())
    files = ZOO / f"{name}.npz", tmp_path / "rows"
    found = node("run_policy.mjs", modules(tmp_path), *files, size)
    wanted = [policy(row[None])[0] for row in rows]
    np.testing.assert_allclose(found, np.clip(wanted, -1.0, 1.0), atol=1e-6)


@pytest.mark.skipif(NODE is None, reason="there is no Node")
def test_a_file_that_is_no_policy_is_an_error_in_javascript(tmp_path):
    (tmp_path / "rows").write_bytes(b"")
    broken = {"text.npz": b"not a policy", "empty.npz": None}
    for name, content in broken.items():
        if content is None:
            with zipfile.ZipFile(tmp_path / name, "w"):
                pass
        else:
            (tmp_path / name).write_bytes(content)
        words = modules(tmp_path), tmp_path / name, tmp_path / "rows", 3
        with pytest.raises(subprocess.CalledProcessError) as error:
            node("run_policy.mjs", *words)
        assert b"Error: " in error.value.stderr


def test_a_folder_with_other_files_is_an_error(tmp_path):
    (tmp_path / "thesis.tex").write_text("")
    with pytest.raises(ValueError, match="the folder contains other files"):
        write_static_page(tmp_path, GAMES)


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """Folder of a page with a few games."""
    pytest.importorskip("ziglang")
    folder = tmp_path_factory.mktemp("page") / "play"
    write_static_page(folder, GAMES)
    return folder


AIM = [["aim", -0.55 + 0.1 * (k % 3), 0.1 * (k % 5 - 2)] for k in range(12)]
MESSAGES = {
    0: [["start"]],
    **{190 + 20 * k: [aim] for k, aim in enumerate(AIM)},
    215: [["pause", "a reason"]],
    225: [["start"]],
    700: [["start"]],
    800: [["abort", "ended by a player"]],
    810: [["clear"]],
    820: [["start"]],
}


@pytest.mark.slow
@pytest.mark.skipif(NODE is None, reason="there is no Node")
@pytest.mark.parametrize("name", GAMES)
def test_a_match_has_the_phases_and_frames_of_python(name, page, tmp_path):
    match = LiveMatch(name, {}, {}, seed=0)
    person = match.drivers.input_device(0, "mouse")
    wanted = []
    for k in range(700):
        for kind, *given in MESSAGES.get(k, []):
            (person.aim if kind == "aim" else getattr(match, kind))(*given)
        match.tick()
        wanted.append(match.state())
        if match.phase == "done":  # The next start differs.
            break
    script = json.dumps({"ticks": len(wanted), "messages": MESSAGES})
    found = node("run_match.mjs", modules(tmp_path), page, name, script)
    assert len(wanted) > 230
    for one, other in zip(found, wanted, strict=True):
        # Actions are rounded to float32 in the page, so that files are smaller.
        assert comparable(one) == comparable(json.loads(json.dumps(other)))
    assert {"countdown", "play", "pause"} <= {state["phase"] for state in found}


def comparable(value):
    """Return a value with numbers of 3 significant digits after the point."""
    if isinstance(value, dict):
        return {key: comparable(item) for key, item in value.items()}
    if isinstance(value, list):
        return [comparable(item) for item in value]
    return pytest.approx(value, abs=2e-3) if isinstance(value, float) else value


@contextmanager
def served(folder):
    """Yield the address of a folder, which a plain web server serves."""

    class Handler(SimpleHTTPRequestHandler):
        def log_message(self, *_):
            pass

    server = ThreadingHTTPServer(
        ("127.0.0.1", 0), partial(Handler, directory=str(folder))
    )
    Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()


def opened(browser, address, errors, requests):
    """A page with its first frame."""
    tab = browser.new_page(viewport={"width": 1100, "height": 700})
    tab.on("pageerror", lambda error: errors.append(str(error)))
    tab.on("console", lambda m: errors.append(m.text) if m.type == "error" else None)
    tab.on("request", lambda request: requests.append(request.url))
    tab.goto(address)
    tab.wait_for_function("window.airhockey && window.airhockey.state()")
    return tab


def play(tab, seconds):
    """Move the mouse until the clock of a match shows some seconds, and end it."""
    tab.keyboard.press("Space")
    end = time.monotonic() + 60.0
    k = 0
    while tab.evaluate("airhockey.state().time") < seconds:
        assert time.monotonic() < end
        k += 1
        tab.mouse.move(200 + 90 * (k % 3), 350 + 100 * ((k // 4) % 3 - 1))
        time.sleep(0.03)
    tab.evaluate("airhockey.table.match.abort('ended by a player')")


def saved(tab, path):
    """Save the games of the page as a file."""
    with tab.expect_download() as download:
        tab.get_by_text("Save the games").click()
    download.value.save_as(path)
    return path


def message(tab):
    tab.wait_for_selector(".message:not([hidden])")
    text = tab.inner_text(".message")
    tab.evaluate("document.querySelector('.message').hidden = true")
    return text


@pytest.mark.slow
def test_a_game_in_the_browser_has_the_hash_of_python(page, browser, tmp_path):
    errors, requests = [], []
    with served(page) as address:
        tab = opened(browser, address, errors, requests)
        play(tab, 12.0)
        path = saved(tab, tmp_path / "duel.airhockey")
        recording = read_recording(import_games(path, tmp_path / "recording"))
        (episode,) = recording.episodes
        assert len(episode) > 200
        assert np.abs(episode.columns["action"][:, 0]).max() > 0.1
        data = path.read_bytes().replace(b'"steps":', b'"steps":0,"steps":', 1)
        (tmp_path / "changed.airhockey").write_bytes(data)
        with pytest.raises(ValueError, match="hash"):
            import_games(tmp_path / "changed.airhockey", tmp_path / "other")
        tab.set_input_files("input[type=file]", tmp_path / "changed.airhockey")
        assert "its hash differs" in message(tab)
        tab.set_input_files("input[type=file]", path)
        assert "same hash" in message(tab)
        assert tab.evaluate("airhockey.state().seats[0].driver") == "person"
        tab.get_by_text("Close the replay").click()
        tab.get_by_text("Menu").click()
        tab.wait_for_selector("#start .ladder")
    assert errors == []
    assert all(url.startswith((address, "blob:")) for url in requests)


def games_of_policies(path, seeds):
    """Write saved games of two policies; return the number of steps."""
    actions, rows, numbers = [], [], []
    drivers = {"paddle_0": "zoo/duel", "paddle_1": "zoo/duel_3"}
    keywords = {"control_dt": 1 / 60}
    world = build_world("duel", 1, False, keywords)
    driven = build_world("duel", 1, False, {**keywords, "drivers": drivers})
    for seed in range(seeds):
        driven.reset(seed=seed)
        world.reset(seed=seed)
        over = False
        count = len(actions)
        while not over:
            result = driven.step(np.zeros((1, 0, 2)))
            actions.append(driven.action.astype(np.float32))
            world.step(actions[-1].astype(float))
            state = world.state
            parts = state.position, state.velocity, state.angle, state.spin
            numbers += [*(part + 0.0 for part in parts), world.outcome["reward"] + 0.0]
            over = bool(result.terminated[0] | result.truncated[0])
        steps = len(actions) - count
        rows.append({"seed": seed, "steps": steps, "reason": "played to the end"})
    players = [{"driver": name, "handicap": {}, "person": None} for name in drivers]
    coded = base64.b64encode(np.array(actions).tobytes()).decode()
    head = {"format": FORMAT, "scenario": "duel", "control_dt": 1 / 60}
    line = json.dumps({**head, "players": players, "episodes": rows, "actions": coded})
    data = b"".join([line.encode(), *(n.tobytes() for n in numbers)])
    path.write_text(f"{line}\n{hashlib.sha256(data).hexdigest()}\n")
    return len(actions)


@pytest.mark.slow
def test_games_of_policies_in_python_have_the_same_hash_in_the_browser(
    page, browser, tmp_path
):
    path = tmp_path / "games.airhockey"
    assert games_of_policies(path, 8) > 10_000
    with served(page) as address:
        tab = opened(browser, address, [], [])
        tab.set_input_files("input[type=file]", path)
        assert "same hash" in message(tab)


@pytest.mark.slow
def test_policies_can_be_dropped_on_the_page(page, browser, tmp_path):
    errors = []
    shutil.copy(ZOO / "duel_2.npz", tmp_path / "mine.npz")
    shutil.copy(ZOO / "juggle.npz", tmp_path / "other.npz")
    with served(page) as address:
        tab = opened(browser, address, errors, [])
        tab.set_input_files("input[type=file]", tmp_path / "mine.npz")
        assert message(tab) == "mine plays against you now."
        tab.wait_for_function("airhockey.state().seats[1].driver === 'mine'")
        tab.set_input_files("input[type=file]", tmp_path / "other.npz")
        assert "it was trained on juggle" in message(tab)
        play(tab, 5.0)
        assert tab.evaluate("airhockey.state().seats[1].driver") == "mine"
        tab.get_by_text("Menu").click()
        tab.get_by_text("Tasks").click()
        tab.wait_for_function("airhockey.table.match.seats.length === 1")
    assert errors == []

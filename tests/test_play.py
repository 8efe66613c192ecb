"""Playing in the browser: the match, the people at it, the server, the page."""

import asyncio
import contextlib
import json
import re
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request

import numpy as np
import pytest
import websockets
from pages import aim, line, page_at, running, state_of, wait
from PIL import Image

from marl_airhockey.evaluation.recordings import read
from marl_airhockey.play.handicap import PRESETS, Handicap
from marl_airhockey.play.live_match import RATE, LiveMatch
from marl_airhockey.play.measures import interceptions, reactions
from marl_airhockey.play.plots import plot_report
from marl_airhockey.play.protocol import BURST, LARGEST, RateLimiter, parse
from marl_airhockey.play.recorder import Recorder
from marl_airhockey.play.report import summarize
from marl_airhockey.play.server import listen as listen_at
from marl_airhockey.play.session import IDLE, Session
from marl_airhockey.play.video import write_recording_video
from marl_airhockey.registry import scenario_names

BAD = [
    "",
    "hello",
    "{",
    "[]",
    "1",
    "null",
    '"aim"',
    "{}",
    '{"t":"fly"}',
    '{"t":["aim"]}',
    '{"t":"aim"}',
    '{"t":"aim","x":0,"y":0,"q":1}',
    '{"t":"aim","x":0,"y":0,"q":1,"rtt":0,"z":1}',
    '{"t":"aim","x":NaN,"y":0,"q":1,"rtt":0}',
    '{"t":"aim","x":Infinity,"y":0,"q":1,"rtt":0}',
    '{"t":"aim","x":1e300,"y":0,"q":1,"rtt":0}',
    '{"t":"aim","x":"0","y":0,"q":1,"rtt":0}',
    '{"t":"aim","x":true,"y":0,"q":1,"rtt":0}',
    '{"t":"aim","x":0,"y":0,"q":-1,"rtt":0}',
    '{"t":"sit","seat":0.5}',
    '{"t":"hello","key":""}',
    '{"t":"hello","key":"' + "x" * 81 + '"}',
    "[" * 900,
    '{"t":"start","x":"' + "y" * LARGEST + '"}',
]


@pytest.mark.parametrize("text", BAD)
def test_a_bad_message_is_named(text):
    with pytest.raises(ValueError, match=r"\w"):
        parse(text)


def test_chatter_is_cut_short():
    limiter = RateLimiter(0.0)
    for _ in range(int(BURST)):
        limiter.acquire(0.0)
    with pytest.raises(ValueError, match="messages a second"):
        limiter.acquire(0.0)
    limiter.acquire(1.0)


@pytest.mark.parametrize("name", scenario_names())
def test_every_scenario_is_played_and_drawn(name):
    match = LiveMatch(name, {}, {}, seed=3)
    assert match.drivers.names == ["person"] * len(match.seats)
    match.start()
    for _ in range(4 * RATE):
        match.tick()
    assert match.ticks > 0
    assert json.loads(json.dumps(match.state()))["phase"] in ("play", "done")
    described = json.loads(json.dumps(match.describe()))
    assert len(described["seats"]) == len(match.seats)


def test_a_pointer_moves_its_paddle_and_stays_within_the_limits():
    match = LiveMatch("duel", {"paddle_0": "still"}, {}, seed=1)
    session = Session(match)
    client = session.connect()
    session.receive(client, line("hello", key="k"))
    assert client.seat == 1
    session.receive(client, aim(0.4, 0.2))
    session.receive(client, line("start"))
    for _ in range(5 * RATE):
        session.tick()
        speed = np.hypot(*match.world.state.paddle_velocity[0, 1])
        assert speed <= match.seats[1].speed + 1e-6
    np.testing.assert_allclose(match.world.state.paddle[0, 1], (0.4, 0.2), atol=0.01)
    session.receive(client, aim(-0.4, 0.0))
    for _ in range(RATE):
        session.tick()
    assert match.world.state.paddle[0, 1, 0] > 0.0, "not into the other's half"
    frame = json.loads(client.frame)
    assert frame["seat"] == 1
    assert frame["ack"] == 1


def test_a_stick_is_a_velocity():
    match = LiveMatch("duel", {"paddle_1": "still"}, {}, seed=1)
    session = Session(match)
    client = session.connect()
    session.receive(client, line("hello", key="k"))
    session.receive(client, line("start"))
    while match.phase != "play":
        session.tick()
    before = match.world.state.paddle[0, 0].copy()
    session.receive(client, line("stick", x=0.0, y=-0.5, q=1, rtt=0))
    for _ in range(6):
        session.tick()
    moved = match.world.state.paddle[0, 0] - before
    assert moved[1] < -0.02
    assert abs(moved[0]) < 1e-9
    session.receive(client, line("stick", x=0.05, y=0.0, q=2, rtt=0))
    for _ in range(20):
        session.tick()
    assert np.hypot(*match.world.state.paddle_velocity[0, 0]) < 1e-6, "dead zone"


def test_two_people_and_a_watcher():
    match = LiveMatch("duel", {}, {}, seed=1)
    session = Session(match)
    clients = [session.connect() for _ in range(3)]
    for i, client in enumerate(clients):
        session.receive(client, line("hello", key=str(i)))
    assert [client.seat for client in clients] == [0, 1, None]
    watcher = clients[2]
    session.disconnect(clients[1])
    session.receive(clients[0], line("start"))
    assert match.phase == "lobby", "a seat of people is free"
    clients[1] = session.connect()
    session.receive(clients[1], line("hello", key="1"))
    assert clients[1].seat == 1
    for text in (line("start"), line("swap"), aim(0, 0), line("sit", seat=0)):
        session.receive(watcher, text)
    assert match.phase == "lobby"
    assert watcher.seat is None
    session.receive(clients[1], line("start"))
    session.tick()
    assert match.phase == "countdown"
    assert json.loads(watcher.frame)["watching"] == 1
    session.disconnect(clients[0])
    assert match.phase == "pause"
    assert match.reason == "a player has gone"
    back = session.connect()
    session.receive(back, line("hello", key="0"))
    assert back.seat == 0, "a page that is loaded again gets its seat back"
    assert match.phase == "countdown"
    session.receive(back, line("pause"))
    session.disconnect(back)
    back = session.connect()
    session.receive(back, line("hello", key="0"))
    assert match.phase == "pause", "who paused goes on when they want"
    session.receive(back, line("stop"))
    assert match.phase == "done"
    session.receive(back, line("swap"))
    assert match.phase == "lobby"


def test_an_idle_page_loses_its_seat():
    session = Session(LiveMatch("duel", {}, {}, seed=1))
    client = session.connect()
    session.receive(client, line("hello", key="k"))
    session._check_presence(time.monotonic() + IDLE / 2)
    assert client.seat == 0
    session._check_presence(time.monotonic() + IDLE + 1)
    assert client.seat is None


def test_opponents_are_chosen_between_matches_and_ends_change():
    match = LiveMatch("duel", {"paddle_1": "zoo/duel"}, {}, seed=1)
    session = Session(match)
    client = session.connect()
    session.receive(client, line("hello", key="k"))
    session.receive(client, line("opponent", seat=1, name="../secret.zip"))
    assert match.drivers.names[1] == "zoo/duel", "only who is offered may play"
    session.receive(client, line("opponent", seat=1, name="allround:strength=weak"))
    assert match.drivers.names == ["person", "allround:strength=weak"]
    session.receive(client, line("handicap", name="gentle"))
    assert match.drivers.handicap == PRESETS["gentle"]
    session.receive(client, line("handicap", name="divine"))
    assert match.drivers.handicap == PRESETS["gentle"], "only what is offered"
    session.receive(client, line("swap"))
    assert match.drivers.names == ["allround:strength=weak", "person"]
    assert client.seat == 1
    session.receive(client, line("start"))
    for _ in range(4 * RATE):
        session.tick()
    session.receive(client, line("opponent", seat=0, name="still"))
    assert match.drivers.names[0] == "allround:strength=weak", "not during a match"
    with pytest.raises(ValueError, match="unknown driver"):
        LiveMatch("duel", {"paddle_1": "nobody"}, {})
    with pytest.raises(ValueError, match="say person"):
        LiveMatch("duel", {"paddle_1": "mouse"}, {})
    with pytest.raises(ValueError, match="path"):
        LiveMatch("duel", {"paddle_1": "policy"}, {})
    with pytest.raises(ValueError, match="paddle_7"):
        LiveMatch("duel", {"paddle_7": "still"}, {})


@pytest.mark.parametrize(
    ("game", "keywords", "fitting"),
    [
        ("duel", {}, ["zoo/duel"]),
        ("duel", {"options": {"pucks": 2}}, []),
        (
            "duel",
            {"options": {"seats": "robot"}, "profile": "robot"},
            ["zoo/duel_robot"],
        ),
        ("free_for_all", {"options": {"sides": 3}}, []),
        ("juggle", {}, ["zoo/juggle"]),
    ],
)
def test_policies_that_fit_are_offered(game, keywords, fitting):
    match = LiveMatch(game, {}, keywords, seed=0)
    assert match.drivers.fitting_policies == fitting
    for name in match.drivers.choices:
        match.set_driver(0, name)
    if not fitting:
        with pytest.raises(ValueError, match="expects observations"):
            match.set_driver(0, f"zoo/{game}")
        assert match.drivers.names[0] == match.drivers.choices[-1], (
            "who sat there still does"
        )


def test_a_match_whose_players_change_does_not_count(tmp_path):
    match = LiveMatch("duel", {"paddle_1": "still"}, {}, seed=1)
    session = Session(match, Recorder(tmp_path))
    first = session.connect()
    session.receive(first, line("hello", key="a"))
    session.receive(first, line("start"))
    for _ in range(5 * RATE):
        session.tick()
    session.receive(first, line("leave"))
    second = session.connect()
    session.receive(second, line("hello", key="b"))
    session.receive(second, line("start"))
    for _ in range(5 * RATE):
        session.tick()
    (path,) = tmp_path.iterdir()
    _, _, end = read(path)
    assert end["reason"] == "the players changed"


def test_a_match_ends_and_another_begins():
    options = {"options": {"seconds": 2.0}}
    match = LiveMatch("duel", {"paddle_0": "striker", "paddle_1": "still"}, options)
    for _ in range(2):
        match.start()
        while match.phase != "done":
            match.tick()
        assert match.ticks == 2 * RATE
    assert match.world.episode.number[0] == 2


def test_a_warm_up_leaves_no_trace():
    fresh = LiveMatch(
        "duel", {"paddle_0": "striker", "paddle_1": "zoo/duel"}, {}, seed=4
    )
    other = LiveMatch(
        "duel", {"paddle_0": "striker", "paddle_1": "zoo/duel"}, {}, seed=4
    )
    other.warm_up()
    for match in (fresh, other):
        match.start()
        for _ in range(6 * RATE):
            match.tick()
    assert fresh.state() == other.state()
    assert fresh.number == other.number == 1


def test_fair_opponents_act_late_and_slowly():
    def first_move(handicap):
        seats = {"paddle_0": "striker", "paddle_1": "still"}
        match = LiveMatch("duel", seats, {}, handicap, seed=2)
        match.start()
        fastest, began = 0.0, None
        for tick in range(6 * RATE):
            match.tick()
            speed = float(np.hypot(*match.world.state.paddle_velocity[0, 0]))
            fastest = max(fastest, speed)
            if began is None and speed > 0.01:
                began = tick
        return began, fastest

    at_once, fast = first_move(Handicap())
    late, slow = first_move(Handicap(reaction=0.2, pace=0.3))
    assert late - at_once == pytest.approx(0.2 * RATE, abs=1)
    assert slow <= 0.3 * 2.5 + 1e-6 < fast
    with pytest.raises(ValueError, match="reaction"):
        Handicap(reaction=2.0)


def test_an_episode_is_recorded_step_by_step(tmp_path):
    options = {"options": {"seconds": 2.0}, "backend": "numba"}
    match = LiveMatch("duel", {"paddle_1": "striker"}, options, seed=5)
    session = Session(match, Recorder(tmp_path))
    client = session.connect()
    session.receive(client, line("hello", key="k"))
    session.receive(client, aim(-0.3, 0.1))
    session.receive(client, line("start"))
    while match.phase != "done":
        session.tick()
    (path,) = tmp_path.iterdir()
    meta, steps, end = read(path)
    assert meta["players"][0] == {
        "seat": 0,
        "driver": "person",
        "person": client.name,
        "consent": None,
    }
    assert meta["physics"]["tilt"] == 0.0
    assert len(steps) == 2 * RATE == end["steps"]
    assert steps[-1]["n"] == 2 * RATE
    assert set(steps[0]) >= {"action", "command", "terms", "clock", "delays", "paddles"}
    np.testing.assert_allclose(
        steps[-1]["paddles"], match.world.state.paddle[0], atol=1e-4
    )
    write_recording_video(path, tmp_path / "game.gif")
    with Image.open(tmp_path / "game.gif") as video:
        assert video.n_frames == RATE
    rows = path.read_text().splitlines()
    path.write_text("\n".join([rows[0], '{"kind":"step","n":1}']))
    with pytest.raises(ValueError, match="line 2 lacks"):
        read(path)
    path.write_text(rows[0].replace('"format":2', '"format":1'))
    with pytest.raises(ValueError, match=f"{path.name}: recorded by an older version"):
        read(path)
    path.write_text(rows[0])
    with pytest.raises(ValueError, match="no steps"):
        write_recording_video(path, tmp_path / "game.gif")
    path.write_bytes(b"\xff\x00")
    with pytest.raises(ValueError, match="cannot be read"):
        read(path)
    path.write_text("nothing")
    with pytest.raises(ValueError, match="no recording"):
        read(path)


def test_recordings_become_a_report(tmp_path):
    for seed in range(3):
        seats = {"paddle_0": "person", "paddle_1": "striker:strength=fair"}
        options = {"options": {"seconds": 6.0}}
        match = LiveMatch("duel", seats, options, seed=seed)
        session = Session(match, Recorder(tmp_path))
        client = session.connect()
        session.receive(client, line("hello", key="alice"))
        session.receive(client, line("start"))
        while match.phase != "done":
            _, y = match.world.state.puck[0, 0]
            client.limiter = RateLimiter(time.monotonic())
            session.receive(client, aim(-0.6, float(y)))
            session.tick()
    match.start()
    for _ in range(4 * RATE):
        session.tick()
    session.recorder.end(match, "a player has left")
    found = summarize(tmp_path)
    assert found.episodes == 4
    assert found.broken_off == 1
    person = found.players[client.name]
    assert person.person
    assert person.games == 3 == found.players["striker:strength=fair"].games
    assert len(found.games) == 3
    assert person.steps > 3 * 6 * RATE
    assert found.players["striker:strength=fair"].shot_speeds
    files = found.save(tmp_path / "out")
    files.append(tmp_path / "out" / "report.png")
    plot_report(found, files[-1])
    assert all(path.stat().st_size > 100 for path in files)
    data = json.loads(files[0].read_text())
    assert {row["player"] for row in data["players"]} == set(found.players)
    with pytest.raises(ValueError, match="no recordings"):
        summarize(tmp_path / "out")


def test_reactions_and_interceptions_are_measured_right():
    n, dt = 120, 1 / RATE
    place = np.zeros((n, 2))
    place[:20] = (0.8, 0.0)
    place[20:, 0] = -0.5 * dt * np.arange(n - 20)
    motion = np.zeros((n, 2))
    motion[20:, 0] = -0.5
    speed = np.zeros(n)
    speed[20 + 15 :] = 0.5
    assert list(reactions(place, motion, speed, dt)) == [pytest.approx(0.25)]
    speed[:] = 0.5
    assert list(reactions(place, motion, speed, dt)) == [], "who moves does not react"
    hits = np.zeros(n, bool)
    hits[90] = True
    motion[90:, 0] = 1.0
    assert list(interceptions(place, motion, hits)) == [True]
    assert list(interceptions(place, motion, hits & False)) == [False]


@contextlib.contextmanager
def served(*options):
    """The address of a running `airhockey play`, and its process."""
    options = ("play", *options, "--port", "0", "--no-browser")
    with running(*options) as (address, process):
        yield address, process


def socket_of(address):
    return address.replace("http", "ws").replace("/?", "/ws?").rstrip("/") + (
        "" if "?" in address else "/ws"
    )


async def newest(socket, wanted="state"):
    while True:
        data = json.loads(await asyncio.wait_for(socket.recv(), 5))
        if data["t"] == wanted:
            return data


async def listen(socket):
    while True:
        await asyncio.wait_for(socket.recv(), 5)


async def chatter(socket):
    for q in range(5000):
        await socket.send(aim(0, 0, q))
    await listen(socket)


def test_frames_are_not_held_back_for_acknowledgements():
    async def option_of_a_connection():
        loop, server_socket = asyncio.get_running_loop(), listen_at("127.0.0.1", 0)
        taken = loop.create_future()

        class Taker(asyncio.Protocol):
            def connection_made(self, transport):
                taken.set_result(transport)

        server = await loop.create_server(Taker, sock=server_socket)
        with socket.create_connection(server_socket.getsockname()):
            transport = await taken
            accepted = transport.get_extra_info("socket")
            found = accepted.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
            transport.abort()
        server.close()
        await server.wait_closed()
        return found

    assert asyncio.run(option_of_a_connection())


def test_bad_clients_do_not_disturb_a_game():
    async def mischief(url):
        async with websockets.connect(url) as player:
            await player.send(line("hello", key="player"))
            await player.send(line("start"))
            while (await newest(player))["n"] < 3:
                pass
            watcher = await websockets.connect(url)  # that never reads
            for i in range(200):
                bad = await websockets.connect(url)
                text = BAD[i % len(BAD)] if i % 21 else b"\x00\xff"
                if i % 23 == 0:
                    text = "x" * 100_000
                await bad.send(text)
                with pytest.raises(websockets.ConnectionClosed):
                    await listen(bad)
            noisy = await websockets.connect(url)
            with pytest.raises(websockets.ConnectionClosed):
                await chatter(noisy)
            for _ in range(50):
                dropped = await websockets.connect(url)
                dropped.transport.abort()
            before = await newest(player)
            await player.send(aim(-0.3, 0.1, 9))
            while (state := await newest(player))["ack"] != 9:
                pass
            assert state["n"] > before["n"]
            assert state["phase"] == "play"
            watcher.transport.abort()

    with served("duel", "--opponent", "still", "--option", "seconds=600") as (at, _):
        asyncio.run(mischief(socket_of(at)))


def test_strangers_are_kept_out():
    with served("duel", "--opponent", "still") as (address, _):
        for headers in ({"Host": "evil.example"}, {"Origin": "http://evil.example"}):
            request = urllib.request.Request(address, headers=headers)
            with pytest.raises(urllib.error.HTTPError, match="403"):
                urllib.request.urlopen(request)

        async def cross_site():
            with pytest.raises(websockets.InvalidStatus, match="403"):
                await websockets.connect(
                    socket_of(address), origin="http://evil.example"
                )

        asyncio.run(cross_site())
    with served("duel", "--opponent", "still", "--host", "0.0.0.0") as (address, _):
        assert "token=" in address
        near = re.sub(r"//[^:]+", "//127.0.0.1", address)
        assert b"canvas" in urllib.request.urlopen(near).read()
        for link in (near.partition("?")[0], near[:-3] + "abc"):
            with pytest.raises(urllib.error.HTTPError, match="403"):
                urllib.request.urlopen(link)


def test_a_killed_server_loses_no_second_of_a_recording(tmp_path):
    async def play(url):
        async with websockets.connect(url) as player:
            await player.send(line("hello", key="player"))
            await player.send(line("start"))
            while (state := await newest(player))["n"] < 90:
                pass
            return state["n"]

    with served("duel", "--opponent", "still", "--record", str(tmp_path)) as (at, it):
        shown = asyncio.run(play(socket_of(at)))
        it.kill()
        it.wait(10)
    (path,) = tmp_path.iterdir()
    _, steps, end = read(path)
    assert end == {}
    assert steps[-1]["n"] >= shown - RATE


def test_a_taken_port_is_named():
    with served("duel", "--opponent", "still") as (address, _):
        port = re.search(r":(\d+)/", address)[1]
        command = [sys.executable, "-m", "marl_airhockey.cli", "play", "duel"]
        done = subprocess.run(
            [*command, "--port", port], capture_output=True, text=True, check=False
        )
    assert done.returncode == 1
    assert f"--port {port}" in done.stderr
    for bad in (["--port", "99999"], ["--reaction", "900"], ["--opponent", "policy"]):
        done = subprocess.run(
            [*command, *bad], capture_output=True, text=True, check=False
        )
        assert done.returncode in (1, 2)
        assert "Traceback" not in done.stderr


def test_a_person_plays_in_the_browser(browser):
    complaints = []
    with served("duel", "--opponent", "still", "--option", "goals_to_win=1") as (at, _):
        page = page_at(browser, at, complaints)
        watcher = page_at(browser, at, complaints, color_scheme="dark")
        assert state_of(page)["seat"] == 0
        assert state_of(watcher)["seat"] is None
        page.keyboard.press("Space")
        wait(page, "s.phase === 'play'")
        box = page.locator("#table").bounding_box()
        metre = box["width"] / 1.82
        middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

        def point(x, y):
            page.mouse.move(middle[0] + x * metre, middle[1] - y * metre)

        point(-0.5, 0.15)
        wait(page, "Math.hypot(s.paddles[0][0] + 0.5, s.paddles[0][1] - 0.15) < 0.03")
        began = time.monotonic()
        while (state := state_of(page))["phase"] == "play":
            # Get behind the puck, then through it.
            x, y = state["pucks"][0][:2]
            behind = state["paddles"][0][0] < x - 0.06
            point(min(x, -0.06) if behind else x - 0.2, y)
            page.wait_for_timeout(16)
            assert time.monotonic() - began < 55, "no goal against nobody"
        wait(page, "s.phase === 'done'")
        assert state["caption"].startswith("goals")
        assert page.locator("#headline").inner_text() in ("You win!", "You lose")
        assert state_of(watcher)["phase"] == "done"
        page.locator("#go").click()
        wait(page, "s.phase === 'play' && s.n < 60")
        page.reload()
        page.wait_for_function("window.airhockey.frames.length > 5")
        wait(page, "s.seat === 0 && s.phase === 'play'")
        page.close()
        wait(watcher, "s.phase === 'pause'")
        watcher.close()
    assert not complaints


def test_a_phone_plays_upright(browser):
    complaints = []
    with served("juggle") as (address, _):
        page = page_at(browser, address, complaints, color_scheme="dark")
        page.set_viewport_size({"width": 390, "height": 760})
        page.locator("#go").click()
        wait(page, "s.phase === 'play'")
        box = page.locator("#table").bounding_box()
        x, y = box["x"] + box["width"] * 0.5, box["y"] + box["height"] * 0.8
        page.mouse.move(x, y)
        wait(page, "Math.abs(s.paddles[0][1]) < 0.03 && s.ack > 0")
        page.close()
    assert not complaints


def test_a_recording_is_watched_in_the_page(browser, tmp_path):
    match = LiveMatch("duel", {"paddle_0": "striker", "paddle_1": "still"}, {}, seed=1)
    session = Session(match, Recorder(tmp_path))
    match.start()
    for _ in range(8 * RATE):
        session.tick()
    session.recorder.end(match, "enough")
    (path,) = tmp_path.iterdir()
    complaints = []
    with running("watch", str(path)) as (address, _):
        page = page_at(browser, address, complaints)
        wait(page, "s.n > 30")
        page.locator("#pause").click()
        page.locator("#scrub").fill("200")
        wait(page, "s.n === 200")
        page.locator("#speed").select_option("4")
        page.locator("#pause").click()
        wait(page, "s.n > 260")
        page.get_by_text("Broken off").wait_for()
        page.locator("#scrub").fill("0")
        wait(page, "s.n === 0")
        page.locator("#scrub").fill(page.locator("#scrub").get_attribute("max"))
        page.get_by_text("Broken off").wait_for()
        page.get_by_text("enough").wait_for()
        page.close()
    assert not complaints

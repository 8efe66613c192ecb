"""Playing in the browser: the court, the people at it, the server, the page."""

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
from marl_airhockey.play.handicap import STRENGTHS, Fairness
from marl_airhockey.play.live_match import RATE, Court
from marl_airhockey.play.measures import _comes, _reactions
from marl_airhockey.play.protocol import BURST, LARGEST, Meter, parse
from marl_airhockey.play.recorder import Recorder
from marl_airhockey.play.report import report
from marl_airhockey.play.server import listen as listen_at
from marl_airhockey.play.session import IDLE, Session
from marl_airhockey.play.video import film
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
    meter = Meter(0.0)
    for _ in range(int(BURST)):
        meter.take(0.0)
    with pytest.raises(ValueError, match="messages a second"):
        meter.take(0.0)
    meter.take(1.0)


@pytest.mark.parametrize("name", scenario_names())
def test_every_scenario_is_played_and_drawn(name):
    court = Court(name, {}, {}, seed=3)
    assert court.who == ["person"] * len(court.seats)
    court.start()
    for _ in range(4 * RATE):
        court.tick()
    assert court.ticks > 0
    assert json.loads(json.dumps(court.state()))["phase"] in ("play", "done")
    described = json.loads(json.dumps(court.describe()))
    assert len(described["seats"]) == len(court.seats)


def test_a_pointer_moves_its_paddle_and_stays_within_the_limits():
    court = Court("duel", {"paddle_0": "still"}, {}, seed=1)
    session = Session(court)
    guest = session.join()
    session.hear(guest, line("hello", key="k"))
    assert guest.seat == 1
    session.hear(guest, aim(0.4, 0.2))
    session.hear(guest, line("start"))
    for _ in range(5 * RATE):
        session.tick()
        speed = np.hypot(*court.world.state.paddle_velocity[0, 1])
        assert speed <= court.seats[1].speed + 1e-6
    np.testing.assert_allclose(court.world.state.paddle[0, 1], (0.4, 0.2), atol=0.01)
    session.hear(guest, aim(-0.4, 0.0))
    for _ in range(RATE):
        session.tick()
    assert court.world.state.paddle[0, 1, 0] > 0.0, "not into the other's half"
    frame = json.loads(guest.frame)
    assert frame["seat"] == 1
    assert frame["ack"] == 1


def test_a_stick_is_a_velocity():
    court = Court("duel", {"paddle_1": "still"}, {}, seed=1)
    session = Session(court)
    guest = session.join()
    session.hear(guest, line("hello", key="k"))
    session.hear(guest, line("start"))
    while court.phase != "play":
        session.tick()
    before = court.world.state.paddle[0, 0].copy()
    session.hear(guest, line("stick", x=0.0, y=-0.5, q=1, rtt=0))
    for _ in range(6):
        session.tick()
    moved = court.world.state.paddle[0, 0] - before
    assert moved[1] < -0.02
    assert abs(moved[0]) < 1e-9
    session.hear(guest, line("stick", x=0.05, y=0.0, q=2, rtt=0))
    for _ in range(20):
        session.tick()
    assert np.hypot(*court.world.state.paddle_velocity[0, 0]) < 1e-6, "dead zone"


def test_two_people_and_a_watcher():
    court = Court("duel", {}, {}, seed=1)
    session = Session(court)
    guests = [session.join() for _ in range(3)]
    for i, guest in enumerate(guests):
        session.hear(guest, line("hello", key=str(i)))
    assert [guest.seat for guest in guests] == [0, 1, None]
    watcher = guests[2]
    session.part(guests[1])
    session.hear(guests[0], line("start"))
    assert court.phase == "lobby", "a seat of people is free"
    guests[1] = session.join()
    session.hear(guests[1], line("hello", key="1"))
    assert guests[1].seat == 1
    for text in (line("start"), line("swap"), aim(0, 0), line("sit", seat=0)):
        session.hear(watcher, text)
    assert court.phase == "lobby"
    assert watcher.seat is None
    session.hear(guests[1], line("start"))
    session.tick()
    assert court.phase == "countdown"
    assert json.loads(watcher.frame)["watching"] == 1
    session.part(guests[0])
    assert court.phase == "pause"
    assert court.reason == "a player has gone"
    back = session.join()
    session.hear(back, line("hello", key="0"))
    assert back.seat == 0, "a page that is loaded again gets its seat back"
    assert court.phase == "countdown"
    session.hear(back, line("pause"))
    session.part(back)
    back = session.join()
    session.hear(back, line("hello", key="0"))
    assert court.phase == "pause", "who paused goes on when they want"
    session.hear(back, line("stop"))
    assert court.phase == "done"
    session.hear(back, line("swap"))
    assert court.phase == "lobby"


def test_an_idle_page_lets_go_of_its_seat():
    session = Session(Court("duel", {}, {}, seed=1))
    guest = session.join()
    session.hear(guest, line("hello", key="k"))
    session._let_go(time.monotonic() + IDLE / 2)
    assert guest.seat == 0
    session._let_go(time.monotonic() + IDLE + 1)
    assert guest.seat is None


def test_opponents_are_chosen_between_matches_and_ends_change():
    court = Court("duel", {"paddle_1": "zoo/duel"}, {}, seed=1)
    session = Session(court)
    guest = session.join()
    session.hear(guest, line("hello", key="k"))
    session.hear(guest, line("opponent", seat=1, name="../secret.zip"))
    assert court.who[1] == "zoo/duel", "only who is offered may be asked"
    session.hear(guest, line("opponent", seat=1, name="allround:strength=weak"))
    assert court.who == ["person", "allround:strength=weak"]
    session.hear(guest, line("strength", name="gentle"))
    assert court.fairness == STRENGTHS["gentle"]
    session.hear(guest, line("strength", name="divine"))
    assert court.fairness == STRENGTHS["gentle"], "only what is offered"
    session.hear(guest, line("swap"))
    assert court.who == ["allround:strength=weak", "person"]
    assert guest.seat == 1
    session.hear(guest, line("start"))
    for _ in range(4 * RATE):
        session.tick()
    session.hear(guest, line("opponent", seat=0, name="still"))
    assert court.who[0] == "allround:strength=weak", "not during a match"
    with pytest.raises(ValueError, match="unknown driver"):
        Court("duel", {"paddle_1": "nobody"}, {})
    with pytest.raises(ValueError, match="say person"):
        Court("duel", {"paddle_1": "mouse"}, {})
    with pytest.raises(ValueError, match="path"):
        Court("duel", {"paddle_1": "policy"}, {})
    with pytest.raises(ValueError, match="paddle_7"):
        Court("duel", {"paddle_7": "still"}, {})


@pytest.mark.parametrize(
    ("game", "keywords", "house"),
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
def test_the_house_offers_who_can_play(game, keywords, house):
    court = Court(game, {}, keywords, seed=0)
    assert court.house == house
    for name in court.choices:
        court.seat(0, name)
    if not house:
        with pytest.raises(ValueError, match="expects observations"):
            court.seat(0, f"zoo/{game}")
        assert court.who[0] == court.choices[-1], "who sat there still does"


def test_a_match_whose_players_change_does_not_count(tmp_path):
    court = Court("duel", {"paddle_1": "still"}, {}, seed=1)
    session = Session(court, Recorder(tmp_path))
    first = session.join()
    session.hear(first, line("hello", key="a"))
    session.hear(first, line("start"))
    for _ in range(5 * RATE):
        session.tick()
    session.hear(first, line("leave"))
    second = session.join()
    session.hear(second, line("hello", key="b"))
    session.hear(second, line("start"))
    for _ in range(5 * RATE):
        session.tick()
    (path,) = tmp_path.iterdir()
    _, _, end = read(path)
    assert end["reason"] == "the players changed"


def test_a_match_ends_and_another_begins():
    options = {"options": {"seconds": 2.0}}
    court = Court("duel", {"paddle_0": "striker", "paddle_1": "still"}, options)
    for _ in range(2):
        court.start()
        while court.phase != "done":
            court.tick()
        assert court.ticks == 2 * RATE
    assert court.world.episode.number[0] == 2


def test_a_rehearsal_leaves_no_trace():
    fresh = Court("duel", {"paddle_0": "striker", "paddle_1": "zoo/duel"}, {}, seed=4)
    other = Court("duel", {"paddle_0": "striker", "paddle_1": "zoo/duel"}, {}, seed=4)
    other.rehearse()
    for court in (fresh, other):
        court.start()
        for _ in range(6 * RATE):
            court.tick()
    assert fresh.state() == other.state()
    assert fresh.number == other.number == 1


def test_fair_opponents_act_late_and_slowly():
    def first_move(fairness):
        seats = {"paddle_0": "striker", "paddle_1": "still"}
        court = Court("duel", seats, {}, fairness, seed=2)
        court.start()
        fastest, began = 0.0, None
        for tick in range(6 * RATE):
            court.tick()
            speed = float(np.hypot(*court.world.state.paddle_velocity[0, 0]))
            fastest = max(fastest, speed)
            if began is None and speed > 0.01:
                began = tick
        return began, fastest

    at_once, fast = first_move(Fairness())
    late, slow = first_move(Fairness(reaction=0.2, pace=0.3))
    assert late - at_once == pytest.approx(0.2 * RATE, abs=1)
    assert slow <= 0.3 * 2.5 + 1e-6 < fast
    with pytest.raises(ValueError, match="reaction"):
        Fairness(reaction=2.0).hold(Court("duel", {}, {})._hands[0])


def test_an_episode_is_recorded_step_by_step(tmp_path):
    options = {"options": {"seconds": 2.0}, "backend": "numba"}
    court = Court("duel", {"paddle_1": "striker"}, options, seed=5)
    session = Session(court, Recorder(tmp_path))
    guest = session.join()
    session.hear(guest, line("hello", key="k"))
    session.hear(guest, aim(-0.3, 0.1))
    session.hear(guest, line("start"))
    while court.phase != "done":
        session.tick()
    (path,) = tmp_path.iterdir()
    meta, steps, end = read(path)
    assert meta["players"][0] == {
        "seat": 0,
        "driver": "person",
        "person": guest.name,
        "consent": None,
    }
    assert meta["physics"]["tilt"] == 0.0
    assert len(steps) == 2 * RATE == end["steps"]
    assert steps[-1]["n"] == 2 * RATE
    assert set(steps[0]) >= {"asked", "sent", "terms", "clock", "delays", "pads"}
    np.testing.assert_allclose(
        steps[-1]["pads"], court.world.state.paddle[0], atol=1e-4
    )
    film(path, tmp_path / "game.gif")
    with Image.open(tmp_path / "game.gif") as video:
        assert video.n_frames == RATE
    rows = path.read_text().splitlines()
    path.write_text("\n".join([rows[0], '{"kind":"step","n":1}']))
    with pytest.raises(ValueError, match="line 2 lacks"):
        read(path)
    path.write_text(rows[0])
    with pytest.raises(ValueError, match="no steps"):
        film(path, tmp_path / "game.gif")
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
        court = Court("duel", seats, options, seed=seed)
        session = Session(court, Recorder(tmp_path))
        guest = session.join()
        session.hear(guest, line("hello", key="alice"))
        session.hear(guest, line("start"))
        while court.phase != "done":
            _, y = court.world.state.puck[0, 0]
            guest.meter = Meter(time.monotonic())
            session.hear(guest, aim(-0.6, float(y)))
            session.tick()
    court.start()
    for _ in range(4 * RATE):
        session.tick()
    session.recorder.end(court, "a player has left")
    found = report(tmp_path)
    assert found.episodes == 4
    assert found.broken_off == 1
    person = found.players[guest.name]
    assert person.person
    assert person.games == 3 == found.players["striker:strength=fair"].games
    assert len(found.games) == 3
    assert person.steps > 3 * 6 * RATE
    assert found.players["striker:strength=fair"].shots
    files = found.save(tmp_path / "out")
    assert all(path.stat().st_size > 100 for path in files)
    data = json.loads(files[0].read_text())
    assert {row["player"] for row in data["players"]} == set(found.players)
    with pytest.raises(ValueError, match="no recordings"):
        report(tmp_path / "out")


def test_reactions_and_met_pucks_are_measured_right():
    n, dt = 120, 1 / RATE
    place = np.zeros((n, 2))
    place[:20] = (0.8, 0.0)
    place[20:, 0] = -0.5 * dt * np.arange(n - 20)
    motion = np.zeros((n, 2))
    motion[20:, 0] = -0.5
    speed = np.zeros(n)
    speed[20 + 15 :] = 0.5
    assert list(_reactions(place, motion, speed, dt)) == [pytest.approx(0.25)]
    speed[:] = 0.5
    assert list(_reactions(place, motion, speed, dt)) == [], "who moves does not react"
    hits = np.zeros(n, bool)
    hits[90] = True
    motion[90:, 0] = 1.0
    assert list(_comes(place, motion, hits)) == [True]
    assert list(_comes(place, motion, hits & False)) == [False]


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


def test_bad_guests_do_not_disturb_a_game():
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
        wait(page, "Math.hypot(s.pads[0][0] + 0.5, s.pads[0][1] - 0.15) < 0.03")
        began = time.monotonic()
        while (state := state_of(page))["phase"] == "play":
            # Get behind the puck, then through it.
            x, y = state["pucks"][0][:2]
            behind = state["pads"][0][0] < x - 0.06
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
        wait(page, "Math.abs(s.pads[0][1]) < 0.03 && s.ack > 0")
        page.close()
    assert not complaints


def test_a_recording_is_watched_in_the_page(browser, tmp_path):
    court = Court("duel", {"paddle_0": "striker", "paddle_1": "still"}, {}, seed=1)
    session = Session(court, Recorder(tmp_path))
    court.start()
    for _ in range(8 * RATE):
        session.tick()
    session.recorder.end(court, "enough")
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

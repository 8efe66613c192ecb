"""The server of a match: messages, bad clients, access, a kill."""

import asyncio
import json
import re
import socket
import subprocess
import sys
import urllib.error
import urllib.request

import pytest
import websockets
from command import airhockey
from pages import aim, line, served

from marl_airhockey.data.reader import read_recording
from marl_airhockey.play.connections import listen as listen_at
from marl_airhockey.play.live_match import RATE
from marl_airhockey.play.protocol import BURST, LARGEST, RateLimiter, parse

BAD = {
    "": "not JSON",
    "hello": "not JSON",
    "{": "not JSON",
    "[" * 900: "not JSON",
    "[]": "t: must be one of hello, seen,",
    "1": "t: must be one of",
    "null": "t: must be one of",
    '"aim"': "t: must be one of",
    "{}": "t: must be one of",
    '{"t":"fly"}': "t: must be one of",
    '{"t":["aim"]}': "t: must be one of",
    '{"t":"aim"}': "aim: fields must be ['held', 'q', 'rtt', 'x', 'y']",
    '{"t":"aim","x":0,"y":0,"q":1}': "aim: fields must be",
    '{"t":"aim","x":0,"y":0,"held":0,"q":1,"rtt":0,"z":1}': "aim: fields must be",
    '{"t":"aim","x":NaN,"y":0,"held":0,"q":1,"rtt":0}': "NaN is not a number",
    '{"t":"aim","x":Infinity,"y":0,"held":0,"q":1,"rtt":0}': "Infinity is not a number",
    '{"t":"aim","x":1e300,"y":0,"held":0,"q":1,"rtt":0}': "x: must be a number",
    '{"t":"aim","x":"0","y":0,"held":0,"q":1,"rtt":0}': "x: must be a number",
    '{"t":"aim","x":true,"y":0,"held":0,"q":1,"rtt":0}': "x: must be a number",
    '{"t":"aim","x":0,"y":0,"held":0,"q":-1,"rtt":0}': "q: must be a whole number",
    '{"t":"sit","seat":0.5}': "seat: must be a whole number",
    '{"t":"hello","key":""}': "key: must be 1 to 80 characters",
    '{"t":"hello","key":"' + "x" * 81 + '"}': "key: must be 1 to 80 characters",
    '{"t":"start","x":"' + "y" * LARGEST + '"}': f"at most {LARGEST} characters",
}
"""Messages that are refused, and what is said of them."""


@pytest.mark.parametrize(("text", "complaint"), BAD.items())
def test_a_bad_message_is_named(text, complaint):
    with pytest.raises(ValueError, match=re.escape(complaint)):
        parse(text)


def test_chatter_is_cut_short():
    limiter = RateLimiter(0.0)
    for _ in range(int(BURST)):
        limiter.acquire(0.0)
    with pytest.raises(ValueError, match="messages per second"):
        limiter.acquire(0.0)
    limiter.acquire(1.0)


def socket_of(address):
    return address.replace("http", "ws").replace("/?", "/ws?").rstrip("/") + (
        "" if "?" in address else "/ws"
    )


async def newest(socket, wanted="state"):
    while True:
        data = json.loads(await asyncio.wait_for(socket.recv(), 5))
        if data["t"] == wanted:
            return data


async def collect(socket, frames):
    while True:
        frames.append(await newest(socket))
        await socket.send(line("seen", f=frames[-1]["f"]))


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


@pytest.mark.slow
def test_bad_clients_do_not_disturb_a_game():
    texts = list(BAD)

    async def mischief(url):
        async with websockets.connect(url) as player:
            await player.send(line("hello", key="player"))
            await player.send(line("start"))
            frames = []
            reader = asyncio.create_task(collect(player, frames))
            while not frames or frames[-1]["n"] < 3:
                await asyncio.sleep(0.02)
            watcher = await websockets.connect(url)  # that never reads
            for i in range(200):
                bad = await websockets.connect(url)
                text = texts[i % len(texts)] if i % 21 else b"\x00\xff"
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
            before = frames[-1]
            await player.send(aim(-0.3, 0.1, 9))
            while (state := frames[-1])["ack"] != 9:
                await asyncio.sleep(0.02)
            assert state["n"] > before["n"]
            assert state["phase"] == "play"
            reader.cancel()
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
    (episode,) = read_recording(path).episodes
    assert episode.reason == ""
    assert len(episode) >= shown - RATE


def test_a_taken_port_is_named():
    with served("duel", "--opponent", "still") as (address, _):
        port = re.search(r":(\d+)/", address)[1]
        command = [sys.executable, "-m", "marl_airhockey.cli", "play", "duel"]
        done = subprocess.run(
            [*command, "--port", port], capture_output=True, text=True, check=False
        )
    assert done.returncode == 1
    assert f"--port {port}" in done.stderr
    for bad in (["--port", "99999"], ["--reaction", "0.9"], ["--opponent", "policy"]):
        done = airhockey("play", "duel", *bad, ok=False)
        assert done.returncode in (1, 2)
        assert "Traceback" not in done.stderr

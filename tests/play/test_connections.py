"""Connections before a request is known: half-open ones, bad headers, log lines."""

import asyncio
import logging
import re
import socket
import time

import pytest
import websockets
from pages import line, served

from marl_airhockey.play.connections import (
    HEADER_TIME,
    LINES,
    WAITING_OF_ONE,
    RareLines,
)


@pytest.fixture(scope="module")
def address():
    with served("duel", "--opponent", "still") as (found, _):
        yield found


def where(address):
    return "127.0.0.1", int(re.search(r":(\d+)/", address)[1])


def answer_to(address, request):
    with socket.create_connection(where(address), 5) as own:
        own.sendall(request)
        found = b""
        while piece := own.recv(4096):
            found += piece
    return found


def gone(connection):
    """True if the server has closed a connection."""
    connection.settimeout(0.01)
    try:
        return not connection.recv(1)
    except TimeoutError:
        return False
    except ConnectionResetError:
        return True


@pytest.mark.slow
def test_half_open_connections_keep_nobody_out(address):
    async def play():
        url = address.replace("http", "ws") + "ws"
        async with websockets.connect(url, open_timeout=5) as player:
            await player.send(line("hello", key="player"))
            for _ in range(20):
                await asyncio.wait_for(player.recv(), 5)

    idle = []
    for _ in range(200):
        own = socket.create_connection(where(address), 5)
        own.sendall(b"GET / HTTP/1.1\r\nHost: 127")
        idle.append(own)
    asyncio.run(play())
    open_ones = [own for own in idle if not gone(own)]
    assert len(open_ones) <= WAITING_OF_ONE
    time.sleep(HEADER_TIME + 1.0)
    assert all(gone(own) for own in open_ones), "a request must be there in time"
    for own in idle:
        own.close()


BAD_HEADERS = {
    b"Host: [::1": 400,
    b"Host: \xff\xfe": 403,
    b"Host: 127.0.0.1\r\nOrigin: http://[": 400,
    b"Host: 127.0.0.1\r\nOrigin: null": 403,
    b"Host: evil.example": 403,
    b"Accept: */*": 400,
}


@pytest.mark.parametrize(("headers", "status"), BAD_HEADERS.items())
def test_malformed_headers_are_refused(address, headers, status):
    found = answer_to(address, b"GET / HTTP/1.1\r\n" + headers + b"\r\n\r\n")
    assert found.startswith(b"HTTP/1.1 %d" % status)


@pytest.mark.parametrize("path", [b"/web/%00", b"/web/" + b"a" * 2000, b"/%ff", b"//"])
def test_odd_paths_are_not_found(address, path):
    head = b"GET " + path + b" HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
    assert answer_to(address, head).startswith(b"HTTP/1.1 404")


def test_a_malformed_token_is_refused():
    with served("duel", "--opponent", "still", "--host", "0.0.0.0") as (found, _):
        for token in (b"", b"%ff%fe", b"\xc3\xa4", b"a" * 3000):
            head = b"GET /?token=" + token + b" HTTP/1.1\r\nHost: a\r\n\r\n"
            status = answer_to(found, head).split()[1]
            assert status in (b"400", b"403")


def test_answers_have_security_headers(address):
    found = answer_to(address, b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n").lower()
    for header in (
        b"content-security-policy: default-src 'none'",
        b"x-content-type-options: nosniff",
        b"referrer-policy: no-referrer",
        b"cache-control: no-store",
        b"cross-origin-opener-policy: same-origin",
        b"connection: close",
    ):
        assert header in found


def test_a_flood_of_errors_is_a_few_lines(caplog):
    log = logging.getLogger("test_flood")
    log.addFilter(RareLines())
    for k in range(1000):
        try:
            raise OSError(24, "Too many open files")
        except OSError:
            log.exception("accept %d\nsecond line", k)
    assert len(caplog.records) == LINES
    assert caplog.text.count("\n") == LINES
    assert "accept 0: [Errno 24] Too many open files" in caplog.text

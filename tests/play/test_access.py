"""Who may connect to a server, and who only watches."""

import pytest
from starlette.requests import HTTPConnection

from marl_airhockey.play.access import AccessCheck
from marl_airhockey.play.live_match import LiveMatch
from marl_airhockey.play.open_table import open_table
from marl_airhockey.play.plant import Plant


def request(peer="127.0.0.1", host="127.0.0.1:8480", query="", **headers):
    named = {"host": host} | {k.replace("_", "-"): v for k, v in headers.items()}
    return HTTPConnection(
        {
            "type": "http",
            "client": (peer, 5000),
            "query_string": query.encode(),
            "headers": [(k.encode(), v.encode()) for k, v in named.items()],
        }
    )


@pytest.mark.parametrize(
    ("sent", "remote"),
    [
        ({}, False),
        ({"host": "localhost:8480"}, False),
        ({"peer": "::1", "host": "[::1]:8480"}, False),
        ({"peer": "192.168.0.7"}, True),
        ({"host": "arm.example.org"}, True),
        ({"host": ""}, True),
        ({"x_forwarded_for": "203.0.113.9"}, True),
        ({"forwarded": "for=203.0.113.9"}, True),
        ({"x_real_ip": "203.0.113.9"}, True),
        ({"via": "1.1 proxy"}, True),
    ],
)
def test_who_comes_through_a_proxy_is_on_another_machine(sent, remote):
    assert AccessCheck("127.0.0.1").is_remote(request(**sent)) is remote


def test_a_real_arm_needs_the_token_on_its_own_machine_too():
    access = AccessCheck("127.0.0.1", guarded=True)
    assert access.refusal(request()).status_code == 403
    assert access.refusal(request(query="token=guess")).status_code == 403
    assert access.refusal(request(query=f"token={access.token}")) is None
    assert AccessCheck("127.0.0.1").token == ""
    assert AccessCheck("127.0.0.1").refusal(request()) is None


def test_who_only_watches_switches_no_fault():
    match, switched = LiveMatch("juggle", {"paddle_0": "person"}, {}), []
    plant = Plant({"dark_camera": "dark"}, lambda *order: switched.append(order))
    session = open_table(match, None, plant)
    player, spectator = session.connect(), session.connect()
    session.receive(player, '{"t": "hello", "key": "player"}')
    session.receive(spectator, '{"t": "hello", "key": "spectator"}')
    fault = '{"t": "fault", "name": "dark_camera", "on": %d}'
    session.receive(spectator, fault % 1)
    assert switched == []
    session.receive(player, fault % 1)
    session.receive(player, fault % 0)
    assert switched == [("dark_camera", True), ("dark_camera", False)]
    handlers = session.host.handlers
    assert {"start", "pause", "opponent", "fault"} <= set(handlers)
    match.close()

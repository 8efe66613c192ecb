"""The ports of the emulator: a real controller's answers, and malformed packages."""

import asyncio
import contextlib
import math
import socket
import struct
import threading
import time

import numpy as np
import pytest
from emulators import until
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from marl_airhockey.hardware.lab.setup import LabSetup
from marl_airhockey.hardware.ur_emulator.controller import Controller
from marl_airhockey.hardware.ur_emulator.ports import (
    DASHBOARD,
    PRIMARY,
    RTDE,
    SCRIPT,
    SECONDARY,
    Ports,
)
from marl_airhockey.hardware.ur_emulator.rtde import INPUTS, OUTPUTS

HOST = "127.0.0.26"
SPEED_JOINTS = 9
PROGRAM = b"def unnamed():\n  reg_offset_int = 0\nend\n"
UR_ROBOT_DRIVER = (
    *("timestamp", "actual_q", "actual_qd", "actual_current", "actual_TCP_pose"),
    *("actual_TCP_force", "actual_TCP_speed", "target_TCP_pose", "target_q"),
    *("target_qd", "speed_scaling", "target_speed_fraction", "runtime_state"),
    *("actual_digital_input_bits", "actual_digital_output_bits", "analog_io_types"),
    *("standard_analog_input0", "standard_analog_input1", "standard_analog_output0"),
    *("standard_analog_output1", "tool_mode", "tool_analog_input_types"),
    *("tool_analog_input0", "tool_analog_input1", "tool_output_voltage"),
    *("tool_output_current", "tool_temperature", "robot_mode", "safety_mode"),
    *("robot_status_bits", "safety_status_bits", "tcp_offset", "payload"),
    *("payload_cog", "payload_inertia", "script_control_line"),
)
"""Outputs that the drivers of ROS and ROS 2 ask for, and other clients of the maker"""


class Client:
    """Client of RTDE that sends raw packages."""

    def __init__(self, version=2):
        self.socket = socket.create_connection((HOST, RTDE), 3.0)
        self.socket.settimeout(3.0)
        if version is not None:
            assert self.ask("V", struct.pack(">H", version)) == b"\x01"

    def send(self, kind, body=b""):
        self.socket.sendall(struct.pack(">HB", len(body) + 3, ord(kind)) + body)

    def receive(self):
        """Return the type and the body of the next package; ("", b"") at the end."""
        head = self._exactly(3)
        if not head:
            return "", b""
        size, kind = struct.unpack(">HB", head)
        return chr(kind), self._exactly(size - 3)

    def _exactly(self, count):
        data = b""
        while len(data) < count:
            try:
                more = self.socket.recv(count - len(data))
            except ConnectionError:
                return b""
            if not more:
                return b""
            data += more
        return data

    def ask(self, kind, body=b""):
        """Return the body of the answer, between data and messages."""
        self.send(kind, body)
        found, answer = self.receive()
        while found in ("U", "M"):
            found, answer = self.receive()
        return answer if found == kind else None

    def stream(self, *names):
        """Start a stream of variables; return whether the controller accepts."""
        text = ",".join(names).encode()
        self.ask("O", struct.pack(">d", 125.0) + text)
        return self.ask("S") == b"\x01"

    def close(self):
        self.socket.close()


@pytest.fixture(scope="module")
def controller():
    """A controller whose ports are served in this process."""
    made, ended = Controller(LabSetup().make_arm()), threading.Event()
    loop = asyncio.new_event_loop()

    def run():
        asyncio.set_event_loop(loop)
        made.ports = Ports(made)
        task = loop.create_task(made.ports.serve([HOST]))
        made.task = task
        with contextlib.suppress(asyncio.CancelledError):
            loop.run_until_complete(task)
        ended.set()

    thread = threading.Thread(target=run)
    thread.start()
    while not made.ticks:
        time.sleep(0.01)
    yield made
    loop.call_soon_threadsafe(made.task.cancel)
    thread.join(5.0)
    assert ended.is_set()
    loop.close()


@pytest.fixture
def connect(controller):
    """Function that connects a client, which is closed at the end."""
    made = []

    def connect(version=2):
        made.append(Client(version))
        return made[-1]

    yield connect
    for client in made:
        client.close()


def recover(controller):
    """Release whatever a test has stopped, at the start's pose."""
    controller.switch_power(True)
    controller.arm.release()
    controller.arm.angles = LabSetup().make_arm().angles
    controller.arm.speeds = np.zeros(6)
    controller.arm.release()
    # Registers keep their values, so a new program would run the old command.
    controller.script.inputs_int[:] = [0] * 48
    controller.script.inputs_double[:] = 0.0


def lives(controller):
    """Return whether the controller runs and its arm is somewhere."""
    before = controller.ticks
    time.sleep(0.05)
    pose = controller.arm.pose
    return controller.ticks > before and bool(np.isfinite(pose).all())


def test_every_output_that_drivers_ask_for_exists(connect):
    client = connect()
    assert client.stream(*UR_ROBOT_DRIVER)
    kind, body = client.receive()
    assert kind == "U"
    assert body[0] == 1


def test_every_known_output_can_be_sent(connect):
    client, names = connect(), sorted(OUTPUTS)
    for first in range(0, len(names), 60):
        assert client.stream(*names[first : first + 60])
        while client.receive()[0] != "U":
            pass


def test_unknown_names_are_not_found_and_nothing_starts(connect):
    client = connect()
    answer = client.ask("O", struct.pack(">d", 125.0) + b"timestamp,warp_factor")
    assert answer == b"\x00DOUBLE,NOT_FOUND"
    assert client.ask("S") == b"\x00"
    assert client.ask("I", b"input_int_register_0,actual_q") == b"\x00INT32,NOT_FOUND"


def test_an_input_belongs_to_one_client_until_it_leaves(connect):
    first, second = connect(), connect()
    names = b"input_int_register_0,speed_slider_mask,speed_slider_fraction"
    assert first.ask("I", names) == b"\x01INT32,UINT32,DOUBLE"
    assert first.ask("I", b"input_int_register_0") == b"\x02INT32"
    assert second.ask("I", names) == b"\x00IN_USE,IN_USE,IN_USE"
    taken = b"input_int_register_24,input_int_register_0"
    assert second.ask("I", taken) == b"\x00INT32,IN_USE"
    assert second.ask("I", b"input_int_register_24") == b"\x01INT32"
    first.close()
    third = connect()
    end = time.monotonic() + 2.0
    while third.ask("I", names) != b"\x01INT32,UINT32,DOUBLE":
        assert time.monotonic() < end


@pytest.mark.parametrize("rate", [0.0, -1.0, 0.5, 501.0, math.nan, math.inf])
def test_a_rate_out_of_range_is_refused(connect, rate):
    client = connect()
    client.send("O", struct.pack(">d", rate) + b"timestamp")
    kind, text = client.receive()
    assert kind == "M"
    assert b"expected 1.0 to 500.0" in text
    assert client.receive() == ("O", b"\x00DOUBLE")


def test_version_1_has_no_numbers_of_recipes(connect):
    client = connect(version=1)
    assert client.ask("O", b"timestamp,robot_mode") == b"DOUBLE,INT32"
    assert client.ask("S") == b"\x01"
    kind, body = client.receive()
    assert (kind, len(body)) == ("U", 12)
    assert struct.unpack(">di", body)[1] == 7


def test_an_unknown_version_is_refused_and_the_old_one_stays(connect):
    client = connect(version=None)
    assert client.ask("V", struct.pack(">H", 3)) == b"\x00"
    assert client.ask("V", struct.pack(">H", 2)) == b"\x01"


MALFORMED = {
    "a size below the header": b"\x00\x00V",
    "no body": b"\x00\x03V",
    "half a body": b"\x00\x04V\x00",
    "half a rate": b"\x00\x06O\x00\x00\x00",
    "names that are no text": b"\x00\x0dO" + struct.pack(">d", 125.0) + b"\xff\xfe",
    "data of no recipe": b"\x00\x04U\x01",
    "data without a number": b"\x00\x03U",
    "an unknown type": b"\x00\x03Z",
}


@pytest.mark.parametrize("name", MALFORMED)
def test_a_malformed_package_ends_its_own_connection_alone(connect, controller, name):
    other, client = connect(), connect()
    assert other.stream("timestamp")
    client.socket.sendall(MALFORMED[name])
    kinds = []
    while (found := client.receive())[0]:
        kinds.append(found[0])
    assert kinds == ["M"]
    assert lives(controller)
    assert other.receive()[0] == "U"


def test_data_shorter_than_its_recipe_ends_its_connection_alone(connect, controller):
    client = connect()
    assert client.ask("I", b"input_double_register_0") == b"\x01DOUBLE"
    client.send("U", b"\x01\x00")
    assert client.receive()[0] == "M"
    assert client.receive() == ("", b"")
    assert lives(controller)


def test_a_mask_without_its_value_changes_nothing(connect, controller):
    client = connect()
    assert client.ask("I", b"speed_slider_mask") == b"\x01UINT32"
    assert client.ask("S") == b"\x01"
    client.send("U", b"\x01" + struct.pack(">I", 1))
    assert lives(controller)
    assert controller.arm.speed_fraction == 1.0


def run_program(connect, names):
    """Upload a program; return a client that writes some inputs."""
    with socket.create_connection((HOST, SCRIPT), 3.0) as link:
        link.sendall(PROGRAM)
        time.sleep(0.2)
    client = connect()
    assert client.ask("I", ",".join(names).encode())[0] == 1
    assert client.ask("S") == b"\x01"
    return client


@pytest.mark.parametrize("number", [math.nan, math.inf, 1e300])
def test_a_number_that_makes_no_sense_ends_the_program_alone(
    connect, controller, number
):
    recover(controller)
    names = ["input_int_register_0", *(f"input_double_register_{k}" for k in range(7))]
    client = run_program(connect, names)
    assert controller.script.running
    body = struct.pack(">i7d", SPEED_JOINTS, number, 0, 0, 0, 0, 0, 1.0)
    client.send("U", b"\x01" + body)
    assert lives(controller)
    assert not controller.script.running
    assert controller.arm.at_rest


def test_a_program_of_another_client_replaces_the_running_one(connect, controller):
    recover(controller)
    client = connect()
    assert client.stream("runtime_state")
    run_program(connect, ["input_int_register_1"])
    assert controller.script.running
    with socket.create_connection((HOST, SECONDARY), 3.0) as link:
        link.sendall(b"def other():\n  movej([0, 0, 0, 0, 0, 0])\nend\n")
        time.sleep(0.2)
    assert not controller.script.running


register = st.sampled_from(sorted(INPUTS))
double = st.floats(width=64) | st.sampled_from([math.nan, math.inf, -math.inf, 1e308])
names = st.lists(register | st.text(max_size=8), max_size=6).map(
    lambda found: ",".join(found).encode()
)
bodies = st.one_of(
    st.binary(max_size=40),
    names,
    st.tuples(double, names).map(lambda p: struct.pack(">d", p[0]) + p[1]),
    st.tuples(st.integers(0, 3), st.integers(0, 70), st.lists(double, max_size=20)).map(
        lambda p: (
            struct.pack(">Bi", p[0], p[1])
            + b"".join(struct.pack(">d", x) for x in p[2])
        )
    ),
)
rtde_packages = st.tuples(st.sampled_from("VvOISPUMZ"), bodies).map(
    lambda p: struct.pack(">HB", len(p[1]) + 3, ord(p[0])) + p[1]
) | st.binary(max_size=20)
eighteen = st.lists(double, min_size=18, max_size=18)
commands = st.tuples(st.integers(0, 61), eighteen).map(
    lambda p: struct.pack(">HBBi18d", 152, ord("U"), 1, p[0], *p[1])
)
ORDERS = [b"robotmode\n", b"stop\n", b"play\n", b"unlock protective stop\n", b"\n"]
lines = st.sampled_from([*ORDERS, b"def f(\n"]) | st.binary(max_size=60)


def flood(port, packages, first=b""):
    """Send packages to a port and read what comes back, until it closes."""
    with socket.create_connection((HOST, port), 3.0) as link:
        link.settimeout(0.0005)
        with contextlib.suppress(ConnectionError):
            link.sendall(first)
            for data in packages:
                link.sendall(data)
                with contextlib.suppress(TimeoutError, BlockingIOError):
                    link.recv(1 << 14)


WRITER = b"".join(
    struct.pack(">HB", len(body) + 3, ord(kind)) + body
    for kind, body in (
        ("V", struct.pack(">H", 2)),
        (
            "I",
            ",".join(
                ["input_int_register_0"]
                + [f"input_double_register_{k}" for k in range(18)]
            ).encode(),
        ),
        ("S", b""),
    )
)
PORTS = {
    "RTDE": (RTDE, rtde_packages, b""),
    "commands": (RTDE, commands, WRITER),
    "dashboard": (DASHBOARD, lines, b""),
    "primary": (PRIMARY, lines, b""),
    "secondary": (SECONDARY, lines, b""),
    "script": (SCRIPT, lines, b""),
}


def fuzz(controller, port, examples, each):
    """Send lists of packages to a port; the controller must run on after each."""
    number, packages, first = PORTS[port]
    sent = 0

    @settings(
        max_examples=examples,
        deadline=None,
        database=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(st.lists(packages, min_size=each, max_size=each))
    def send(found):
        nonlocal sent
        sent += len(found)
        if port == "commands":
            recover(controller)
            controller.script.start(0)
        flood(number, found, first)
        # The next client writes the same inputs.
        until(lambda: not controller.ports._owners)
        assert not controller.task.done()
        assert np.isfinite(controller.arm.pose).all()

    send()
    return sent


@pytest.mark.parametrize("port", PORTS)
def test_no_package_stops_the_emulator(connect, controller, port):
    other = connect()
    assert other.stream("timestamp")
    before = controller.script.counts.total()
    assert fuzz(controller, port, 10, 30) >= 300
    if port == "commands":
        assert controller.script.counts.total() > before + 5
    assert lives(controller)
    recover(controller)
    assert connect().stream("timestamp")


usual = st.floats(-3.0, 3.0)


@settings(max_examples=200, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    st.lists(
        st.tuples(
            st.sampled_from([0, *range(1, 48), 60]),
            st.lists(usual, min_size=18, max_size=18),
            st.none() | st.tuples(st.integers(0, 17), double),
        ),
        min_size=1,
        max_size=6,
    )
)
def test_no_command_makes_a_pose_nan(orders):
    controller = Controller(LabSetup().make_arm())
    for number, arguments, wild in orders:
        recover(controller)
        controller.script.start(0)
        if wild:
            arguments[wild[0]] = wild[1]
        values = {f"input_double_register_{k}": x for k, x in enumerate(arguments)}
        controller.take({**values, "input_int_register_0": number})
        controller.take({"input_int_register_4": 1})
        for _ in range(15):
            controller.step()
            arm = controller.arm
            for value in (arm.pose, arm.twist, arm.angles, arm.measured_force):
                assert np.isfinite(value).all()


@pytest.mark.slow
def test_ten_thousand_packages_do_not_stop_the_emulator(connect, controller):
    sent = sum(fuzz(controller, port, 40, 50) for port in PORTS)
    assert sent >= 10_000
    assert lives(controller)
    recover(controller)
    assert connect().stream("timestamp")

"""The UR emulator as a command in a process of its own."""

import subprocess
import sys
import time
from contextlib import contextmanager

from typer.testing import CliRunner

from marl_airhockey.cli.main import app
from marl_airhockey.hardware.lab.door import DoorClient, port_in
from marl_airhockey.hardware.ur_emulator.emulator import door_file

ADDRESS = "127.0.0.28"


@contextmanager
def emulator(*words, at=ADDRESS):
    command = [sys.executable, "-m", "marl_airhockey.cli", "ur-emulator"]
    with subprocess.Popen(
        [*command, "--address", at, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as started:
        try:
            line = started.stdout.readline()
            while line and at not in line:
                line = started.stdout.readline()
            assert line, "it ended before it answered"
            yield
        finally:
            started.terminate()


def until(condition, seconds=5.0):
    """Return True as soon as a condition holds."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.02)
    return False


def switch(*words):
    result = CliRunner().invoke(app, ["ur-emulator", "fault", *words])
    assert result.exit_code == 0, result.exception
    return result.output


def status(address=ADDRESS):
    """Return what the emulator at an address does."""
    client = DoorClient(port_in(door_file(address)), "ur-emulator")
    try:
        return client.ask("status")
    finally:
        client.close()

"""Nothing of a lab is left behind, however it ends."""

import os
import signal
import subprocess
import sys
import time

import pytest

from marl_airhockey.hardware.lab.lab import LabClient, port_file
from marl_airhockey.sim.jit.folders import cache_folder

OPEN = """
from marl_airhockey.hardware.lab.lab import Lab, served
import time
with Lab() as lab, served(lab):
    time.sleep(1000)
"""


def alive(pid):
    """True unless it has ended; one that waits to be reaped has."""
    try:
        with open(f"/proc/{pid}/stat") as file:
            return file.read().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def find(opener):
    until = time.monotonic() + 120
    while time.monotonic() < until and opener.poll() is None:
        client = LabClient.find()
        if client is not None:
            return client
        time.sleep(0.05)
    raise AssertionError("the lab did not open")


@pytest.fixture(autouse=True)
def _own_port_file(monkeypatch, tmp_path):
    """A port file of the test's own, beside what is compiled already."""
    pytest.importorskip("rtde_control")
    for compiled in cache_folder().iterdir():
        if compiled != port_file():
            (tmp_path / compiled.name).symlink_to(compiled)
    monkeypatch.setenv("MARL_AIRHOCKEY_CACHE", str(tmp_path))
    cache_folder.cache_clear()
    yield
    cache_folder.cache_clear()


@pytest.mark.slow
def test_kill_9_of_its_opener_ends_the_lab():
    for _ in range(2):  # The second starts beside the first's old port file.
        opener = subprocess.Popen([sys.executable, "-c", OPEN])
        try:
            client = find(opener)
            pids = client.ask("info")["pids"]
            client.close()
            assert all(alive(pid) for pid in pids)
            opener.send_signal(signal.SIGKILL)
            opener.wait()
            until = time.monotonic() + 10
            while any(alive(pid) for pid in pids) and time.monotonic() < until:
                time.sleep(0.05)
            assert not any(alive(pid) for pid in pids)
            assert port_file().exists()
            assert LabClient.find() is None
        finally:
            opener.kill()
            opener.wait()


@pytest.mark.slow
def test_ctrl_c_leaves_no_port_file():
    command = [sys.executable, "-m", "marl_airhockey.cli", "lab"]
    opener = subprocess.Popen(
        command,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    try:
        find(opener).close()
        os.kill(opener.pid, signal.SIGINT)
        assert opener.wait(20) == 0
        assert not port_file().exists()
    finally:
        opener.kill()
        opener.wait()

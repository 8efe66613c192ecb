"""The commands from a table to a policy run in order, in a lab."""

import os
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from marl_airhockey.hardware.lab.lab import LabClient

PAGE = Path(__file__).parents[3] / "docs/fitting.md"
SHORTER = {
    "--episodes 26": "--episodes 5",
    "train juggle": "train juggle --steps 20000",
}
"""What takes long on the page, and what stands for it here"""


def commands():
    """Return the first block of the section, a command a line."""
    section = PAGE.read_text().split("## From your table to your policy")[1]
    block = re.search(r"(?:^    .*\n)+", section, re.M)[0].replace("\\\n", " ")
    lines = [line.strip() for line in block.splitlines()]
    assert len(lines) == 6
    for long, short in SHORTER.items():
        assert sum(long in line for line in lines) == 1
        lines = [line.replace(long, short) for line in lines]
    return lines


@pytest.fixture
def announced_lab():
    pytest.importorskip("rtde_control")
    command = [sys.executable, "-m", "marl_airhockey.cli", "lab"]
    lab = subprocess.Popen(
        [*command, "--frame-rate", "60", "--seed", "3"],
        # A shell ignores it for what it runs in the background.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    deadline = time.monotonic() + 60
    while (client := LabClient.find()) is None and time.monotonic() < deadline:
        time.sleep(0.2)
    client.close()
    yield
    lab.send_signal(signal.SIGINT)
    lab.wait(20)


@pytest.mark.slow
def test_the_block_runs_in_its_order(announced_lab, tmp_path):
    for line in commands():
        words, _, target = line.partition(" > ")
        name, *rest = shlex.split(words)
        assert name == "airhockey"
        done = subprocess.run(
            [sys.executable, "-m", "marl_airhockey.cli", *rest],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            env={**os.environ, "COLUMNS": "200"},
        )
        assert not done.returncode, (line, done.stderr)
        if target:
            (tmp_path / target).write_text(done.stdout)
    assert (tmp_path / "runs/juggle-0/best.npz").exists()

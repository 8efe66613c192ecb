"""Playing, recording and listing need no module of Unix."""

import subprocess
import sys

import pytest

BLOCK = """
import os, signal, sys

for name in ("fcntl", "grp", "pwd", "resource", "termios", "tty"):
    sys.modules[name] = None
for name in ("fork", "getuid", "killpg", "nice", "setsid", "statvfs"):
    delattr(os, name)
for name in ("SIGHUP", "SIGKILL", "SIGSTOP"):
    delattr(signal, name)
"""
COMMAND = """
from marl_airhockey.cli.main import main
sys.argv = "airhockey {}".split()
main()
"""
PLAY = """
import marl_airhockey as ah
env = ah.gym_env("juggle", backend="{}", max_cycles=5)
env.reset(seed=0)
while not env.step(env.action_space.sample())[3]:
    pass
"""
PROGRAMS = {
    "list": COMMAND.format("list"),
    "record": COMMAND.format("data record still -s touch --episodes 1 --out one"),
    "numba": PLAY.format("numba"),
    "pymunk": PLAY.format("pymunk"),
    "camera": "import marl_airhockey.hardware.camera",
}


@pytest.mark.parametrize("program", PROGRAMS)
def test_it_runs_without_the_modules_of_unix(program, tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", BLOCK + PROGRAMS[program]],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert not done.returncode, done.stderr

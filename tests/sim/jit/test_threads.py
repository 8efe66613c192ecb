"""Threads of compiled loops."""

import os
import subprocess
import sys


def test_threads_do_not_change_a_number():
    program = (
        "import hashlib, numpy as np, marl_airhockey as ah\n"
        "w = ah.make_world('juggle', 4096, backend='numba')\n"
        "seen, rng = [w.reset(0)], np.random.default_rng(0)\n"
        "for _ in range(30):\n"
        "    step = w.step(rng.uniform(-1, 1, (4096, 1, 2)))\n"
        "    seen += [step.observation, step.reward]\n"
        "print(hashlib.sha256(b''.join(s.tobytes() for s in seen)).hexdigest())\n"
    )
    runs = {
        subprocess.run(
            [sys.executable, "-c", program],
            env=os.environ | {"MARL_AIRHOCKEY_THREADS": threads},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for threads in ("1", "2")
    }
    assert len(runs) == 1
    refused = subprocess.run(
        [sys.executable, "-c", program],
        env=os.environ | {"MARL_AIRHOCKEY_THREADS": "many"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "MARL_AIRHOCKEY_THREADS: 'many'" in refused.stderr

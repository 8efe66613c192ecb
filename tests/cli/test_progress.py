"""Progress where there is no terminal."""

import time

from marl_airhockey.cli import progress
from marl_airhockey.sim.jit import notices


def test_lines_say_what_is_done_and_how_long_it_takes(capsys, monkeypatch):
    monkeypatch.setattr(notices, "EVERY", 0.05)
    with progress.bar() as shown:
        task = shown.add_task("league of 3", total=4, note="")
        shown.advance(task)
        time.sleep(0.5)
        shown.update(task, completed=4, note="done")
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) > 1
    assert lines[0].startswith("league of 3: 0 s so far, 25%, about ")
    assert lines[-1].endswith("100%, about 0 s left, done")
    with progress.waiting("fitting"):
        time.sleep(0.2)
    assert "fitting: 0 s so far" in capsys.readouterr().err

"""What is printed while something is compiled."""

import time

from marl_airhockey.sim.jit import notices


def test_a_compilation_is_announced_once_and_again_while_it_lasts(capsys, monkeypatch):
    monkeypatch.setattr(notices, "EVERY", 0.05)
    monkeypatch.setattr(notices, "_compilations", {})
    with notices.announced_compilation("duel", first=True):
        time.sleep(0.5)
    with notices.announced_compilation("duel", first=False):
        pass
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == f"marl_airhockey: compiling duel once, about {notices.FIRST} s"
    assert len(lines) > 1
    assert all("still compiling duel, " in line for line in lines[1:])
    time.sleep(0.2)
    assert not capsys.readouterr().err


def test_waiting_for_another_process_is_silent_at_first(capsys, monkeypatch):
    with notices.announced_wait("duel"):
        pass
    assert not capsys.readouterr().err
    monkeypatch.setattr(notices, "EVERY", 0.05)
    with notices.announced_wait("duel"):
        time.sleep(0.5)
    assert "another process compiles duel, 0 s so far" in capsys.readouterr().err

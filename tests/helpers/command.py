"""The command line, called in this process: seconds faster than a new one."""

import contextlib
import io
import sys
from typing import NamedTuple

from marl_airhockey.cli.main import main
from marl_airhockey.policies.trust import Trust


class Done(NamedTuple):
    """Outcome of a command, as of a finished process."""

    returncode: int
    stdout: str
    stderr: str


def airhockey(*words, ok=True, cwd="."):
    """Run `airhockey` with these words; check that it succeeds, or fails."""
    out, err, code, given = io.StringIO(), io.StringIO(), 0, sys.argv
    sys.argv = ["airhockey", *map(str, words)]
    try:
        with (
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
            contextlib.chdir(cwd),
        ):
            main()
    except SystemExit as end:
        code = end.code or 0
    finally:
        sys.argv, Trust.answer = given, None
    done = Done(code, out.getvalue(), err.getvalue())
    assert (code == 0) == ok, done.stderr
    return done

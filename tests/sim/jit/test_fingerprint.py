"""Fingerprints of compiled functions: what changes them, and what does not."""

import importlib
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

from marl_airhockey.sim.jit.fingerprint import fingerprint

PACKAGE = Path(__file__).parents[3] / "marl_airhockey"
SOURCE = '''
from enum import IntEnum
import numpy as np
from marl_airhockey.sim.jit.cache import compiled, inner

class Kind(IntEnum):
    PUCK = 1

LIMIT = 2.0
TABLE = (1, np.arange(3))

@inner(error_model="numpy")
def limited(x):
    """Return x below a limit."""
    return min(x, LIMIT) + TABLE[1][0]

@compiled()
def run(x, add=0.5):
    """Return a number."""
    def twice(y):
        """Return it twice."""
        return y * 2 if y else "none"
    # A comment.
    return twice(limited(x)) + add + Kind.PUCK
'''
SAME = {
    "docstring": ("Return a number.", "Return another number."),
    "docstring of a callee": ("Return x below a limit.", "Limit x."),
    "docstring of an inner function": ('"""Return it twice."""', '"""Double."""'),
    "comment": ("# A comment.", "# Two\n    # lines."),
    "lines": ("LIMIT = 2.0", "\n\nLIMIT = 2.0"),
    "unused constant": ("LIMIT = 2.0", "LIMIT = 2.0\nOTHER = 3.0"),
}
OTHER = {
    "constant": ("LIMIT = 2.0", "LIMIT = 3.0"),
    "type of a constant": ("LIMIT = 2.0", "LIMIT = 2"),
    "array": ("np.arange(3)", "np.arange(3) + 1"),
    "member of an enumeration": ("PUCK = 1", "PUCK = 2"),
    "callee": ("min(x, LIMIT)", "max(x, LIMIT)"),
    "inner function": ("y * 2", "y * 3"),
    "text": ('"none"', '"never"'),
    "default": ("add=0.5", "add=0.25"),
    "options": ("@compiled()", "@compiled(nogil=True)"),
    "options of a callee": ('error_model="numpy"', 'error_model="python"'),
}


def fingerprint_of(source):
    names = {"__name__": "marl_airhockey.edited"}
    exec(source, names)
    return fingerprint(names["run"])


@pytest.mark.parametrize("edit", SAME)
def test_prose_does_not_change_a_fingerprint(edit):
    old, new = SAME[edit]
    assert old in SOURCE
    assert fingerprint_of(SOURCE.replace(old, new)) == fingerprint_of(SOURCE)


@pytest.mark.parametrize("edit", OTHER)
def test_what_is_compiled_changes_a_fingerprint(edit):
    old, new = OTHER[edit]
    assert old in SOURCE
    assert fingerprint_of(SOURCE.replace(old, new)) != fingerprint_of(SOURCE)


def test_what_has_no_fingerprint_is_an_error():
    source = SOURCE.replace("LIMIT = 2.0", "LIMIT = slice(2)")
    with pytest.raises(TypeError, match="slice"):
        fingerprint_of(source)


def test_every_compiled_function_has_one_that_all_processes_share():
    program = (
        "import importlib, sys\n"
        "from marl_airhockey.sim.jit.fingerprint import fingerprint\n"
        "for word in sys.argv[1:]:\n"
        "    module, name = word.split(':')\n"
        "    function = getattr(importlib.import_module(module), name)\n"
        "    print(fingerprint(function))\n"
    )
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        if "@compiled" not in path.read_text():
            continue
        module = ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts)
        for name, value in vars(importlib.import_module(module)).items():
            if isinstance(value, Dispatcher) and value.py_func.__module__ == module:
                found[f"{module}:{name}"] = fingerprint(value)
    assert len(found) > 40
    assert len(set(found.values())) == len(found)
    done = subprocess.run(
        [sys.executable, "-c", program, *found], capture_output=True, text=True
    )
    assert done.stdout.split() == list(found.values()), done.stderr
    assert np.all([len(value) == 16 for value in found.values()])

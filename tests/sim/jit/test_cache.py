"""Cache of compiled code: other sources, other processes, damaged and missing files."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

PACKAGE = Path(__file__).parents[3] / "marl_airhockey"
LOOP = """
import sys
import numpy as np
from marl_airhockey.sim.jit.codegen import load
SOURCE = '''
import numpy as np
SIGNATURE = "void(float64[::1])"
def kernel(x):
    for b in range(x.shape[0]):
        x[b] = x[b] * 2.0 + 1.0
'''
x = np.arange(3.0)
for _ in range(int(sys.argv[1]) if len(sys.argv) > 1 else 1):
    load(SOURCE, "a loop").kernel(x)
print(x.tolist())
"""


def start(program, cache, *words, **variables):
    return subprocess.Popen(
        [sys.executable, "-c", program, *words],
        env={**os.environ, "MARL_AIRHOCKEY_CACHE": str(cache), **variables},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def run(program, cache, *words, **variables):
    process = start(program, cache, *words, **variables)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    return out.strip(), err


def test_two_processes_on_an_empty_cache_compile_once(tmp_path):
    processes = [start(LOOP, tmp_path) for _ in range(3)]
    ended = [process.communicate(timeout=120) for process in processes]
    assert [process.returncode for process in processes] == [0, 0, 0]
    assert {out.strip() for out, _ in ended} == {"[1.0, 3.0, 5.0]"}
    assert "".join(err for _, err in ended).count("compiling a loop once") == 1
    assert run(LOOP, tmp_path) == ("[1.0, 3.0, 5.0]", "")


@pytest.mark.parametrize(
    "damage", [b"not a pickle", pytest.param(b"", marks=pytest.mark.slow)]
)
def test_a_damaged_file_is_compiled_again_with_one_line(tmp_path, damage):
    run(LOOP, tmp_path)
    (path,) = tmp_path.rglob("loop_*.code")
    path.write_bytes(damage)
    out, err = run(LOOP, tmp_path)
    assert out == "[1.0, 3.0, 5.0]"
    assert err.count("\n") == 1
    assert "kernel" in err
    assert "damaged" in err
    assert run(LOOP, tmp_path) == (out, "")


def test_a_folder_that_cannot_be_written_is_replaced_with_one_warning(tmp_path):
    file = tmp_path / "file"
    file.write_text("")
    home = {"HOME": str(file / "home"), "XDG_CACHE_HOME": ""}
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    given = {"TMPDIR": str(temporary), **home}
    out, err = run(LOOP, file / "cache", **given)
    assert out == "[1.0, 3.0, 5.0]"
    assert err.count("cannot write to") == 1
    assert str(file / "cache") in err
    assert not list(temporary.iterdir()), "it is deleted at the end"


def test_the_folder_of_numba_serves_where_the_home_cannot_be_written(tmp_path):
    file = tmp_path / "file"
    file.write_text("")
    given = {"HOME": str(file / "home"), "XDG_CACHE_HOME": ""}
    given["NUMBA_CACHE_DIR"] = str(tmp_path / "numba")
    out, err = run(LOOP, "", **given)
    assert err.count("compiling a loop once") == 1
    assert run(LOOP, "", **given) == (out, ""), "nothing is compiled again"


def test_a_cache_that_is_deleted_meanwhile_is_made_again(tmp_path):
    cache = tmp_path / "cache"
    program = LOOP + (
        "import shutil\n"
        f"shutil.rmtree({str(cache)!r})\n"
        "load(SOURCE.replace('1.0', '3.0'), 'another').kernel(x)\n"
        "print(x.tolist())\n"
    )
    out, err = run(program, cache)
    assert out.splitlines()[-1] == "[5.0, 9.0, 13.0]"
    assert "Error" not in err


def test_code_that_nobody_uses_is_deleted_when_something_is_compiled(tmp_path):
    run(LOOP, tmp_path)
    (used,) = tmp_path.rglob("loop_*.code")
    old = used.with_name("core.laws.old-0123.code")
    old.write_bytes(b"")
    for path in (used, old):
        os.utime(path, (0, 0))
    run(LOOP, tmp_path)
    assert used.stat().st_mtime > 0, "what is loaded is in use"
    run(LOOP.replace("1.0", "3.0"), tmp_path)
    assert used.exists()
    assert not old.exists()


@pytest.mark.parametrize(
    "numba_folder", [False, pytest.param(True, marks=pytest.mark.slow)]
)
def test_an_edit_of_another_file_is_never_stale(tmp_path, numba_folder):
    copy = tmp_path / "marl_airhockey"
    skip = shutil.ignore_patterns("zoo", "web", "__pycache__")
    shutil.copytree(PACKAGE, copy, ignore=skip)
    for leaves in ("scenarios", "drivers"):
        (copy / leaves).mkdir()
    program = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n"
        "from marl_airhockey.sim.core import laws\n"
        "print(laws.__file__, laws.wall_restitution(0.1, 0.5, 0.1))\n"
    )
    # Python itself would take its bytecode for that of the edited file.
    given = {"PYTHONDONTWRITEBYTECODE": "1"}
    given |= {"NUMBA_CACHE_DIR": str(tmp_path / "numba")} if numba_folder else {}

    def restitution():
        file, value = run(program, tmp_path / "cache", **given)[0].split()
        assert file == str(copy / "sim" / "core" / "laws.py")
        return float(value)

    assert restitution() == pytest.approx(0.5 - 0.1 * np.log(0.4))
    # A constant of another file, at the same size and modification time.
    edited = copy / "sim" / "core" / "parameters.py"
    times = edited.stat()
    text = edited.read_text()
    assert "SLOWEST_BOUNCE = 0.4\n" in text
    edited.write_text(text.replace("SLOWEST_BOUNCE = 0.4\n", "SLOWEST_BOUNCE = 0.2\n"))
    os.utime(edited, ns=(times.st_atime_ns, times.st_mtime_ns))
    assert restitution() == pytest.approx(0.5 - 0.1 * np.log(0.2))

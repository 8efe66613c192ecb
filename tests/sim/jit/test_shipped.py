"""Compiled code that comes with the package: loaded where it fits, explained if not."""

import json
import os
import subprocess
import sys

import pytest
from test_cache import LOOP

from marl_airhockey.sim.jit.shipped import LEVELS, write_manifest

FROM = """
import sys
from pathlib import Path
from marl_airhockey.sim.jit import shipped
shipped.FOLDER = Path(sys.argv.pop())
"""


def run(program, cache, *words, **variables):
    done = subprocess.run(
        [sys.executable, "-c", program, *map(str, words)],
        env={**os.environ, "MARL_AIRHOCKEY_CACHE": str(cache), **variables},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip(), done.stderr


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    """A folder of code for every processor of this family."""
    folder = tmp_path_factory.mktemp("package")
    target = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
    run(LOOP, folder / "cache", **target)
    for path in (folder / "cache").rglob("*.code"):
        path.rename(folder / path.name)
    write_manifest(folder, "generic")
    return folder


def test_code_that_fits_is_loaded_and_nothing_is_compiled(package, tmp_path):
    out, err = run(FROM + LOOP, tmp_path, package)
    assert (out, err) == ("[1.0, 3.0, 5.0]", "")
    assert not list(tmp_path.rglob("*.code"))


def test_code_is_ignored_on_request(package, tmp_path):
    words = {"MARL_AIRHOCKEY_PRECOMPILED": "0"}
    out, err = run(FROM + LOOP, tmp_path, package, **words)
    assert out == "[1.0, 3.0, 5.0]"
    assert "compiling a loop once, about 50 s\n" in err


def test_code_of_other_sources_is_not_loaded(package, tmp_path):
    out, err = run(FROM + LOOP.replace("1.0", "3.0"), tmp_path, package)
    assert out == "[3.0, 5.0, 7.0]"
    assert "compiling a loop once" in err


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"versions": {"numba": "0.1"}}, "is for numba 0.1, not "),
        ({"versions": {"llvmlite": "0.1"}}, "is for llvmlite 0.1, not "),
        ({"versions": {"python": "3.9"}}, "is for python 3.9, not "),
        ({"target": ["m68k-atari", "68000", ""]}, "is for m68k-atari, not "),
        ({"features": ["sse99"]}, "is for generic, and this processor has no sse99"),
    ],
)
def test_a_reason_is_given_where_it_does_not_fit(package, tmp_path, change, reason):
    folder = tmp_path / "package"
    folder.mkdir()
    for path in package.glob("*.code"):
        (folder / path.name).write_bytes(path.read_bytes())
    manifest = json.loads((package / "manifest.json").read_text())
    versions = {**manifest["versions"], **change.get("versions", {})}
    known = {**manifest, **change, "versions": versions}
    (folder / "manifest.json").write_text(json.dumps(known))
    out, err = run(FROM + LOOP, tmp_path / "cache", folder)
    assert out == "[1.0, 3.0, 5.0]"
    assert err.count("\n") == 1
    assert f"the code that comes with the package {reason}" in err


def test_a_damaged_manifest_is_a_reason(package, tmp_path):
    (tmp_path / "manifest.json").write_text('{"versions": {}}')
    out, err = run(FROM + LOOP, tmp_path / "cache", tmp_path)
    assert out == "[1.0, 3.0, 5.0]"
    assert "the code that comes with the package has a damaged manifest.json" in err


def test_levels_grow():
    assert set(LEVELS["generic"]) < set(LEVELS["x86-64-v2"]) < set(LEVELS["x86-64-v3"])

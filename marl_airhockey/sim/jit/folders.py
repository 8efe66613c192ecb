"""Folders of the user's cache: compiled code, datasets, addresses of processes."""

from __future__ import annotations

import atexit
import os
import shutil
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path

import llvmlite
import numba

VARIABLE = "MARL_AIRHOCKEY_CACHE"
"""Environment variable that names the cache folder of the library."""
UNUSED = 30 * 24 * 3600.0
"""Time after which unused compiled code is deleted, s."""


def versions() -> dict[str, str]:
    """Return the versions of Python, numba and llvmlite, which compile the code."""
    python = f"{sys.version_info.major}.{sys.version_info.minor}"
    return {
        "python": python,
        "numba": numba.__version__,
        "llvmlite": llvmlite.__version__,
    }


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


def _candidates() -> Iterator[Path]:
    if given := os.environ.get(VARIABLE):
        yield Path(given)
    # Without a home folder there is no `Path.home`.
    with suppress(RuntimeError):
        home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        yield Path(home) / "marl_airhockey"
    if given := os.environ.get("NUMBA_CACHE_DIR"):
        yield Path(given) / "marl_airhockey"


@cache
def cache_folder() -> Path:
    """Return the cache folder of the library.

    It is MARL_AIRHOCKEY_CACHE, or ``marl_airhockey`` in the user's cache folder, or in
    NUMBA_CACHE_DIR if neither is writable. A read-only folder is used if it holds
    compiled code, as in a container. Without such a folder, this process and its child
    processes use a temporary folder, with a warning.
    """
    tried = []
    for folder in _candidates():
        if _writable(folder) or (folder / _code_name()).is_dir():
            return folder
        tried.append(str(folder))
    folder = Path(tempfile.mkdtemp(prefix="marl_airhockey-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    os.environ[VARIABLE] = str(folder)
    warnings.warn(
        f"cannot write to {' or '.join(tried) or 'a home folder'}: code is compiled "
        f"again in every process; set {VARIABLE} to a writable folder",
        RuntimeWarning,
        stacklevel=2,
    )
    return folder


def _code_name() -> str:
    return "-".join(["code", *versions().values()])


@cache
def code_folder() -> Path:
    """Return the folder of compiled code for the installed versions."""
    folder = cache_folder() / _code_name()
    # A read-only cache is still readable.
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
    return folder


def delete_unused() -> None:
    """Delete compiled code that has not been used for `UNUSED`."""
    oldest = time.time() - UNUSED
    for path in cache_folder().glob("code-*/*"):
        # Another process may delete the file at the same time.
        with suppress(OSError):
            if path.stat().st_mtime < oldest:
                path.unlink()

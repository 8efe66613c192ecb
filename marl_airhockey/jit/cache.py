"""Cache of compiled code: one folder for each version of the package's sources.

Numba's own cache checks only the file of a function itself, so a function that calls
functions of other files would keep running their old code after an edit. Here the
folder is named by a hash of all sources that compiled code can call: another version
of them never sees it. Neither the location of the package nor modification times
matter, so a fresh clone of the same sources starts with what an older one compiled.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import shutil
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, Literal, TypeVar, cast

import numba
from numba.core import config
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.compiler_lock import global_compiler_lock
from numba.extending import register_jitable

try:
    import fcntl
except ImportError:  # Windows: numba's own atomic writes have to do.
    fcntl = None  # type: ignore[assignment]

F = TypeVar("F", bound=Callable[..., Any])

VARIABLE = "MARL_AIRHOCKEY_CACHE"
"""Environment variable that names the folder of all that the library caches"""
PACKAGES = ("backends", "contracts", "core", "devices", "jit", "sensing", "toolkit")
"""Packages whose functions compiled code can call; their sources name the folder"""
UNUSED = 30 * 24 * 3600.0
"""Time after which the folder of other sources is deleted, s"""


@cache
def source_hash() -> str:
    """Return a hash of the sources in `PACKAGES` and of numba's version."""
    package = Path(__file__).parents[1]
    digest = hashlib.sha256(numba.__version__.encode())
    for name in PACKAGES:
        for path in sorted((package / name).rglob("*.py")):
            digest.update(path.relative_to(package).as_posix().encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


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
    """Return the folder of all that the library caches.

    That is MARL_AIRHOCKEY_CACHE, or else ``marl_airhockey`` in the user's cache
    folder, or in NUMBA_CACHE_DIR if neither can be written. A read-only one is used if
    it holds the compiled code of these sources, as in a container. If there is none, a
    temporary folder serves this process and those that it starts, with a warning.
    """
    tried = []
    for folder in _candidates():
        if _writable(folder) or (folder / f"code-{source_hash()}").is_dir():
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


@cache
def code_folder() -> Path:
    """Return the folder of the code that is compiled from these sources."""
    folder = cache_folder() / f"code-{source_hash()}"
    # A read-only cache can be read all the same.
    with suppress(OSError):
        if not folder.exists():
            _delete_unused(folder.parent)
            folder.mkdir(parents=True)
        os.utime(folder)
    return folder


def _delete_unused(root: Path) -> None:
    """Delete the folders of other sources that nobody has used for a while."""
    for folder in root.glob("code-*"):
        if time.time() - folder.stat().st_mtime > UNUSED:
            shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def one_process(name: str) -> Iterator[None]:
    """Keep other processes and threads out of what has this name.

    Threads are kept out by numba's own lock, as a second one could be taken in another
    order. Where a lock file cannot be made, no process is kept out.
    """
    with global_compiler_lock, ExitStack() as stack:
        if fcntl is not None:
            with suppress(OSError):
                code_folder().mkdir(parents=True, exist_ok=True)
                path = code_folder() / f"{name}.lock"
                file = stack.enter_context(path.open("w"))
                fcntl.flock(file, fcntl.LOCK_EX)
        yield


class _Locator:
    """Locator of a function's compiled code, as numba's caches expect one."""

    def __init__(self, function: Any) -> None:
        self._name = function.__module__
        self._line = function.__code__.co_firstlineno
        self._py_file = function.__code__.co_filename

    @classmethod
    def from_function(cls, function: Any, file: str) -> _Locator:
        """Return the locator of a function."""
        return cls(function)

    def ensure_cache_path(self) -> None:
        """Make the folder."""
        code_folder().mkdir(parents=True, exist_ok=True)

    def get_cache_path(self) -> str:
        """Return the folder."""
        return str(code_folder())

    def get_source_stamp(self) -> str:
        """Return what must be equal for compiled code to be used."""
        return source_hash()

    def get_disambiguator(self) -> str:
        """Return a text that differs between functions of one name."""
        name = hashlib.sha256(self._name.encode()).hexdigest()[:8]
        return f"{name}-{self._line}"


class _Implementation(CompileResultCacheImpl):
    _locator_classes = [_Locator]  # type: ignore[list-item]  # noqa: RUF012


class _Cache(FunctionCache):
    """Cache of one function, whose damaged entries are compiled again."""

    _impl_class = _Implementation

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return what was compiled for a signature; None if there is nothing."""
        try:
            return super().load_overload(sig, target_context)
        # A damaged pickle can raise anything.
        except Exception as error:
            print(
                f"marl_airhockey: the compiled code of {self._name} is damaged "
                f"({type(error).__name__}) and is compiled again",
                file=sys.stderr,
            )
            with suppress(OSError):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Store what was compiled for a signature, if the folder can be written."""
        # Two processes would give one name to the code of two signatures.
        with one_process("save"), suppress(OSError):
            super().save_overload(sig, data)


def compiled(
    *,
    nogil: bool = False,
    error_model: Literal["python", "numpy"] = "python",
    forceinline: bool = False,
) -> Callable[[F], F]:
    """Return a decorator that compiles a function by numba and caches its code.

    Args:
        nogil: Whether other threads may run meanwhile.
        error_model: "python" raises on a division by zero, "numpy" gives inf or nan.
        forceinline: Whether LLVM inlines every call.
    """

    def decorate(function: F) -> F:
        dispatcher: Any = numba.njit(
            nogil=nogil, error_model=error_model, forceinline=forceinline
        )(function)
        # With NUMBA_DISABLE_JIT it is a plain function.
        if not config.DISABLE_JIT:  # type: ignore[attr-defined]
            dispatcher._cache = _Cache(function)
        return cast("F", dispatcher)

    return decorate


def inner(
    *,
    error_model: Literal["python", "numpy"] = "python",
    forceinline: bool = False,
) -> Callable[[F], F]:
    """Return a decorator for a function that compiled code alone calls.

    It gets no entry for Python, which saves a tenth of the time to compile the
    physics, and no file of its own in the cache. Python runs it as it is written.

    Args:
        error_model: see `compiled`.
        forceinline: see `compiled`.
    """
    return register_jitable(
        error_model=error_model, forceinline=forceinline, no_cfunc_wrapper=True
    )

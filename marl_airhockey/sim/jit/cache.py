"""Cache of compiled code: a file for each function, its signature and its processor.

The name of a file contains a hash of everything that its code depends on
(`fingerprint`). After an edit, only the functions that it changes are compiled again,
and outdated code is never loaded. The location of the package and modification times
have no influence. A new clone of the same sources uses the code that an older clone
compiled.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, Literal, TypeVar, cast

import numba
from numba.core import config
from numba.core.compiler import CompileResult
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import cpu_target
from numba.core.serialize import dumps
from numba.core.sigutils import normalize_signature
from numba.extending import register_jitable

from marl_airhockey.sim.jit.fingerprint import fingerprint
from marl_airhockey.sim.jit.folders import code_folder, delete_unused
from marl_airhockey.sim.jit.shipped import Target, shipped

F = TypeVar("F", bound=Callable[..., Any])

used: set[Path] = set()
"""Files of compiled code that this process has loaded or written."""


@contextmanager
def one_process(name: str) -> Iterator[None]:
    """Exclude other processes and threads from the work with a name.

    Threads are excluded by numba's own lock, because a second lock could be taken in
    another order. If a lock file cannot be created, processes are not excluded.
    """
    from filelock import FileLock

    with global_compiler_lock, ExitStack() as stack:
        with suppress(OSError, NotImplementedError):
            code_folder().mkdir(parents=True, exist_ok=True)
            stack.enter_context(FileLock(code_folder() / f"{name}.lock"))
        yield


class CodeFiles:
    """Files of one function, with the interface of a cache of numba's dispatchers.

    Args:
        function: Python function.
        name: Fingerprint of the function; "" to compute it.
    """

    def __init__(self, function: Any, name: str = "") -> None:
        self._function, self._name = function, name

    def paths(self, signature: Any, target: Target) -> list[Path]:
        """Return the files that may hold the code of a signature, the best first.

        Args:
            signature: Numba types of the arguments, or a text that names them.
            target: System, processor and features for which this process compiles.
        """
        if not self._name:
            self._name = fingerprint(self._function)
        kinds, _ = normalize_signature(signature)
        readable = f"{self._function.__module__}.{self._function.__qualname__}"
        readable = readable.removeprefix("marl_airhockey.")

        def path(folder: Path, target: Target) -> Path:
            depends = self._name, [str(kind) for kind in kinds], target
            digest = hashlib.sha256(repr(depends).encode()).hexdigest()[:16]
            return folder / f"{readable}-{digest}.code"

        paths, known = [path(code_folder(), target)], shipped()
        if known.folder is not None:
            paths.append(path(known.folder, known.target))
        return paths

    def exist(self, signature: Any) -> bool:
        """Return True if there is code of a signature for this process."""
        target = cpu_target.target_context.codegen().magic_tuple()
        return any(path.exists() for path in self.paths(signature, target))

    def load_overload(self, signature: Any, context: Any) -> Any:
        """Return the compiled code of a signature; None if there is none."""
        context.refresh()
        for path in self.paths(signature, context.codegen().magic_tuple()):
            try:
                # The pickles were written by this user or belong to the package.
                found = pickle.loads(path.read_bytes())
                code = CompileResult._rebuild(context, *found)
            except OSError:
                continue
            # A damaged pickle can raise anything.
            except Exception as error:
                print(
                    f"marl_airhockey: the compiled code in {path} is damaged "
                    f"({type(error).__name__}) and is compiled again",
                    file=sys.stderr,
                )
                continue
            with suppress(OSError):
                os.utime(path)
            used.add(path)
            return code
        return None

    def save_overload(self, signature: Any, code: Any) -> None:
        """Store the compiled code of a signature if the folder is writable."""
        lifted = any(not loop.can_cache for loop in code.lifted)
        if lifted or code.library.has_dynamic_globals:
            return
        path = self.paths(signature, code.codegen.magic_tuple())[0]
        with suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            delete_unused()
            part = path.with_suffix(f".{os.getpid()}-{threading.get_ident()}")
            part.write_bytes(dumps(code._reduce()))
            part.replace(path)
            used.add(path)


def compiled(
    *,
    nogil: bool = False,
    error_model: Literal["python", "numpy"] = "python",
    forceinline: bool = False,
    name: str = "",
) -> Callable[[F], F]:
    """Return a decorator that compiles a function by numba and caches its code.

    Args:
        nogil: True to release the GIL while the function runs.
        error_model: "python" to raise on a division by zero, "numpy" to return inf or
            nan.
        forceinline: True to inline every call in LLVM.
        name: Fingerprint of the function; "" to compute it.
    """

    def decorate(function: F) -> F:
        dispatcher: Any = numba.njit(
            nogil=nogil, error_model=error_model, forceinline=forceinline
        )(function)
        # With NUMBA_DISABLE_JIT it is a plain function.
        if not config.DISABLE_JIT:  # type: ignore[attr-defined]
            dispatcher._cache = CodeFiles(function, name)
        return cast("F", dispatcher)

    return decorate


def inner(
    *,
    error_model: Literal["python", "numpy"] = "python",
    forceinline: bool = False,
) -> Callable[[F], F]:
    """Return a decorator for a function that only compiled code calls.

    The function has no entry point for Python, which saves a tenth of the time to
    compile the physics. It has no file in the cache. Python runs it uncompiled.

    Args:
        error_model: Error model, see `compiled`.
        forceinline: True to inline every call, see `compiled`.
    """

    def decorate(function: F) -> F:
        # A part of the function's fingerprint.
        vars(function)["options"] = f"{error_model} {forceinline}"
        return register_jitable(
            error_model=error_model, forceinline=forceinline, no_cfunc_wrapper=True
        )(function)

    return decorate

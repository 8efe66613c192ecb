"""Fingerprint of a compiled function: a hash of all that its machine code depends on.

Numba caches a function by its source file. It would therefore use outdated code of
functions and constants from other files. A fingerprint includes them: the bytecode of
the function and of all functions that it calls, and the values of all constants that
they read. Comments, docstrings and line numbers are not included. The code of Python,
numba and numpy is not included either. The name of the cache folder contains the
versions of Python and numba.
"""

from __future__ import annotations

import dis
import enum
import hashlib
import sys
from collections.abc import Callable
from functools import cache
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np
from numba.core.dispatcher import Dispatcher
from numba.core.types import Type

LIBRARIES = sys.stdlib_module_names | {"llvmlite", "numba", "numpy"}
"""Modules whose functions are identified by their names."""
PLAIN = (bool, int, float, complex, str, bytes, type(None), type(...), np.generic)
"""Types of constants that are identified by their `repr`."""


@cache
def fingerprint(function: Callable[..., Any]) -> str:
    """Return the fingerprint of a function, 16 hexadecimal digits.

    Args:
        function: Python function, or its numba dispatcher.

    Raises:
        TypeError: The function depends on a value that has no fingerprint.
    """
    walk = _Walk()
    walk.add(function)
    return walk.digest.hexdigest()[:16]


class _Walk:
    """Walk over everything that a function depends on; visits each object once."""

    def __init__(self) -> None:
        self.digest = hashlib.sha256()
        self._known: dict[int, int] = {}
        self._kept: list[Any] = []
        """Objects that were added. They are stored because Python reuses the id of a
        deleted object."""

    def _note(self, *texts: object) -> None:
        self.digest.update(repr(texts).encode())

    def add(self, value: Any) -> None:
        """Add a value and everything that it depends on."""
        if isinstance(value, PLAIN):
            self._note(type(value).__name__, repr(value))
        elif isinstance(value, (tuple, list)):
            self._note(type(value).__name__, len(value))
            for item in value:
                self.add(item)
        elif isinstance(value, dict):
            self._note("dict", len(value))
            for key in sorted(value):
                self._note(key)
                self.add(value[key])
        elif isinstance(value, np.ndarray):
            self._note(value.dtype.descr, value.shape)
            self.digest.update(value.tobytes())
        elif id(value) in self._known:
            self._note("known", self._known[id(value)])
        else:
            self._known[id(value)] = len(self._known)
            self._kept.append(value)
            self._add_object(value)

    def _add_object(self, value: Any) -> None:
        if isinstance(value, Dispatcher):
            self._note("compiled", sorted(value.targetoptions.items()))
            self.add(value.py_func)
        elif hasattr(value, "_defn"):  # What numba.extending.intrinsic returns.
            self.add(value._defn)
        elif _is_of_library(value):
            name = getattr(value, "__qualname__", None) or repr(value)
            self._note(getattr(value, "__module__", None), name)
        elif isinstance(value, FunctionType):
            self._add_function(value)
        elif isinstance(value, type):
            self._add_class(value)
        else:
            raise TypeError(
                f"compiled code depends on {value!r}, which has no fingerprint: use a "
                "number, a text, an array, a tuple, a function or a class"
            )

    def _add_function(self, function: FunctionType) -> None:
        self._note("function")
        self.add(vars(function))
        self.add(function.__defaults__)
        self.add(function.__kwdefaults__)
        self.add([cell.cell_contents for cell in function.__closure__ or ()])
        names = self._add_code(function.__code__)
        self._add_names(function.__globals__, names)

    def _add_names(self, known: dict[str, Any], names: set[str]) -> None:
        """Add the values of names in a module, including those of imported modules."""
        for name in sorted(names & known.keys()):
            value = known[name]
            self._note("name", name)
            if isinstance(value, ModuleType):
                self._note("module", value.__name__)
                if not _is_of_library(value):
                    self._add_names(vars(value), names)
            else:
                self.add(value)

    def _add_class(self, kind: type) -> None:
        self._note("class", kind.__qualname__, getattr(kind, "_fields", None))
        if issubclass(kind, enum.Enum):
            self._note([(item.name, item.value) for item in kind])
        elif not issubclass(kind, tuple):
            for name, member in vars(kind).items():
                if isinstance(member, FunctionType):
                    self._note(name)
                    self.add(member)

    def _add_code(self, code: CodeType) -> set[str]:
        """Add bytecode and constants; return the names that the code looks up."""
        self._note(code.co_code, code.co_exceptiontable, code.co_flags, code.co_names)
        self._note(code.co_varnames, code.co_freevars, code.co_cellvars)
        names = set(code.co_names)
        for constant in code.co_consts[_has_docstring(code) :]:
            if isinstance(constant, CodeType):
                names |= self._add_code(constant)
            elif isinstance(constant, frozenset):
                self.add(sorted(constant, key=repr))
            else:
                self.add(constant)
        return names


def _has_docstring(code: CodeType) -> bool:
    """Return True if the first constant is a text that no instruction reads."""
    first = next(iter(code.co_consts), None)
    pairs = zip(code.co_code[::2], code.co_code[1::2], strict=True)
    return isinstance(first, str) and not any(
        argument == 0 and operation in dis.hasconst for operation, argument in pairs
    )


def _is_of_library(value: Any) -> bool:
    """Return True if a value belongs to Python, numpy or numba."""
    if isinstance(value, (np.ufunc, np.dtype, Type, BuiltinFunctionType)):
        return True
    named = "__name__" if isinstance(value, ModuleType) else "__module__"
    return str(getattr(value, named, "")).partition(".")[0] in LIBRARIES

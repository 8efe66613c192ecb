"""Code generator: writes a tape as a loop over worlds and compiles it with numba.

The sources are kept in the folder of compiled code (`cache`), with what numba makes of
them, so that a loop is compiled once per machine.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from numba.core.dispatcher import Dispatcher

from marl_airhockey.jit.cache import code_folder, compiled, one_process
from marl_airhockey.jit.notices import announced_compilation, announced_wait
from marl_airhockey.jit.tracer import Symbol, Tape
from marl_airhockey.types import Array

Call = Callable[..., tuple[dict[str, Array], ...]]
"""Function that calls a loop, with its output arrays and the mappings of inputs."""
Name = tuple[int, str]
"""Name of an input: index of its source, and its key there."""

INFIX = {
    "add": "+",
    "subtract": "-",
    "multiply": "*",
    "divide": "/",
    "less": "<",
    "less_equal": "<=",
    "greater": ">",
    "greater_equal": ">=",
    "equal": "==",
    "not_equal": "!=",
    "bitwise_and": "&",
    "bitwise_or": "|",
}
"""Operations that numba compiles faster as operators."""
COMPARED = {"maximum": "<", "minimum": ">"}
"""Comparisons by which a known number takes the place of a symbol."""
_loaded: dict[str, Loaded] = {}


class Writer:
    """Writer of a module for a tape: the loop, and its call with mappings.

    Args:
        tape: recorded operations.
        kinds: dtype of each input.
    """

    def __init__(self, tape: Tape, kinds: Mapping[Name, Any]) -> None:
        self._tape, self._kinds = tape, kinds
        self._stores: list[tuple[str, Any]] = []
        self._outputs: list[str] = []
        """Numba types of the outputs"""
        self._sinks: list[list[str]] = []
        self._live: set[Symbol] = set()
        self.inputs: dict[Name, str] = {}
        """Variables of the used inputs, by name"""
        self._axes: dict[Name, int] = {}

    def begin_sink(self) -> None:
        """Start the next mapping of outputs."""
        self._sinks.append([])

    def store(self, key: str, place: Array, dtype: Any) -> None:
        """Write an array of one world, (*) scalars, to a fresh output."""
        variable = f"o{len(self._outputs)}"
        self._outputs.append(_type(dtype, 1 + place.ndim))
        self._sinks[-1].append(f"{key!r}: {variable}")
        for index in np.ndindex(place.shape):
            self._stores.append((_element(variable, index), place[index]))
            self._mark(place[index])

    def _mark(self, scalar: Any) -> None:
        """Mark the symbols that a scalar depends on as needed."""
        waiting = [scalar]
        while waiting:
            symbol = waiting.pop()
            if not isinstance(symbol, Symbol) or symbol in self._live:
                continue
            self._live.add(symbol)
            if symbol.op == "input":
                name, index = symbol.args
                self.inputs.setdefault(name, f"i{len(self.inputs)}")
                self._axes[name] = 1 + len(index)
            else:
                waiting += symbol.args

    def source(self, sources: int) -> str:
        """Return the source of the module for a number of sources."""
        live = [s for s in self._tape.symbols.values() if s in self._live]
        names = {symbol: f"t{i}" for i, symbol in enumerate(live)}
        body = [f"{names[s]} = {self._expression(s, names)}" for s in live]
        body += [f"{place} = {_named(s, names)}" for place, s in self._stores]
        types = [_type(self._kinds[n], self._axes[n]) for n in self.inputs]
        outputs = [f"o{i}" for i in range(len(self._outputs))]
        given = [_lookup(name) for name in self.inputs]
        variables = [*self.inputs.values(), *outputs]
        sinks = ", ".join("{" + ", ".join(sink) + "}" for sink in self._sinks)
        lines = [
            '"""Written by marl_airhockey.jit.codegen; may be deleted at any time."""',
            "import numpy as np",
            "from numpy import inf, nan",
            f"SIGNATURE = 'void({', '.join([*types, *self._outputs])})'",
            f"def kernel({', '.join(variables)}):",
            f"    for b in range({variables[0]}.shape[0]):",
            *(f"        {line}" for line in body),
            f"def call(kernel, outputs, {', '.join(f's{i}' for i in range(sources))}):",
            f"    ({', '.join(outputs)},) = outputs",
            f"    kernel({', '.join([*given, *outputs])})",
            f"    return ({sinks},)",
        ]
        return "\n".join(lines) + "\n"

    def _expression(self, symbol: Symbol, names: dict[Symbol, str]) -> str:
        """Return a symbol as an expression of numba."""
        op = symbol.op
        if op == "input":
            name, index = symbol.args
            return _element(self.inputs[name], index)
        args = [_named(a, names) for a in symbol.args]
        if op == "where":
            return f"{args[1]} if {args[0]} else {args[2]}"
        truths = all(_is_truth(a) for a in symbol.args)
        if op == "invert" and truths:
            return f"not {args[0]}"
        if op in COMPARED and not isinstance(symbol.args[1], Symbol):
            # As np.maximum and np.minimum, nan included, and faster.
            return f"{args[1]} if {args[0]} {COMPARED[op]} {args[1]} else {args[0]}"
        if op in INFIX and not (truths and op in ("add", "multiply")):
            return f" {INFIX[op]} ".join(args)
        return f"np.{op}({', '.join(args)})"


def _lookup(name: Name) -> str:
    return f"s{name[0]}[{name[1]!r}]"


def _element(variable: str, index: tuple[int, ...]) -> str:
    return f"{variable}[{', '.join(map(str, ('b', *index)))}]"


def _named(scalar: Any, names: dict[Symbol, str]) -> str:
    return names[scalar] if isinstance(scalar, Symbol) else repr(scalar)


def _is_truth(scalar: Any) -> bool:
    value = scalar.value if isinstance(scalar, Symbol) else scalar
    return isinstance(value, (bool, np.bool_))


def _type(dtype: Any, axes: int) -> str:
    """Return the type of a contiguous array as numba writes it."""
    name = "boolean" if dtype == np.bool_ else np.dtype(dtype).name
    return f"{name}[{':, ' * (axes - 1)}::1]"


class Loaded(NamedTuple):
    """Generated module, and its compiled function."""

    kernel: Callable[..., Any]
    """Compiled function of the module"""
    module: ModuleType


def load(source: str, name: str, names: Mapping[str, Any] | None = None) -> Loaded:
    """Load a module and compile its ``kernel`` for its ``SIGNATURE`` with numba.

    What is not in the cache is announced on stderr, once for several in a row.

    Args:
        source: text of the module.
        name: subject of the announcement.
        names: further global names of the module.
    """
    digest = hashlib.sha256(source.encode()).hexdigest()[:24]
    if digest not in _loaded:
        path = code_folder() / f"loop_{digest}.py"
        if path.exists():
            _loaded[digest] = _compile(source, path, names)
        else:
            # Another process that needs it too waits, and then finds it.
            with ExitStack() as stack:
                with announced_wait(name):
                    stack.enter_context(one_process(path.stem))
                _compile_first(source, path, name, names)
    return _loaded[digest]


FEW_FUNCTIONS = 40
"""Number of functions in the cache below which most of a scenario is not there yet"""


def _compile_first(
    source: str, path: Path, name: str, names: Mapping[str, Any] | None
) -> None:
    """Compile a module that was not in the cache, and write its source there."""
    digest = path.stem.removeprefix("loop_")
    if path.exists():
        _loaded[digest] = _compile(source, path, names)
        return
    first = len(list(path.parent.glob("*.nbi"))) < FEW_FUNCTIONS
    with announced_compilation(name, first):
        _loaded[digest] = _compile(source, path, names)
    # The source comes last: where it is, its compiled code is, too.
    with suppress(OSError):
        part = path.with_suffix(f".{os.getpid()}")
        part.write_text(source)
        part.replace(path)


def _compile(source: str, path: Path, names: Mapping[str, Any] | None) -> Loaded:
    """Return a module, compiled or taken from the cache."""
    module = ModuleType(path.stem)
    # The module must be importable when numba takes a loop from its cache.
    sys.modules[path.stem] = module
    exec(compile(source, str(path), "exec"), vars(module))
    vars(module).update(names or {})
    kernel = compiled(nogil=True, error_model="numpy")(module.kernel)
    if isinstance(kernel, Dispatcher):
        kernel.compile(module.SIGNATURE)
        kernel.disable_compile()
    return Loaded(kernel, module)

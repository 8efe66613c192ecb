"""Code generator: writes a tape as a module with a loop and compiles it with numba.

The result is stored in the folder of compiled code (`cache`), so a loop is compiled
once per machine.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from functools import cache
from types import ModuleType
from typing import Any, NamedTuple, cast

import numpy as np
from numba.core.dispatcher import Dispatcher

from marl_airhockey.sim.jit.cache import CodeFiles, compiled, one_process
from marl_airhockey.sim.jit.fingerprint import fingerprint
from marl_airhockey.sim.jit.folders import code_folder
from marl_airhockey.sim.jit.lowering import loop
from marl_airhockey.sim.jit.notices import announced_compilation, announced_wait
from marl_airhockey.sim.jit.shipped import shipped
from marl_airhockey.sim.jit.tracer import Symbol, Tape
from marl_airhockey.types import Array

Call = Callable[..., tuple[dict[str, Array], ...]]
"""Function that calls a loop, with its output arrays and the mappings of inputs."""
Name = tuple[int, str]
"""Name of an input: index of its source, and its key there."""

_loaded: dict[str, Loaded] = {}


class Writer:
    """Writer of a module for a tape: the loop, and a function that calls it.

    Args:
        tape: Recorded operations.
        inputs: Arrays (B, *) by name. Only their types and shapes are used.
    """

    def __init__(self, tape: Tape, inputs: Mapping[Name, Array]) -> None:
        self._tape, self._arrays = tape, inputs
        self._stores: list[tuple[int, int, Any]] = []
        """Index of an output, index of an element in its row, and stored scalar."""
        self._outputs: list[tuple[str, int]] = []
        """Numba types of the outputs, and the sizes of their rows."""
        self._sinks: list[list[str]] = []
        self._live: set[Symbol] = set()
        self.inputs: dict[Name, int] = {}
        """Indices of the used inputs, by name."""

    def begin_sink(self) -> None:
        """Start the next mapping of outputs."""
        self._sinks.append([])

    def store(self, key: str, place: Array, dtype: Any) -> None:
        """Store the scalars (*) of one world in a new output."""
        output = len(self._outputs)
        self._outputs.append((_type(dtype, 1 + place.ndim), place.size))
        self._sinks[-1].append(f"{key!r}: o{output}")
        for element, scalar in enumerate(place.flat):
            self._stores.append((output, element, scalar))
            self._mark(scalar)

    def _mark(self, scalar: Any) -> None:
        """Mark the symbols that a scalar depends on as needed."""
        waiting = [scalar]
        while waiting:
            symbol = waiting.pop()
            if not isinstance(symbol, Symbol) or symbol in self._live:
                continue
            self._live.add(symbol)
            if symbol.op == "input":
                self.inputs.setdefault(symbol.args[0], len(self.inputs))
            else:
                waiting += symbol.args

    def source(self, sources: int) -> str:
        """Return the source of the module for a number of sources."""
        live = [s for s in self._tape.symbols.values() if s in self._live]
        index = {symbol: k for k, symbol in enumerate(live)}
        arrays, first = [self._arrays[name] for name in self.inputs], len(self.inputs)
        types = [_type(a.dtype, a.ndim) for a in arrays]
        types += [kind for kind, _ in self._outputs]
        sizes = [a[0].size for a in arrays] + [size for _, size in self._outputs]
        inputs = [f"i{k}" for k in range(first)]
        outputs = [f"o{k}" for k in range(len(self._outputs))]
        variables = ", ".join([*inputs, *outputs])
        given = [f"s{i}[{key!r}]" for i, key in self.inputs]
        sinks = ", ".join("{" + ", ".join(sink) + "}" for sink in self._sinks)
        lines = [
            '"""Written by marl_airhockey.sim.jit.codegen."""',
            "import numpy as np",
            "from numpy import inf, nan",
            "from marl_airhockey.sim.jit.lowering import loop",
            f"SIGNATURE = 'void({', '.join(types)})'",
            f"run = loop({sizes}, [",
            *(f"    {self._operation(symbol, index)}," for symbol in live),
            "], [",
            *(
                f"    ({first + o}, {k}, {_named(s, index)}),"
                for o, k, s in self._stores
            ),
            "])",
            f"def kernel({variables}):",
            f"    run(({variables},))",
            f"def call(kernel, outputs, {', '.join(f's{i}' for i in range(sources))}):",
            f"    ({', '.join(outputs)},) = outputs",
            f"    kernel({', '.join([*given, *outputs])})",
            f"    return ({sinks},)",
        ]
        return "\n".join(lines) + "\n"

    def _operation(self, symbol: Symbol, index: Mapping[Symbol, int]) -> str:
        """Return a symbol as `lowering.Operation`."""
        if symbol.op == "input":
            name, place = symbol.args
            element = np.ravel_multi_index(place, self._arrays[name].shape[1:])
            return f"('input', {self.inputs[name]}, {element})"
        args = "".join(f", {_named(a, index)}" for a in symbol.args)
        return f"({symbol.op!r}{args})"


def _named(scalar: Any, index: Mapping[Symbol, int]) -> str:
    """Return a scalar as `lowering.Argument`."""
    return str(index[scalar]) if isinstance(scalar, Symbol) else f"({scalar!r},)"


def _type(dtype: Any, axes: int) -> str:
    """Return the type of a contiguous array as numba writes it."""
    name = "boolean" if dtype == np.bool_ else np.dtype(dtype).name
    return f"{name}[{':, ' * (axes - 1)}::1]"


class Loaded(NamedTuple):
    """Generated module, and its compiled function."""

    kernel: Callable[..., Any]
    """Compiled function of the module."""
    module: ModuleType


def load(source: str, name: str, names: Mapping[str, Any] | None = None) -> Loaded:
    """Load a module and compile its ``kernel`` for its ``SIGNATURE`` with numba.

    A compilation is announced on stderr, once for several compilations in a row.

    Args:
        source: Source code of the module.
        name: Subject of the announcement.
        names: Additional global names of the module.
    """
    names = names or {}
    called = [fingerprint(function) for function in names.values()]
    depends = repr((source, _translation(), called))
    digest = hashlib.sha256(depends.encode()).hexdigest()[:24]
    if digest not in _loaded:
        module = ModuleType(f"loop_{digest}")
        # The module must be importable when numba takes a loop from its cache.
        sys.modules[module.__name__] = module
        exec(compile(source, f"{module.__name__}.py", "exec"), vars(module))
        vars(module).update(names)
        _loaded[digest] = Loaded(_compiled(module, digest, name), module)
    return _loaded[digest]


@cache
def _translation() -> str:
    """Return the fingerprint of how operations become machine code."""
    return fingerprint(loop)


def _compiled(module: ModuleType, digest: str, name: str) -> Callable[..., Any]:
    """Return the kernel of a module, compiled or taken from the cache."""
    kernel = compiled(nogil=True, error_model="numpy", name=digest)(module.kernel)
    if not isinstance(kernel, Dispatcher):
        return cast(Callable[..., Any], kernel)
    files = CodeFiles(module.kernel, digest)
    with ExitStack() as stack:
        if not files.exist(module.SIGNATURE):
            # Another process that needs the same code waits here and then finds it.
            with announced_wait(name):
                stack.enter_context(one_process(module.__name__))
            if not files.exist(module.SIGNATURE):
                why = shipped().reason
                stack.enter_context(announced_compilation(name, _is_first(), why))
        kernel.compile(module.SIGNATURE)
    kernel.disable_compile()
    return kernel


FEW_FUNCTIONS = 15
"""Number of functions in the cache below which most functions of a scenario are
missing."""


def _is_first() -> bool:
    return len(list(code_folder().glob("*.code"))) < FEW_FUNCTIONS

"""Fused functions: pure NumPy functions over worlds, each compiled into one loop.

Scenarios and observables are written for arrays (..., *) with any leading axes. They
can therefore run once on symbols of a single world (`tracer`), and numba compiles the
recorded operations. The loop needs no temporary arrays and no NumPy call per operation.
Code that cannot be traced runs in NumPy, with a warning that gives the reason.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numba.core.config import DISABLE_JIT  # type: ignore[attr-defined]

from marl_airhockey.sim.jit.buffers import BufferPool
from marl_airhockey.sim.jit.codegen import Loaded, Writer, load
from marl_airhockey.sim.jit.pipeline import Stage
from marl_airhockey.sim.jit.threads import over_rows, spreads
from marl_airhockey.sim.jit.tracer import Tape
from marl_airhockey.types import Array

Source = Mapping[str, Any]
"""Named arrays (B, *), and other values that all worlds share."""
Sink = dict[str, Array]
"""Named arrays (B, *)."""
Function = Callable[..., tuple[Sink, ...]]
"""Function from sources to sinks with any leading axes."""


class Fused:
    """Function of named arrays over worlds, compiled for the arrays of its first call.

    Args:
        function: Pure function from mappings to mappings of arrays (..., *).
        name: Name of the function in warnings and announcements.
    """

    def __init__(self, function: Function, name: str) -> None:
        self._function, self._name = function, name
        self._loop: _Loop | None = None
        self.refused: str | None = None
        """Reason why the function runs in NumPy; None if it is compiled or was not
        called yet."""

    @property
    def prepared(self) -> bool:
        """True if the function is compiled, or cannot be compiled."""
        return self._loop is not None or self.refused is not None

    def prepare(self, *sources: Source) -> tuple[Sink, ...]:
        """Compile for arrays like these and return the sinks, freshly allocated."""
        plain = self._function(*sources)
        off = os.environ.get("MARL_AIRHOCKEY_COMPILE", "1") == "0" or DISABLE_JIT
        if self._loop is None and self.refused is None and not off:
            try:
                loop = _Loop(self._function, sources, plain, self._name)
                _compare(loop(sources), plain)
                self._loop = loop
            except Exception as error:
                self._refuse(error)
        if self._loop is not None:
            return self._loop(sources)
        # Copies, because the function may have returned its arguments.
        return tuple(
            {key: np.array(array, order="C") for key, array in sink.items()}
            for sink in plain
        )

    def __call__(self, *sources: Source) -> tuple[Sink, ...]:
        """Return the sinks for all worlds of the sources, freshly allocated."""
        if self._loop is None:
            return self.prepare(*sources)
        try:
            return self._loop(sources)
        except TypeError as error:
            self._loop = None
            self._refuse(error)
        return self.prepare(*sources)

    def at(self, worlds: Array, *sources: Source) -> tuple[Sink, ...]:
        """Return the sinks for some worlds (W,), by index, freshly allocated."""
        if self._loop is not None:
            sources = self._loop.needed(sources)
        return self(*({k: _rows(v, worlds) for k, v in s.items()} for s in sources))

    def stage(self, sources: tuple[Source, ...], sinks: tuple[Sink, ...]) -> Stage:
        """Return a stage that fills ``sinks`` from ``sources``, stored by reference.

        Args:
            sources: Mappings like the arguments of `prepare`.
            sinks: Mappings like the results of `prepare`.
        """
        if self._loop is not None:
            return self._loop.stage(sources, sinks)
        return Stage(_write, (self._function, sources, sinks))

    def _refuse(self, error: Exception) -> None:
        self.refused = f"{type(error).__name__}: {error}"
        warnings.warn(
            f"{self._name} runs as plain numpy, which is slower, because it could "
            f"not be compiled ({self.refused})",
            RuntimeWarning,
            stacklevel=3,
        )


def _rows(value: Any, worlds: Array) -> Any:
    # `take` is several times faster than an index.
    return value.take(worlds, 0) if isinstance(value, np.ndarray) else value


def _write(function: Function, sources: tuple[Source, ...], sinks: Any) -> None:
    """Call a NumPy function and copy its arrays into sinks."""
    for made, sink in zip(function(*sources), sinks, strict=True):
        for key, array in sink.items():
            array[...] = made[key]


class _Loop:
    """Traced function as a compiled loop. Copies and pickles hold only its source."""

    def __init__(
        self,
        function: Function,
        sources: tuple[Source, ...],
        plain: tuple[Sink, ...],
        name: str,
    ) -> None:
        tape = Tape()
        arrays: dict[tuple[int, str], Array] = {}
        symbolic = []
        for i, source in enumerate(sources):
            row = dict(source)
            for key, value in source.items():
                if isinstance(value, np.ndarray):
                    arrays[i, key] = value
                    row[key] = tape.array((i, key), value[0])
            symbolic.append(row)
        writer = Writer(tape, arrays)
        outputs: list[tuple[tuple[int, ...], Any]] = []
        for sink, real in zip(function(*symbolic), plain, strict=True):
            writer.begin_sink()
            for key, out in sink.items():
                place = np.asarray(out).astype(object)
                shape, dtype = real[key].shape[1:], real[key].dtype
                if place.shape != shape:
                    raise ValueError(f"{key} has shape {place.shape} in a single world")
                writer.store(key, place, dtype)
                outputs.append((shape, dtype))
        self._name, self._counted = name, next(iter(arrays))
        self._source = writer.source(len(sources))
        self._inputs = list(writer.inputs)
        self._kinds = [arrays[name].dtype for name in writer.inputs]
        self._kinds += [dtype for _, dtype in outputs]
        self._pool = BufferPool(outputs)
        self._loaded: Loaded | None = None
        self._load()

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_loaded": None}

    def _load(self) -> Loaded:
        if self._loaded is None:
            self._loaded = load(self._source, self._name)
        return self._loaded

    def __call__(self, sources: tuple[Source, ...]) -> tuple[Sink, ...]:
        """Call the loop with freshly allocated outputs."""
        kernel, module = self._loaded or self._load()
        i, key = self._counted
        rows = len(sources[i][key])
        outputs = self._pool.take(rows)
        if spreads(rows):
            kernel = self._spread
        try:
            return module.call(kernel, outputs, *sources)  # type: ignore[no-any-return]
        except TypeError:
            return module.call(self._copying, outputs, *sources)  # type: ignore[no-any-return]

    def needed(self, sources: tuple[Source, ...]) -> tuple[Source, ...]:
        """Return the sources with only the arrays that the loop reads."""
        kept: tuple[dict[str, Array], ...] = tuple({} for _ in sources)
        for i, key in (self._counted, *self._inputs):
            kept[i][key] = sources[i][key]
        return kept

    def stage(self, sources: tuple[Source, ...], sinks: tuple[Sink, ...]) -> Stage:
        """Return a stage that fills ``sinks`` from ``sources``; see `Fused.stage`."""
        given = [sources[i][key] for i, key in self._inputs]
        outputs = [array for sink in sinks for array in sink.values()]
        return Stage(self._load().kernel, (*given, *outputs), generated=True)

    def _copying(self, *arrays: Array) -> None:
        """Call the loop on copies of arrays that are not contiguous or of another type.

        Raises:
            TypeError: A copy would lose precision.
        """
        pairs = zip(arrays, self._kinds, strict=True)
        kernel = self._load().kernel
        kernel(*[a.astype(k, "C", "safe", copy=False) for a, k in pairs])

    def _spread(self, *arrays: Array) -> None:
        kernel = self._load().kernel

        def work(rows: slice) -> None:
            kernel(*[array[rows] for array in arrays])

        over_rows(work, len(arrays[0]))


def _compare(done: tuple[Sink, ...], plain: tuple[Sink, ...]) -> None:
    """Check that the loop computes the same values as NumPy."""
    for mine, real in zip(done, plain, strict=True):
        for key, array in real.items():
            if not np.allclose(mine[key], array, 1e-5, 1e-6, equal_nan=True):
                raise ValueError(f"{key} differs from the result of numpy")

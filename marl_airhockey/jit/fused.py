"""Pure numpy functions over worlds, compiled into one loop over the worlds.

Scenarios and views are written for arrays (..., *) whose leading axes are the caller's.
So they can be run once on symbols of a single world (`symbols`), and what they did is
compiled by numba: no temporaries, and no price of a numpy call for every operation.
Code that cannot be traced runs as it is, with a warning that says why.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from marl_airhockey.jit.buffers import BufferPool
from marl_airhockey.jit.codegen import Call, Writer, load
from marl_airhockey.jit.pipeline import NotCompilable, Stage
from marl_airhockey.jit.threads import over_rows, spreads
from marl_airhockey.jit.tracer import Tape
from marl_airhockey.types import Array

Source = Mapping[str, Any]
"""Named arrays (B, *), and other things that do not differ between worlds."""
Sink = dict[str, Array]
"""Named arrays (B, *)."""
Function = Callable[..., tuple[Sink, ...]]
"""Takes sources and gives sinks, leading axes being the caller's."""


class Fused:
    """A function of named arrays over worlds, compiled at its first call.

    Args:
        function: pure; takes mappings and gives mappings of arrays (..., *).
        name: of what it does, for warnings.
    """

    def __init__(self, function: Function, name: str) -> None:
        self._function, self._name = function, name
        self._plan: _Plan | None = None
        self.refused: str | None = None
        """Why it runs as plain numpy, if it does."""

    def __call__(self, *sources: Source) -> tuple[Sink, ...]:
        """The sinks, for all worlds of the sources, in arrays that nobody else has."""
        if self._plan is not None:
            try:
                return self._plan(sources)
            except TypeError as error:
                self._plan = None
                self._refuse(error)
        plain = self._function(*sources)
        if self.refused is None:
            try:
                plan = _Plan(self._function, sources, plain)
                done = plan(sources)
                _compare(done, plain)
            except Exception as error:
                self._refuse(error)
            else:
                self._plan = plan
                return done
        # Copies, as numpy may have handed on what it was given.
        return tuple({k: np.array(v) for k, v in sink.items()} for sink in plain)

    def stage(self, sources: tuple[Source, ...], sinks: tuple[Sink, ...]) -> Stage:
        """The compiled loop from sources into sinks that it once gave, for a chain.

        Raises:
            Unchained: there is none for such arrays.
        """
        if self._plan is None:
            raise NotCompilable(f"{self._name} is not compiled")
        return self._plan.stage(sources, sinks)

    def _refuse(self, error: Exception) -> None:
        self.refused = f"{type(error).__name__}: {error}"
        warnings.warn(
            f"{self._name} runs as plain numpy, which is slower, because it could "
            f"not be compiled ({self.refused})",
            RuntimeWarning,
            stacklevel=3,
        )


class _Plan:
    """A traced function, compiled, with fresh output arrays for every call."""

    def __init__(
        self, function: Function, sources: tuple[Source, ...], plain: tuple[Sink, ...]
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
        writer = Writer(tape, {name: a.dtype for name, a in arrays.items()})
        kinds: list[tuple[tuple[int, ...], Any]] = []
        for sink, real in zip(function(*symbolic), plain, strict=True):
            writer.begin_sink()
            for key, out in sink.items():
                place = np.asarray(out).astype(object)
                shape, dtype = real[key].shape[1:], real[key].dtype
                if place.shape != shape:
                    raise ValueError(f"{key} has shape {place.shape} in a single world")
                writer.store(key, place, dtype)
                kinds.append((shape, dtype))
        self._count = next(iter(arrays))
        loaded = load(writer.source(len(sources)))
        self._kernel = loaded.kernel
        self._call: Call = loaded.module.call
        self._inputs = list(writer.inputs)
        self._kinds = [arrays[name].dtype for name in writer.inputs]
        self._kinds += [dtype for _, dtype in kinds]
        self._pool = BufferPool(kinds)
        self._copied = False
        """Whether some array is not as at the first call (rows one behind the other,
        the same type) and must be copied."""

    def __call__(self, sources: tuple[Source, ...]) -> tuple[Sink, ...]:
        """Call the loop."""
        i, key = self._count
        outputs = self._pool.take(len(sources[i][key]))
        if self._copied:
            return self._call(self._copying, outputs, *sources)
        try:
            if spreads(len(sources[i][key])):
                return self._call(self._spread, outputs, *sources)
            return self._call(self._kernel, outputs, *sources)
        except TypeError:
            self._copied = True
            return self._call(self._copying, outputs, *sources)

    def stage(self, sources: tuple[Source, ...], sinks: tuple[Sink, ...]) -> Stage:
        """See `Fused.stage`."""
        given = [sources[i][key] for i, key in self._inputs]
        outputs = [array for sink in sinks for array in sink.values()]
        kinds = [array.dtype for array in (*given, *outputs)]
        if kinds != self._kinds:
            raise NotCompilable(f"arrays are {kinds}, the loop is for {self._kinds}")
        return Stage(self._kernel, (*given, *outputs))

    def _copying(self, *arrays: Array) -> None:
        """The loop, on copies where need be; TypeError where a number would suffer."""
        pairs = zip(arrays, self._kinds, strict=True)
        self._kernel(*[a.astype(k, "C", "safe", copy=False) for a, k in pairs])

    def _spread(self, *arrays: Array) -> None:
        def work(rows: slice) -> None:
            self._kernel(*[array[rows] for array in arrays])

        over_rows(work, len(arrays[0]))


def _compare(done: tuple[Sink, ...], plain: tuple[Sink, ...]) -> None:
    """Refuse a loop that does not compute what numpy computed."""
    for mine, real in zip(done, plain, strict=True):
        for key, array in real.items():
            if not np.allclose(mine[key], array, 1e-5, 1e-6, equal_nan=True):
                raise ValueError(f"{key} differs from what numpy makes of it")

"""Functions that a GPU repeats as one CUDA graph."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar

import torch

Result = TypeVar("Result")


class Recorded(Generic[Result]):
    """Function whose kernels a GPU repeats as one CUDA graph.

    The first call runs the function, which prepares the device. The second call records
    it. Later calls repeat the record, without Python. The function must therefore do
    the same in each call, with the same tensors.

    Args:
        function: Function, which waits for nothing.
        graph: False to run the function in each call.
    """

    def __init__(self, function: Callable[[], Result], graph: bool) -> None:
        self._function, self._wanted = function, graph
        self._calls = 0
        self._graph: Any = None
        self._result: Result

    def __call__(self) -> Result:
        """Return the result, whose tensors the next call overwrites."""
        self._calls += 1
        if not self._wanted or self._calls == 1:
            return self._function()
        if self._graph is None:
            self._graph = torch.cuda.CUDAGraph()
            with torch.cuda.graph(self._graph):
                self._result = self._function()
        self._graph.replay()
        return self._result

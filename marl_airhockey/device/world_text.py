"""Arrays of one world, and calls of the functions of a control step, as LLVM text."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from math import prod
from typing import Any

import numpy as np

from marl_airhockey.device.llvm_text import LlvmText
from marl_airhockey.sim.backends.numba.flight import block_space

HEADER = 64
"""Size of the header of a world, bytes: status (int32), and number of the episode's
start, counted over all worlds (int64), at `NUMBER`."""
NUMBER = 8
"""Position of the number of the start in the header."""
SPARE = 1 << 14
"""Size of the memory for arrays that functions create, in addition to those of free
flight, bytes. Doubles use a third of it."""


class WorldText(LlvmText):
    """Writer of functions that compute one world.

    In the functions, %world is the address of the world's image, %shared that of an
    image with the arrays that all worlds share, and %arena that of the memory for
    arrays that functions create.

    Args:
        facts: Description of the arrays and calls, see `code_export`.
        image: Arrays at the start of an episode.
    """

    def __init__(self, facts: Mapping[str, Any], image: bytes) -> None:
        super().__init__()
        self._facts, self._image = facts, image
        self._arrays = facts["arrays"]
        self._addresses = set(facts["offsets"])
        self._shared = {a["offset"] for a in self._arrays.values() if a.get("shared")}
        self.ring = len(image) + -len(image) % 16
        """Offset of the past that seats observe with a reaction time."""
        self.delayed = [
            (name, self._source(name))
            for name in self._arrays
            if name.startswith(("observe.state.", "observe.memory."))
        ]
        """Observed arrays, and the arrays that they are copies of."""
        self.slot = sum(rounded(self._bytes(name)) for name, _ in self.delayed)
        self.size = self.ring + (facts["reaction"] + 1) * self.slot
        """Size of the image of a world with its past, bytes."""
        movers = facts["bodies"]["blocks"][1]
        self.arena = block_space(movers).nbytes + SPARE
        """Size of the memory for arrays that the functions of a world create, bytes."""
        self.stride = HEADER + self.size + self.arena
        """Distance between two worlds in memory, bytes."""

    @property
    def functions(self) -> list[str]:
        """Names of the functions that the kernels call."""
        calls = [call for row in self._facts["calls"].values() for call in row]
        return list(dict.fromkeys(call["function"] for call in calls))

    def _bytes(self, name: str) -> int:
        """Return the size of an array, or of one of the moments."""
        entry = self._arrays.get(f"moment_0.{name}") or self._arrays[name]
        size: int = prod(entry["shape"]) * np.dtype(entry["dtype"]).itemsize
        return size

    def _source(self, name: str) -> str:
        """Return the name, without the moment, of what an observed array copies."""
        _, kind, rest = name.split(".", 2)
        return f"state.{rest}" if kind == "state" else f"verdict.memory.{rest}"

    def _call(self, name: str, odd: str) -> None:
        """Call the functions of a name, such as ``step`` for "step_0" and "step_1"."""
        calls = self._facts["calls"]
        both = [
            calls.get(name.format(n)) or calls.get(f"{name}_{n}") or calls[name]
            for n in range(2)
        ]
        for first, second in zip(*both, strict=True):
            self._call_one(first, second, odd)

    def _call_one(
        self, first: Mapping[str, Any], second: Mapping[str, Any], odd: str
    ) -> None:
        length = first["length"]
        self._add("call void @set_arena(ptr %arena)")
        table = self._local(f"[{length} x i64]")
        for index in range(length):
            words = [self._word(call["table"] + 8 * index) for call in (first, second)]
            is_address = first["table"] + 8 * index in self._addresses
            value = str(words[0])
            if is_address:
                place = self._selected(words, odd)
                value = self._new(f"ptrtoint ptr {place} to i64")
            slot = self._new(f"getelementptr i64, ptr {table}, i64 {index}")
            self._store("i64", value, slot)
        going, error = self._local("i8"), self._local("ptr")
        status = self._new(
            f"call i32 @inner.{first['function']}(ptr {going}, ptr {error}, ptr null, "
            f"ptr null, i64 {length}, i64 8, ptr {table}, i64 {length}, i64 8, i64 1)"
        )
        fine = self._new(f"icmp eq i32 {status}, 0")
        finite = self._load("i8", going)
        more = self._new(f"icmp ne i8 {finite}, 0")
        result = self._new(f"select i1 {fine}, i32 0, i32 -1")
        good = self._new(f"and i1 {fine}, {more}")
        number = self._count
        self._add(f"br i1 {good}, label %good_{number}, label %bad_{number}")
        self._lines += [f"bad_{number}:", f"  ret i32 {result}", f"good_{number}:"]

    def _word(self, at: int) -> int:
        found: int = struct.unpack_from("<q", self._image, at)[0]
        return found

    def _selected(self, offsets: Sequence[int], odd: str, more: int = 0) -> str:
        """Return the address at one of two offsets, plus ``more`` bytes."""
        first, second = offsets
        if first == second:
            return self._place(first + more, first in self._shared)
        offset = self._new(f"select i1 {odd}, i64 {second + more}, i64 {first + more}")
        return self._new(f"getelementptr i8, ptr %world, i64 {offset}")

    def _place(self, offset: int, shared: bool = False) -> str:
        base = "%shared" if shared else "%world"
        return self._new(f"getelementptr i8, ptr {base}, i64 {offset}")

    def _at(self, name: str, odd: str, kind: str = "moment", more: int = 0) -> str:
        """Return the address of an array of a moment, or without moments."""
        names = [f"{kind}_{n}.{name}" for n in range(2)]
        if names[0] not in self._arrays:
            names = [name, name]
        offsets = [self._arrays[n]["offset"] for n in names]
        assert not any(offset % 8 for offset in offsets), "arrays must be aligned"
        return self._selected(offsets, odd, more)

    def _row(self, array: str, size: int) -> str:
        """Return the address of the world's row of an array of results."""
        at = self._new(f"mul i64 %world_number, {size}")
        return self._new(f"getelementptr i8, ptr {array}, i64 {at}")


def rounded(size: int) -> int:
    """Return the next multiple of 8 of a size in bytes."""
    return size + -size % 8

"""Kernels of many worlds as LLVM text: a whole control step of one world in a thread.

The functions of a control step (`code_export`) read from a table where their arrays
are. Here, each table is filled with the addresses of the arrays of one world. Arrays
that all worlds share are read from one place.

A world has `HEADER` bytes, then its image (`sim.world.layout`), then the memory for
arrays that functions create. ``begin`` prepares the images of starts. ``step`` copies
the actions, calls the functions of a step, serves pucks, observes, copies the results,
and begins a new episode if one ended.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from math import prod
from typing import Any

import numpy as np

from marl_airhockey.device.llvm_text import LlvmText, double
from marl_airhockey.sim.backends.numba.flight import block_space
from marl_airhockey.toolkit.serves import SPREAD

HEADER = 64
"""Size of the header of a world, bytes: status (int32), and number of the episode
(int64) at `NUMBER`."""
NUMBER = 8
"""Position of the number of the episode in the header."""
SPARE = 1 << 14
"""Size of the memory for arrays that functions create, in addition to those of free
flight, bytes. Doubles use a third of it."""


class KernelText(LlvmText):
    """LLVM text of the kernels of a scenario.

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
        self.slot = sum(_rounded(self._bytes(name)) for name, _ in self.delayed)
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

    def text(self) -> str:
        """Return the functions ``world.begin`` and ``world.step`` of one world."""
        self._lines = []
        for function in self.functions:
            self._lines.append(
                f"declare i32 @inner.{function}(ptr, ptr, ptr, ptr, i64, i64, ptr, "
                "i64, i64, i64)"
            )
        self._begin()
        self._step()
        return "\n".join(self._lines) + "\n"

    def _bytes(self, name: str) -> int:
        """Return the size of an array, or of one of the moments."""
        entry = self._arrays.get(f"moment_0.{name}") or self._arrays[name]
        size: int = prod(entry["shape"]) * np.dtype(entry["dtype"]).itemsize
        return size

    def _source(self, name: str) -> str:
        """Return the name, without the moment, of what an observed array copies."""
        _, kind, rest = name.split(".", 2)
        return f"state.{rest}" if kind == "state" else f"verdict.memory.{rest}"

    def _begin(self) -> None:
        self._define(
            "internal i32 @world.begin(ptr %world, ptr %shared, i1 %odd, ptr %arena) "
            "alwaysinline"
        )
        for slot in range(self._facts["reaction"] + 1):
            self._note(slot, "%odd")
        self._observe("%odd")
        self._end(1)

    def _step(self) -> None:
        seats = self._bytes("verdict.outcome.reward") // 8
        shown = self._bytes("observe.observation")
        self._define(
            "internal i32 @world.step(ptr %memory, ptr %shared, ptr %starts, "
            "i64 %world_number, i64 %worlds, i64 %rows, i1 %odd, ptr %actions, "
            "ptr %observation, ptr %final, ptr %reward, ptr %ended, ptr %success) "
            "alwaysinline"
        )
        self._add(f"%far = mul i64 %world_number, {self.stride}")
        self._add("%header = getelementptr i8, ptr %memory, i64 %far")
        self._add(f"%world = getelementptr i8, ptr %header, i64 {HEADER}")
        self._add(f"%arena = getelementptr i8, ptr %world, i64 {self.size}")
        self._add("%odd_after = xor i1 %odd, true")
        given, size = self._at("inputs.action", "%odd"), 16 * seats
        self._copy(given, self._row("%actions", size), size)
        self._call("step", "%odd")
        self._serve()
        if self._facts["reaction"]:
            past, later = self._place(self.ring), self._place(self.ring + self.slot)
            self._add(
                f"call void @llvm.memmove.p0.p0.i64(ptr {past}, ptr {later}, "
                f"i64 {self._facts['reaction'] * self.slot}, i1 false)"
            )
        self._note(self._facts["reaction"], "%odd_after")
        self._observe("%odd_after")
        reward = self._at("verdict.outcome.reward", "%odd_after")
        self._copy(self._row("%reward", 8 * seats), reward, 8 * seats, row=True)
        success = self._at("episode.success", "%odd_after")
        self._copy(self._row("%success", seats), success, seats, row=True)
        observed = self._at("observe.observation", "%odd")
        self._branch(self._ended(), "over", "going")
        self._copy(self._row("%final", shown), observed, shown, row=True)
        self._restart()
        self._add("br label %going")
        self._lines.append("going:")
        self._copy(self._row("%observation", shown), observed, shown, row=True)
        self._end(1)

    def _ended(self) -> str:
        """Report whether the episode ended; return true if it did."""
        flags = []
        for k, name in enumerate(("terminated", "truncated")):
            flag = self._load("i8", self._at(f"verdict.outcome.{name}", "%odd_after"))
            skipped = self._new(f"mul i64 %worlds, {k}")
            number = self._new(f"add i64 %world_number, {skipped}")
            place = self._new(f"getelementptr i8, ptr %ended, i64 {number}")
            self._add(f"store i8 {flag}, ptr {place}")
            flags.append(flag)
        either = self._new(f"or i8 {flags[0]}, {flags[1]}")
        return self._new(f"icmp ne i8 {either}, 0")

    def _restart(self) -> None:
        """Begin the next episode of a world."""
        number = self._new(f"getelementptr i8, ptr %header, i64 {NUMBER}")
        before = self._load("i64", number)
        after = self._new(f"add i64 {before}, 1")
        self._add(f"store i64 {after}, ptr {number}")
        skipped = self._new(f"mul i64 {after}, %worlds")
        wanted = self._new(f"add i64 %world_number, {skipped}")
        row = self._new(f"urem i64 {wanted}, %rows")
        start = self._new(f"mul i64 {row}, {self.size}")
        begun = self._new(f"getelementptr i8, ptr %starts, i64 {start}")
        self._copy("%world", begun, self.size)

    def _serve(self) -> None:
        """Serve the pucks of a world that needs it, in its moment after the step."""
        if "moment_0.verdict.outcome.serves" not in self._arrays:
            return
        serves = self._load("i8", self._at("verdict.outcome.serves", "%odd_after"))
        some = self._new(f"icmp ne i8 {serves}, 0")
        self._branch(some, "serve", "served")
        self._call("show", "%odd_after")
        pucks = self._facts["bodies"]["pucks"]
        for puck in range(pucks[1] - pucks[0]):
            self._call("draw", "%odd_after")
            units = [self._unit(axis) for axis in range(2)]
            shown = self._at("headings", "%odd_after", "show", 8 * puck)
            heading = self._load("double", shown)
            real = self._new(f"fcmp ord double {heading}, {heading}")
            self._branch(real, f"serve_{puck}", f"after_{puck}")
            off = self._new(f"fmul double {units[0]}, {double(SPREAD)}")
            way = self._new(f"fadd double {heading}, {off}")
            edge = self._new(f"fmul double {units[1]}, {double(self._facts['spin'])}")
            for part, value in (("heading", way), ("edge", edge)):
                names = [f"serve_{n}_{puck}.{part}" for n in range(2)]
                offsets = [self._arrays[name]["offset"] for name in names]
                place = self._selected(offsets, "%odd_after")
                self._add(f"store double {value}, ptr {place}")
            self._call(f"serve_{{}}_{puck}", "%odd_after")
            self._add(f"br label %after_{puck}")
            self._lines.append(f"after_{puck}:")
        self._call("place", "%odd_after")
        self._add("br label %served")
        self._lines.append("served:")

    def _unit(self, axis: int) -> str:
        """Return a random number of a serve, -1 to 1."""
        drawn = self._load("double", self._at("draw.unit", "%odd", "", 8 * axis))
        twice = self._new(f"fmul double {drawn}, {double(2.0)}")
        return self._new(f"fsub double {twice}, {double(1.0)}")

    def _note(self, slot: int, odd: str) -> None:
        """Store what seats will observe in a slot of the past."""
        at = self.ring + slot * self.slot
        for name, source in self.delayed:
            self._copy(self._place(at), self._at(source, odd), self._bytes(name))
            at += _rounded(self._bytes(name))

    def _observe(self, odd: str) -> None:
        """Observe the oldest slot of the past, and the own paddle of now."""
        at = self.ring
        for name, _ in self.delayed:
            self._copy(self._at(name, odd), self._place(at), self._bytes(name))
            at += _rounded(self._bytes(name))
        for own, of in (("own", "position"), ("own_velocity", "velocity")):
            if (name := f"observe.sensor.{own}") in self._arrays:
                source = self._at(f"state.{of}", odd)
                self._copy(self._at(name, odd), source, self._bytes(name))
        self._call("observe", odd)

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
            self._add(f"store i64 {value}, ptr {slot}")
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


def _rounded(size: int) -> int:
    return size + -size % 8

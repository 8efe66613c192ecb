"""Kernels of many worlds as LLVM text: a whole control step of one world in a thread.

The functions of a control step (`code_export`) read from a table where their arrays
are. Here, each table is filled with the addresses of the arrays of one world. Arrays
that all worlds share are read from one place.

A world has `HEADER` bytes, then its image (`sim.world.layout`), then the memory for
arrays that functions create. ``begin`` prepares the images of starts. ``step`` copies
the actions, calls the functions of a step, serves pucks, observes, copies the results,
and begins a new episode if one ended and ``restart`` is true.
"""

from __future__ import annotations

import math

from marl_airhockey.device.llvm_text import double
from marl_airhockey.device.world_text import HEADER, NUMBER, WorldText, rounded
from marl_airhockey.toolkit.serves import SPREAD


class KernelText(WorldText):
    """LLVM text of the kernels of a scenario; `WorldText` explains the arguments."""

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
            "i64 %world_number, i64 %worlds, i64 %rows, i1 %odd, i1 %restart, "
            "ptr %actions, ptr %observation, ptr %final, ptr %reward, ptr %ended, "
            "ptr %success) alwaysinline"
        )
        self._add(f"%far = mul i64 %world_number, {self.stride}")
        self._add("%header = getelementptr i8, ptr %memory, i64 %far")
        self._add(f"%world = getelementptr i8, ptr %header, i64 {HEADER}")
        self._add(f"%arena = getelementptr i8, ptr %world, i64 {self.size}")
        self._add("%odd_after = xor i1 %odd, true")
        given, size = self._at("inputs.action", "%odd"), 16 * seats
        self._copy(given, self._row("%actions", size), size)
        self._eliminate()
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
        self._branch("%restart", "again", "going")
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
            self._store("i8", flag, place)
            flags.append(flag)
        either = self._new(f"or i8 {flags[0]}, {flags[1]}")
        return self._new(f"icmp ne i8 {either}, 0")

    def _restart(self) -> None:
        """Begin the next episode of a world."""
        number = self._new(f"getelementptr i8, ptr %header, i64 {NUMBER}")
        # With an odd distance, every world gets all starts if their number is a power
        # of two. Otherwise it could get the same one again and again.
        odd = self._new("or i64 %worlds, 1")
        after = self._new(f"add i64 {self._load('i64', number)}, {odd}")
        self._store("i64", after, number)
        row = self._new(f"urem i64 {after}, %rows")
        start = self._new(f"mul i64 {row}, {self.size}")
        begun = self._new(f"getelementptr i8, ptr %starts, i64 {start}")
        self._copy("%world", begun, self.size)

    def _eliminate(self) -> None:
        """Move the paddles of eliminated seats away, and close their goals."""
        found = self._facts["elimination"]
        if not found:
            return
        self._call("show", "%odd")
        flags = []
        for seat, parking in enumerate(found["parking"]):
            flags.append(self._load("i8", self._at("eliminated", "%odd", "show", seat)))
            gone = self._new(f"icmp ne i8 {flags[-1]}, 0")
            self._store("i8", flags[-1], self._at("inputs.raised", "%odd", more=seat))
            for axis in range(2):
                place = self._at("inputs.action", "%odd", more=8 * (2 * seat + axis))
                wanted = self._load("double", place)
                self._choose(gone, double(0.0), wanted, place)
            for k, value in enumerate(parking):
                place = self._at("inputs.prescribed", "%odd", more=8 * (4 * seat + k))
                self._choose(gone, double(value), double(math.nan), place)
        for line, seat in enumerate(found["owner"]):
            closed = flags[seat] if seat >= 0 else "0"
            self._store("i8", closed, self._at("inputs.closed", "%odd", more=line))

    def _choose(self, condition: str, yes: str, no: str, place: str) -> None:
        """Store one of two doubles."""
        value = self._new(f"select i1 {condition}, double {yes}, double {no}")
        self._store("double", value, place)

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
                self._store("double", value, place)
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
            at += rounded(self._bytes(name))

    def _observe(self, odd: str) -> None:
        """Observe the oldest slot of the past, and the own paddle of now."""
        at = self.ring
        for name, _ in self.delayed:
            self._copy(self._at(name, odd), self._place(at), self._bytes(name))
            at += rounded(self._bytes(name))
        for own, of in (("own", "position"), ("own_velocity", "velocity")):
            if (name := f"observe.sensor.{own}") in self._arrays:
                source = self._at(f"state.{of}", odd)
                self._copy(self._at(name, odd), source, self._bytes(name))
        self._call("observe", odd)

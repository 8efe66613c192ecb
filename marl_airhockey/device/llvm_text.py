"""Writer of functions as LLVM text."""

from __future__ import annotations

import struct


class LlvmText:
    """Lines of functions. Results of operations have the names %v1, %v2 and so on."""

    def __init__(self) -> None:
        self._lines: list[str] = []
        self._count = self._entry = 0

    def _define(self, heading: str) -> None:
        """Begin a function."""
        self._lines.append(f"define {heading} {{")
        self._entry = len(self._lines)

    def _end(self, result: int) -> None:
        """End a function, which returns a number."""
        self._lines += [f"  ret i32 {result}", "}"]

    def _copy(self, to: str, source: str, size: int, row: bool = False) -> None:
        """Copy some bytes; ``row`` if one of the addresses is a multiple of them."""
        # A GPU can only read and write numbers at multiples of their size.
        align = min(size & -size, 8) if row else 8
        self._add(
            f"call void @llvm.memcpy.p0.p0.i64(ptr align {align} {to}, "
            f"ptr align {align} {source}, i64 {size}, i1 false)"
        )

    def _load(self, kind: str, place: str) -> str:
        return self._new(f"load {kind}, ptr {place}")

    def _store(self, kind: str, value: str, place: str) -> None:
        self._add(f"store {kind} {value}, ptr {place}")

    def _branch(self, condition: str, yes: str, no: str) -> None:
        self._add(f"br i1 {condition}, label %{yes}, label %{no}")
        self._lines.append(f"{yes}:")

    def _local(self, kind: str) -> str:
        """Return the address of a variable, which is created as the function begins."""
        self._count += 1
        line = f"  %v{self._count} = alloca {kind}, align 8"
        self._lines.insert(self._entry, line)
        return f"%v{self._count}"

    def _new(self, operation: str) -> str:
        self._count += 1
        self._add(f"%v{self._count} = {operation}")
        return f"%v{self._count}"

    def _add(self, line: str) -> None:
        self._lines.append(f"  {line}")


def double(value: float) -> str:
    """Return a number as LLVM writes it, exact to the bit."""
    return f"0x{struct.unpack('<Q', struct.pack('<d', value))[0]:016X}"

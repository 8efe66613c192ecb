"""Blocks of a recording's file: a line of JSON and, behind it, arrays."""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterator, Mapping
from typing import Any, BinaryIO

import numpy as np

from marl_airhockey.types import Array

LONGEST_LINE = 1 << 20
"""Longest line, bytes"""
LARGEST_BLOCK = 1 << 28
"""Largest arrays of a block, bytes"""
KINDS = "biuf"
"""Kinds of numbers that arrays may have: bool, integers, floats"""
Columns = dict[str, Array]


def packed(notes: Mapping[str, Any], arrays: Columns | None = None) -> bytes:
    """Return a block as bytes."""
    line, data = dict(notes), b""
    if arrays is not None:
        ordered = {name: _little(value) for name, value in arrays.items()}
        data = zlib.compress(b"".join(v.tobytes() for v in ordered.values()), 1)
        line["arrays"] = [[n, v.dtype.str, list(v.shape)] for n, v in ordered.items()]
        line |= {"size": len(data), "crc": zlib.crc32(data)}
        data += b"\n"
    text = json.dumps(line, separators=(",", ":"), allow_nan=False)
    return text.encode() + b"\n" + data


def _little(value: Array) -> Array:
    """Return an array in the order of bytes that files have."""
    array = np.asarray(value)
    return array.astype(array.dtype.newbyteorder("<"), order="C")


def blocks(file: BinaryIO) -> Iterator[tuple[dict[str, Any], Columns]]:
    """Yield the lines after the head with their arrays, until one is not whole.

    Raises:
        ValueError: a block that is whole and makes no sense.
    """
    while True:
        at = file.tell()
        text = file.readline(LONGEST_LINE)
        if not text.endswith(b"\n"):
            return
        try:
            line = json.loads(text)
        except ValueError as error:
            raise ValueError(f"no line of a recording at byte {at}") from error
        if not isinstance(line, dict) or not {"kind", "episode"} <= line.keys():
            raise ValueError(f"no line of a recording at byte {at}")
        arrays: Columns = {}
        if "arrays" in line:
            layout, size = line.pop("arrays"), int(line.pop("size"))
            if not 0 <= size <= LARGEST_BLOCK:
                raise ValueError(f"a block of {size} bytes at byte {at}")
            data = file.read(size + 1)
            if len(data) <= size:
                return
            if zlib.crc32(data[:-1]) != line.pop("crc"):
                raise ValueError(f"damaged at byte {at}: its checksum is another one")
            arrays = _unpack(layout, data[:-1], at)
        yield line, arrays


def _unpack(layout: list[Any], data: bytes, at: int) -> Columns:
    """Return the arrays of a block."""
    kinds = {name: (np.dtype(code), tuple(shape)) for name, code, shape in layout}
    sizes = []
    for name, (dtype, shape) in kinds.items():
        if dtype.kind not in KINDS or any(int(n) < 0 for n in shape):
            raise ValueError(f"{name} at byte {at}: {dtype} {shape} is no array")
        sizes.append(
            int(np.prod([int(n) for n in shape], dtype=object)) * dtype.itemsize
        )
    if sum(sizes) > LARGEST_BLOCK:
        raise ValueError(f"arrays of {sum(sizes)} bytes at byte {at}")
    inflater = zlib.decompressobj()
    try:
        plain = inflater.decompress(data, sum(sizes) + 1)
    except zlib.error as error:
        raise ValueError(f"damaged at byte {at}: {error}") from error
    if len(plain) != sum(sizes):
        raise ValueError(f"damaged at byte {at}: not as many numbers as it says")
    arrays: Columns = {}
    offset = 0
    for (name, (dtype, shape)), size in zip(kinds.items(), sizes, strict=True):
        flat = np.frombuffer(plain, dtype, size // dtype.itemsize, offset)
        arrays[name] = flat.reshape(shape).copy()
        offset += size
    return arrays

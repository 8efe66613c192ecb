"""Format 3: files of recordings before they were folders, read to convert them.

A file is a row of blocks: a line of JSON and, where it has ``arrays``, the arrays that
it lists, compressed by zlib. A block that is not whole is the end of the file.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from marl_airhockey.core.recording import KINDS, Columns
from marl_airhockey.data.writer import RecordingWriter, whole_recording

LONGEST_LINE = 1 << 20
"""Longest line, bytes"""
LARGEST_BLOCK = 1 << 28
"""Largest arrays of a block, bytes"""
SUFFIX, FORMAT = ".rec", 3
"""Ending of the names of files, and their version"""


def convert(path: Path, out: Path) -> Path:
    """Write a file of format 3 as a recording; return its folder.

    Args:
        path: File.
        out: Folder of recordings.

    Raises:
        ValueError: No such file, one that is damaged, or one that has been converted
            before; names it.
    """
    new = out / path.stem
    try:
        with path.open("rb") as file:
            head = json.loads(file.readline(LONGEST_LINE))
            if not isinstance(head, dict) or head.get("format") != FORMAT:
                raise ValueError("no recording of format 3")
            known = {k: v for k, v in head.items() if k not in ("kind", "format")}
            with whole_recording(new, known) as writer:
                for line, arrays in _blocks(file):
                    _write(writer, line, arrays)
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror}") from error
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path}: {error}") from error
    return new


def _write(writer: RecordingWriter, line: dict[str, Any], arrays: Columns) -> None:
    """Write what a block holds."""
    if line["kind"] == "begin":
        notes = line.get("seed"), line.get("number", 0), line.get("physics", {})
        writer.begin(arrays, *notes)
    elif line["kind"] == "steps":
        writer.add_rows(arrays)
    else:
        writer.end(str(line["reason"]))


def _blocks(file: BinaryIO) -> Iterator[tuple[dict[str, Any], Columns]]:
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

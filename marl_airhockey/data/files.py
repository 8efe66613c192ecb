"""Folders of recordings: those in a folder, and what those of one dataset share."""

from __future__ import annotations

import datetime
import re
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from marl_airhockey.data.reader import missing_steps, read_head
from marl_airhockey.sim.core.recording import META
from marl_airhockey.sim.jit.folders import cache_folder

NAME = re.compile(r"^\w[-.\w]*(/\w[-.\w]*)*$")
"""Form of the name of an exported dataset"""
PREFIX = "airhockey"
"""First part of the names of the named datasets"""
ALIKE = ("scenario", "options", "observe", "control_dt", "profile")
"""Keys of heads that recordings of one dataset must share"""


def dataset_folder(name: str) -> Path:
    """Return the folder of a named dataset, which may not have been built yet."""
    return cache_folder() / "datasets" / name


def shown_name(path: Path) -> str:
    """Return a path as it is shown: of a named dataset, its name and part."""
    root = dataset_folder("")
    return str(path.relative_to(root) if path.is_relative_to(root) else path)


def dataset_of(path: Path) -> str:
    """Return the name of the dataset that a recording is a part of; "" for none."""
    root = dataset_folder("")
    return str(path.parent.relative_to(root)) if path.is_relative_to(root) else ""


def is_recording(path: Path) -> bool:
    """Return whether a path is the folder of a recording."""
    return (path / META).is_file()


def recordings_in(paths: Sequence[Path]) -> list[Path]:
    """Return the recordings among some paths and in the folders among them.

    Args:
        paths: Recordings, folders, and names of datasets that have been built.

    Raises:
        ValueError: A path that is not there, or no recording at all.
    """
    found: list[Path] = []
    for path in paths:
        named = not path.exists() and path.parts[:1] == (PREFIX,)
        where = dataset_folder(str(path)) if named else path
        if not where.exists():
            hint = f"; airhockey data get {path}" if named else ""
            raise ValueError(f"{path}: there is no such file or folder{hint}")
        found += sorted(meta.parent for meta in where.rglob(META))
    if not found:
        raise ValueError(f"{paths[0]}: there are no recordings in it ({META})")
    places = [path.resolve() for path in found]
    for path, place in zip(found, places, strict=True):
        if places.count(place) > 1:
            raise ValueError(f"{path}: this recording is given twice")
    return found


def whole_recordings_in(paths: Sequence[Path]) -> list[Path]:
    """Return the recordings of `recordings_in`, of which no step is missing.

    Raises:
        ValueError: See there, or episodes of a recording lack steps, with the remedy.
    """
    found = recordings_in(paths)
    for path in found:
        if lacking := missing_steps(path):
            raise ValueError(
                f"{path}: {len(lacking)} of its episodes lack steps; airhockey data "
                f"repair {path} --out NEW keeps the good ones"
            )
    return found


def one_recording(path: Path) -> Path:
    """Return the only recording of a path, a folder or a named dataset.

    Raises:
        ValueError: There is none, or there are several.
    """
    found = recordings_in([path])
    if len(found) > 1:
        names = ", ".join(shown_name(each) for each in found[:4])
        raise ValueError(f"{path}: there are several recordings; name one: {names}")
    return found[0]


def new_recording(folder: Path, scenario: str) -> Path:
    """Return a path for a new recording in a folder, named by the time."""
    now = datetime.datetime.now(datetime.UTC).strftime("%Y%m%d-%H%M%S-%f")
    return folder / f"{now}-{scenario}"


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """Make a folder that is there when it is complete and, after any error, not.

    Yields the path at which it is to be written.

    Raises:
        ValueError: There is such a folder.
    """
    if path.exists():
        raise ValueError(f"{path}: there is such a folder; name another")
    with (
        parent_of(path) as parent,
        tempfile.TemporaryDirectory(dir=parent, prefix=".part-") as part,
    ):
        made = Path(part) / path.name
        made.mkdir()
        yield made
        shutil.move(str(made), path)


@contextmanager
def parent_of(path: Path) -> Iterator[Path]:
    """Make the folder of a path; remove a new one again if nothing is left in it.

    Raises:
        ValueError: It cannot be made.
    """
    parent, fresh = path.parent, not path.parent.exists()
    try:
        parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(f"{path}: cannot be made: {error.strerror}") from error
    try:
        yield parent
    finally:
        if fresh and not any(parent.iterdir()):
            parent.rmdir()


def named_folder(root: Path | None, name: str) -> Path:
    """Return the folder of a dataset below that of all; None for ``datasets``.

    Raises:
        ValueError: The name is no path below it.
    """
    if not NAME.match(name):
        raise ValueError(f"--name {name!r}: expected words and numbers, as juggle/mine")
    return (root or Path("datasets")) / name


def size_of(recording: Path) -> int:
    """Return the size of a recording, bytes."""
    return sum(file.stat().st_size for file in recording.rglob("*") if file.is_file())


def shared_head(recordings: Sequence[Path]) -> dict[str, Any]:
    """Return what the heads of recordings share.

    Raises:
        ValueError: Recordings that differ in what they must share, named.
    """
    heads = [read_head(path) for path in recordings]
    for path, head in zip(recordings, heads, strict=True):
        for name in ALIKE:
            if name not in head:
                raise ValueError(f"{path}: its head has no {name!r}")
            if head[name] != heads[0][name]:
                raise ValueError(
                    f"{path}: {name} is {head[name]!r}, that of {recordings[0]} is "
                    f"{heads[0][name]!r}; learn from one kind at a time"
                )
    return heads[0]

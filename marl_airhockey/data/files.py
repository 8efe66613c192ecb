"""Folders of recordings and datasets."""

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
"""Pattern of the name of an exported dataset."""
PREFIX = "airhockey"
"""First part of the names of the named datasets."""
ALIKE = ("scenario", "options", "observe", "control_dt", "profile")
"""Keys of the metadata that must be equal in all recordings of one dataset."""


def dataset_folder(name: str) -> Path:
    """Return the folder of a named dataset, which does not have to exist."""
    return cache_folder() / "datasets" / name


def shown_name(path: Path) -> str:
    """Return a path for display; for a named dataset its name and part."""
    root = dataset_folder("")
    return str(path.relative_to(root) if path.is_relative_to(root) else path)


def dataset_of(path: Path) -> str:
    """Return the name of the dataset that contains a recording; "" for none."""
    root = dataset_folder("")
    return str(path.parent.relative_to(root)) if path.is_relative_to(root) else ""


def is_recording(path: Path) -> bool:
    """Return True if a path is the folder of a recording."""
    return (path / META).is_file()


def recordings_in(paths: Sequence[Path]) -> list[Path]:
    """Return the folders of all recordings in some paths.

    Args:
        paths: Recordings, folders of recordings, and names of built datasets.

    Raises:
        ValueError: A path does not exist, there are no recordings, or a recording is
            given twice.
    """
    found: list[Path] = []
    for path in paths:
        named = not path.exists() and path.parts[:1] == (PREFIX,)
        where = dataset_folder(str(path)) if named else path
        if not where.exists():
            hint = f"; build it by airhockey data get {path}" if named else ""
            raise ValueError(f"{path}: there is no such file or folder{hint}")
        found += sorted(meta.parent for meta in where.rglob(META))
    if not found:
        raise ValueError(f"{paths[0]}: it contains no recording (no {META})")
    places = [path.resolve() for path in found]
    for path, place in zip(found, places, strict=True):
        if places.count(place) > 1:
            raise ValueError(f"{path}: this recording is given twice")
    return found


def whole_recordings_in(paths: Sequence[Path]) -> list[Path]:
    """Return the recordings in some paths, after checking that no step is missing.

    Raises:
        ValueError: See `recordings_in`, or steps are missing in a recording.
    """
    found = recordings_in(paths)
    for path in found:
        if lacking := missing_steps(path):
            raise ValueError(
                f"{path}: steps are missing in {len(lacking)} episodes; airhockey data "
                f"repair {path} --out NEW writes the intact episodes"
            )
    return found


def one_recording(path: Path) -> Path:
    """Return the only recording in a folder or a named dataset.

    Raises:
        ValueError: There is no recording, or there are several.
    """
    found = recordings_in([path])
    if len(found) > 1:
        names = ", ".join(shown_name(each) for each in found[:4])
        raise ValueError(f"{path}: it contains several recordings; give one: {names}")
    return found[0]


def new_recording(folder: Path, scenario: str) -> Path:
    """Return the path of a new recording in a folder, named by time and scenario."""
    now = datetime.datetime.now(datetime.UTC).strftime("%Y%m%d-%H%M%S-%f")
    return folder / f"{now}-{scenario}"


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """Yield a temporary folder that becomes a new folder if there is no error.

    Raises:
        ValueError: The folder exists.
    """
    if path.exists():
        raise ValueError(f"{path}: the folder exists; give another")
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
    """Create the parent folder of a path; remove it at the end if it is empty and new.

    Raises:
        ValueError: The folder cannot be created.
    """
    parent, fresh = path.parent, not path.parent.exists()
    try:
        parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(f"{path}: cannot be created: {error.strerror}") from error
    try:
        yield parent
    finally:
        if fresh and not any(parent.iterdir()):
            parent.rmdir()


def named_folder(root: Path | None, name: str) -> Path:
    """Return the folder of a dataset.

    Args:
        root: Folder of all datasets; None for ``datasets``.
        name: Name of the dataset.

    Raises:
        ValueError: The name is not a relative path of words.
    """
    if not NAME.match(name):
        raise ValueError(
            f"--name {name!r}: expected words and numbers, for example juggle/mine"
        )
    return (root or Path("datasets")) / name


def size_of(recording: Path) -> int:
    """Return the size of a recording, bytes."""
    return sum(file.stat().st_size for file in recording.rglob("*") if file.is_file())


def shared_head(recordings: Sequence[Path]) -> dict[str, Any]:
    """Return the metadata of the first recording, after comparing it with the others.

    Raises:
        ValueError: The recordings have different values of a key in `ALIKE`.
    """
    heads = [read_head(path) for path in recordings]
    for path, head in zip(recordings, heads, strict=True):
        for name in ALIKE:
            if name not in head:
                raise ValueError(f"{path}: meta.json has no key {name!r}")
            if head[name] != heads[0][name]:
                raise ValueError(
                    f"{path}: {name} is {head[name]!r}, but in {recordings[0]} it is "
                    f"{heads[0][name]!r}; use recordings with the same value"
                )
    return heads[0]

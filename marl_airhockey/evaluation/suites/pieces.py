"""Pieces of a suite: situations of a game with a task, in one file."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

import numpy as np

from marl_airhockey.discovery import version_of
from marl_airhockey.sim.core.errors import unknown_name
from marl_airhockey.types import Array

FOLDER = Path(__file__).parent
SHA256 = {
    "attack-v1": "0142c285316410ff8a746e290875b1ad8f2daadabd91a9c63721266693143c88",
    "blackout-v1": "4964084ae3edc58b074719bc8f24c0b1d4bf402d704a83842cf5c1a60aec89a7",
    "counter-v1": "9fcb9a7e344c5c479ade36b523a6b78cdacb8b5ab4b15ac9abdd12f41ad7a2d2",
    "defence-v1": "a14ffe9efa4c3259e808320ffbb93eee0902b2eecb800a3bc29bcfa494614f06",
    "played-v1": "edf583b17ebf5d764d48c1f69dd3fcae38f5c6b5072b58280304e5cbaa1e83b8",
}
"""Hash of the file of each published suite."""
CLASSES = 5
"""Number of classes of difficulty, from 1 for the easiest pieces."""
STEPS_OF_ACTIONS = 127
"""Number of steps of a stored action from 0 to 1."""


@dataclass(frozen=True)
class Task:
    """What all pieces of a suite have in common."""

    title: str
    """One sentence for people."""
    rule: str
    """Rule of success, a name in `set_piece.RULES`."""
    seconds: float
    """Longest time of a piece, s."""
    drivers: dict[str, str]
    """Drivers of the seats other than ``paddle_0``, by agent."""
    rules: int
    """Version of duel whose rules the pieces have."""
    solvable: float = 1.0
    """Share of the candidates that the search solved, among those in which a paddle at
    rest and a random one fail. Only solved candidates are pieces."""


@dataclass(frozen=True)
class Pieces:
    """N situations of duel, with two paddles and a puck, table frame."""

    task: Task
    position: Array
    """Positions of paddles and puck (N, 3, 2), m."""
    velocity: Array
    """Velocities (N, 3, 2), m/s."""
    hidden: Array
    """Start and end of the time in which no seat sees the puck (N, 2), s; equal if it
    is always visible."""
    difficulty: Array
    """Class of each piece (N,), 1 to `CLASSES`."""
    solution: Array
    """Actions of ``paddle_0`` that solve the piece (N, T, 2), in 127ths, int8."""

    def __len__(self) -> int:
        return len(self.position)

    def select(self, rows: Array) -> Pieces:
        """Return some pieces, by a mask or indices."""
        parts = {name: getattr(self, name)[rows] for name in ARRAYS}
        return Pieces(self.task, **parts)

    def save(self, path: Path) -> None:
        """Write a file whose bytes depend on the pieces alone."""
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
            for name, array in self._arrays().items():
                content = io.BytesIO()
                np.save(content, array, allow_pickle=False)
                # The time of writing would change the hash of the file.
                entry = zipfile.ZipInfo(f"{name}.npy", (1980, 1, 1, 0, 0, 0))
                entry.compress_type = zipfile.ZIP_DEFLATED
                file.writestr(entry, content.getvalue())

    def _arrays(self) -> dict[str, Array]:
        text = json.dumps(asdict(self.task), sort_keys=True)
        arrays = {
            name: np.asarray(getattr(self, name), t) for name, t in ARRAYS.items()
        }
        return {"task": np.frombuffer(text.encode(), np.uint8), **arrays}


ARRAYS = {
    "position": np.float32,
    "velocity": np.float32,
    "hidden": np.float32,
    "difficulty": np.int8,
    "solution": np.int8,
}
"""Types of the arrays in a file, by name."""


def suite_names() -> list[str]:
    """Return the names of the published suites."""
    return sorted(SHA256)


@cache
def load_pieces(name: str) -> Pieces:
    """Return the pieces of a published suite, or of a file.

    Args:
        name: Name of a suite, or path of a file ``*.npz``.

    Raises:
        ValueError: The name is unknown, or the file is not a suite, or not the
            published one.
    """
    own = not name.endswith(".npz")
    if own and name not in SHA256:
        raise ValueError(
            unknown_name("suite", name, suite_names()) + "; or the path of a file *.npz"
        )
    path = FOLDER / f"{name}.npz" if own else Path(name)
    if not path.is_file():
        raise ValueError(f"{path}: there is no such file")
    content = path.read_bytes()
    if own and hashlib.sha256(content).hexdigest() != SHA256[name]:
        raise ValueError(
            f"{path}: the pieces are not the published ones; install marl_airhockey "
            "again"
        )
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as file:
            task = Task(**json.loads(file["task"].tobytes()))
            arrays = {k: np.asarray(file[k], np.float64) for k in ARRAYS}
    except (ValueError, KeyError, TypeError, OSError, zipfile.BadZipFile) as error:
        raise ValueError(f"{path}: not a suite of set pieces ({error})") from error
    if task.rules != version_of("duel"):
        raise ValueError(
            f"{path}: made for version {task.rules} of duel; this is version "
            f"{version_of('duel')}, whose rules differ"
        )
    found = Pieces(task, **arrays)
    n = len(found)
    for array in ("position", "velocity"):
        if getattr(found, array).shape != (n, 3, 2) or not n:
            raise ValueError(
                f"{path}: {array} has the shape {getattr(found, array).shape}; "
                "expected (N, 3, 2)"
            )
    return found

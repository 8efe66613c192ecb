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
from marl_airhockey.registry import independent_driver_names, zoo_names
from marl_airhockey.sim.core.errors import unknown_name
from marl_airhockey.types import Array

FOLDER = Path(__file__).parent
SHA256 = {
    "attack-v1": "7f28cfd271e9cab32f34e818307945520e44a64582030cad9636b706692f7c4d",
    "blackout-v1": "73478fb95129189b775361e04dc7eecefc4571e3d20771c5a6e61dc4daa9342f",
    "counter-v1": "5ffea5efdce8b349e76bea4c80571f2543c8a4b3b73900c5a164922dbd78d49f",
    "defence-v1": "b938b1a65a3a7ed96ce2c9dfcd01e810888ab28b62c9a46f764b75980a777e08",
    "pass-v1": "83921eedaed27bc3b7863aca96d680b5b4946ee477cef2900adfd00ee73f3097",
    "played-v1": "dbd0d978da3b3e62b81254f657c2ba27d09c654256998fcb7b79a1e0562635dd",
    "rally-v1": "94aa2afddc6d15827e65d04e4143620bee140379005a509fa10710dbfac87786",
}
"""Hash of the file of each published suite."""
SEATS = {"duel": 2, "doubles": 4}
"""Numbers of seats by game."""
CLASSES = 5
"""Number of classes of difficulty, from 1 for the easiest pieces."""
STEPS_OF_ACTIONS = 127
"""Number of steps of a stored action from 0 to 1."""


@dataclass(frozen=True)
class Task:
    """Task that all pieces of a suite share."""

    title: str
    """One sentence for people."""
    rule: str
    """Rule of success, a name in `set_piece.RULES`."""
    seconds: float
    """Longest time of a piece, s."""
    drivers: dict[str, str]
    """Drivers of the seats other than ``paddle_0``, by agent."""
    game: str
    """Game whose rules and observation the pieces have, a name in `SEATS`."""
    version: int
    """Version of the game."""
    solvable: float = 1.0
    """Share of the candidates that the search solved, among those in which a paddle at
    rest and a random one fail. Only solved candidates are pieces."""


@dataclass(frozen=True)
class Pieces:
    """N situations of duel or doubles, with S paddles and a puck, table frame."""

    task: Task
    position: Array
    """Positions of paddles and puck (N, S + 1, 2), m."""
    velocity: Array
    """Velocities (N, S + 1, 2), m/s."""
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


def load_pieces(name: str) -> Pieces:
    """Return the pieces of a published suite, or of a file.

    Args:
        name: Name of a suite, or path of a file ``*.npz``.

    Raises:
        ValueError: The name is unknown, or the file is not a suite, or not the
            published one.
    """
    if name.endswith(".npz"):
        path = Path(name)
        if not path.is_file():
            raise ValueError(f"{path}: there is no such file")
        return _read(path, path.read_bytes())
    if name not in SHA256:
        raise ValueError(
            unknown_name("suite", name, suite_names()) + "; or the path of a file *.npz"
        )
    return _published(name)


@cache
def _published(name: str) -> Pieces:
    path = FOLDER / f"{name}.npz"
    content = path.read_bytes() if path.is_file() else b""
    if hashlib.sha256(content).hexdigest() != SHA256[name]:
        raise ValueError(
            f"{path}: the pieces are not the published ones; install marl_airhockey "
            "again"
        )
    return _read(path, content)


def _read(path: Path, content: bytes) -> Pieces:
    """Return the pieces in a file, which is checked."""
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as file:
            task = Task(**json.loads(file["task"].tobytes()))
            arrays = {k: np.asarray(file[k], np.float64) for k in ARRAYS}
    except (
        *(ValueError, KeyError, TypeError, OSError, EOFError, AttributeError),
        zipfile.BadZipFile,
    ) as error:
        raise ValueError(f"{path}: not a suite of set pieces ({error})") from error
    if task.game not in SEATS:
        raise ValueError(f"{path}: {unknown_name('game', task.game, list(SEATS))}")
    if task.version != version_of(task.game):
        raise ValueError(
            f"{path}: made for version {task.version} of {task.game}; this is version "
            f"{version_of(task.game)}, whose rules differ"
        )
    known = [*independent_driver_names(), *zoo_names()]
    for driver in dict(task.drivers).values():
        # Other names could be code, and a file must not run any.
        if driver not in known:
            raise ValueError(f"{path}: {unknown_name('driver', str(driver), known)}")
    found = Pieces(task, **arrays)
    _check(path, found)
    return found


def _check(path: Path, found: Pieces) -> None:
    """Raise ValueError if an array of a file has another shape, or a bad number."""
    n, bodies = len(found.difficulty), SEATS[found.task.game] + 1
    shapes = {
        **dict.fromkeys(("position", "velocity"), (n, bodies, 2)),
        "hidden": (n, 2),
        "difficulty": (n,),
        "solution": (n, found.solution.shape[1] if found.solution.ndim > 1 else 0, 2),
    }
    for name, shape in shapes.items():
        array = getattr(found, name)
        if array.shape != shape or not n:
            raise ValueError(
                f"{path}: {name} has the shape {array.shape}; expected {shape} for "
                f"{n} pieces"
            )
        if not np.isfinite(array).all():
            raise ValueError(f"{path}: {name} contains numbers that are not finite")
    if not set(found.difficulty) <= set(range(1, CLASSES + 1)):
        raise ValueError(f"{path}: a difficulty is not a whole number from 1 to 5")
    if found.hidden.min() < 0.0 or (found.hidden[:, 1] < found.hidden[:, 0]).any():
        raise ValueError(
            f"{path}: a time in hidden is below 0, or ends before it begins"
        )

"""What a study keeps of its participants: a folder each, and how it is erased.

A folder ``participant-007`` holds ``diary.jsonl`` (a head, then consent, games and
answers, a line each) and the recordings of that participant's games. Whoever plays as
an opponent has a folder ``partner-000`` with the consent alone.
"""

from __future__ import annotations

import datetime
import json
import os
import secrets
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from marl_airhockey.play.recorder import head
from marl_airhockey.study.plan import Plan

FORMAT = 1
DIARY = "diary.jsonl"
LETTERS = "abcdefghjkmnpqrstuvwxyz23456789"
"""Of codes; none that is mistaken for another."""


class Diary:
    """What is noted of one person; every line is on the disk when it is written.

    Args:
        folder: of the study.
        role: "participant" or "partner".
        plan: of the study; a participant's order is that of the lowest free number, so
            that whoever withdraws leaves no gap in the counterbalancing.
    """

    def __init__(self, folder: Path, role: str, plan: Plan) -> None:
        self.code = "".join(secrets.choice(LETTERS) for _ in range(8))
        """By which the person is known, drawn at random."""
        self.number, self.folder = _claim(folder, role)
        self.order = plan.sequence(self.number)
        self.write(
            "diary",
            format=FORMAT,
            role=role,
            code=self.code,
            number=self.number,
            plan=plan.digest,
        )
        self.write("consent", version=plan.version)

    def write(self, kind: str, **row: Any) -> None:
        """Add a line, with the time."""
        now = datetime.datetime.now(datetime.UTC).isoformat()
        line = json.dumps({"kind": kind, "at": now, **row}, separators=(",", ":"))
        with (self.folder / DIARY).open("a") as file:
            file.write(line + "\n")
            file.flush()
            os.fsync(file.fileno())


def _claim(folder: Path, role: str) -> tuple[int, Path]:
    """The lowest free number, and its folder; servers of one study may race for it."""
    folder.mkdir(parents=True, exist_ok=True)
    number = 0
    while True:
        own = folder / f"{role}-{number:03d}"
        try:
            own.mkdir()
        except FileExistsError:
            number += 1
            continue
        return number, own


def diaries(folder: Path) -> Iterator[tuple[Path, list[dict[str, Any]]]]:
    """The diaries of a study: their files and lines.

    Raises:
        ValueError: one of another format.
    """
    for path in sorted(folder.glob(f"*/{DIARY}")):
        rows = []
        for line in path.read_text().splitlines():
            try:
                rows.append(json.loads(line))
            except json.JSONDecodeError:
                break  # The last line of a machine that went down.
        if rows and rows[0]["format"] != FORMAT:
            raise ValueError(f"{path}: format {rows[0]['format']}, expected {FORMAT}")
        if rows:
            yield path, rows


def erase(folder: Path, who: str) -> int:
    """Delete all that is kept of a person; how many files it was.

    The games that the person played as somebody's opponent go, too. A line without a
    code stays in ``erased.jsonl``: when it was, and of which number.

    Raises:
        ValueError: nothing of this person is there.
    """
    gone = 0
    number = None
    for path, rows in list(diaries(folder)):
        if rows[0]["code"] == who:
            number = rows[0]["number"]
            gone += sum(p.is_file() for p in path.parent.rglob("*"))
            shutil.rmtree(path.parent)
    for path in list(folder.rglob("*.jsonl")):
        if who in [player["person"] for player in head(path).get("players", [])]:
            path.unlink()
            gone += 1
    if not gone:
        raise ValueError(f"{folder}: there is nothing of {who!r}")
    with (folder / "erased.jsonl").open("a") as log:
        now = datetime.datetime.now(datetime.UTC).isoformat()
        log.write(json.dumps({"at": now, "number": number, "files": gone}) + "\n")
    return gone

"""Archive of a study: a folder for each person, and how it is erased.

A folder ``participant-007`` holds ``diary.jsonl`` (a head, then consent, games and
answers, a line each) and the recordings of that participant's games. A person who plays
as an opponent has a folder ``partner-000`` with the consent alone.
"""

from __future__ import annotations

import contextlib
import datetime
import hashlib
import json
import os
import secrets
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from marl_airhockey.data.reader import read_head
from marl_airhockey.play.study.plan import Plan
from marl_airhockey.sim.core.recording import META

FORMAT = 1
"""Version of the format of diaries."""
DIARY = "diary.jsonl"
TABLES = ("games.csv", "answers.csv", "measures.csv", "answers.md", "answers.png")
"""Files that `airhockey data report` writes of a study."""
REPORTS = (*TABLES, "report.json", "report.md", "report.png")
"""All files that `airhockey data report` writes."""
LETTERS = "abcdefghjkmnpqrstuvwxyz23456789"
"""Characters of codes; none that is mistaken for another."""


class Diary:
    """Notes on one person; every line is on the disk when `write` returns.

    What a full disk does not take is kept, and written as soon as it does.

    Args:
        folder: of the person.
        rows: its lines so far, the head first.
    """

    def __init__(self, folder: Path, rows: list[dict[str, Any]]) -> None:
        self.folder, self.rows = folder, rows
        self._unwritten: list[str] = []
        self.failure = ""
        """Reason why the last lines are not on the disk; "" if they are."""

    @classmethod
    def begin(cls, study: Path, role: str, plan: Plan, page: str) -> Diary:
        """Begin a diary with the consent that has just been given.

        Args:
            study: its folder.
            role: "participant" or "partner".
            plan: of the study; a participant's order is that of the lowest free number,
                so that an erased person leaves no gap in the counterbalancing.
            page: key of the person's page, of which a digest is kept.
        """
        number, folder = _new_folder(study, role)
        diary = cls(folder, [])
        diary.write(
            "diary",
            format=FORMAT,
            role=role,
            code="".join(secrets.choice(LETTERS) for _ in range(8)),
            number=number,
            plan=plan.digest,
            page=page_digest(page),
        )
        diary.write("consent", version=plan.version)
        return diary

    @property
    def code(self) -> str:
        """Random code by which the person is known."""
        return str(self.rows[0]["code"])

    @property
    def number(self) -> int:
        """Number of the participant, from 0."""
        return int(self.rows[0]["number"])

    @property
    def ended(self) -> bool:
        """True if the person has come to the end, or has left."""
        return any(row["kind"] == "end" for row in self.rows)

    @property
    def exists(self) -> bool:
        """True if it is still on the disk: somebody may have erased it."""
        return (self.folder / DIARY).exists()

    def write(self, kind: str, **row: Any) -> None:
        """Add a line, with the time as ``at``."""
        now = datetime.datetime.now(datetime.UTC).isoformat()
        self.rows.append({"kind": kind, "at": now, **row})
        self._unwritten.append(json.dumps(self.rows[-1], separators=(",", ":")) + "\n")
        self.flush()

    def flush(self) -> None:
        """Write the lines that are not yet on the disk."""
        if not self._unwritten:
            return
        path = self.folder / DIARY
        size = path.stat().st_size if path.exists() else 0
        try:
            with path.open("a") as file:
                file.writelines(self._unwritten)
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            self.failure = error.strerror or str(error)
            with contextlib.suppress(OSError):
                os.truncate(path, size)  # Half a line would spoil those after it.
            return
        self._unwritten, self.failure = [], ""


def page_digest(page: str) -> str:
    """Return the digest of a page's key, by which the page is recognised."""
    return hashlib.sha256(page.encode()).hexdigest()[:16]


def claim_folder(folder: Path, plan: Path) -> None:
    """Reserve a folder for a plan, of which a copy is kept there.

    Raises:
        ValueError: a folder of another plan, or one that cannot be written.
    """
    copy = folder / "plan.toml"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not copy.exists():
            copy.write_bytes(plan.read_bytes())
        same = copy.read_bytes() == plan.read_bytes()
    except OSError as error:
        raise ValueError(f"--out {folder}: {error.strerror}") from error
    if not same:
        raise ValueError(
            f"--out {folder}: was made with another plan ({copy}); say another folder"
        )


def _new_folder(folder: Path, role: str) -> tuple[int, Path]:
    """Make a folder of the lowest free number; return both.

    Several servers of one study may do so at the same time.
    """
    number = 0
    while True:
        own = folder / f"{role}-{number:03d}"
        try:
            own.mkdir(parents=True)
        except FileExistsError:
            number += 1
            continue
        return number, own


def diaries(folder: Path) -> Iterator[Diary]:
    """Yield the diaries of a study.

    Raises:
        ValueError: a diary of another format.
    """
    for path in sorted(folder.glob(f"*/{DIARY}")):
        rows = []
        for line in path.read_text().splitlines():
            try:
                rows.append(json.loads(line))
            except json.JSONDecodeError:
                break  # The last line before the machine went down.
        if rows and rows[0]["format"] != FORMAT:
            raise ValueError(f"{path}: format {rows[0]['format']}, expected {FORMAT}")
        if rows:
            yield Diary(path.parent, rows)


def erase(folder: Path, code: str) -> int:
    """Delete all that is kept of a person; return the number of files.

    The games that the person played as somebody's opponent go, too, and reports that
    were made in the folder. A line without a code stays in ``erased.jsonl``: when it
    was, and of which number.

    Raises:
        ValueError: a code of which there is nothing.
    """
    gone = 0
    number = None
    for diary in list(diaries(folder)):
        if diary.code == code:
            number = diary.number
            gone += sum(p.is_file() for p in diary.folder.rglob("*"))
            shutil.rmtree(diary.folder)
    for path in [meta.parent for meta in folder.rglob(META)]:
        if code in [player["person"] for player in read_head(path).get("players", [])]:
            gone += sum(p.is_file() for p in path.rglob("*"))
            shutil.rmtree(path)
    if not gone:
        raise ValueError(f"{folder}: there is nothing of {code!r}")
    for name in REPORTS:
        (folder / name).unlink(missing_ok=True)
    with (folder / "erased.jsonl").open("a") as log:
        now = datetime.datetime.now(datetime.UTC).isoformat()
        log.write(json.dumps({"at": now, "number": number, "files": gone}) + "\n")
    return gone

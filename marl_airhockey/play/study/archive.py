"""Archive of a study, with a folder for each person that can be erased.

A folder ``participant-007`` contains the event log ``diary.jsonl`` and the recordings
of the participant's games. The log has one line for the metadata, the consent, each
game and each answer. A person in the role of an opponent has a folder ``partner-000``
with the consent only.
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
"""Version of the format of event logs."""
DIARY = "diary.jsonl"
TABLES = ("games.csv", "answers.csv", "measures.csv", "answers.md", "answers.png")
"""Files that `airhockey data report` writes for a study."""
REPORTS = (*TABLES, "report.json", "report.md", "report.png")
"""All files that `airhockey data report` writes."""
LETTERS = "abcdefghjkmnpqrstuvwxyz23456789"
"""Characters of codes, without characters that look alike."""


class Diary:
    """Event log of one person; every line is on the disk when `write` returns.

    Lines that cannot be written because the disk is full are written later.

    Args:
        folder: Folder of the person.
        rows: Existing lines, starting with the metadata.
    """

    def __init__(self, folder: Path, rows: list[dict[str, Any]]) -> None:
        self.folder, self.rows = folder, rows
        self._unwritten: list[str] = []
        self.failure = ""
        """Reason why the last lines are not on the disk; "" if they are."""

    @classmethod
    def begin(cls, study: Path, role: str, plan: Plan, page: str) -> Diary:
        """Start an event log with the consent of a person.

        A participant gets the lowest free number, which determines the order. An erased
        person therefore leaves no gap in the counterbalancing.

        Args:
            study: Folder of the study.
            role: "participant" or "partner".
            plan: Plan of the study.
            page: Key of the person's page, of which a digest is stored.
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
        """Random code that identifies the person."""
        return str(self.rows[0]["code"])

    @property
    def number(self) -> int:
        """Number of the participant, from 0."""
        return int(self.rows[0]["number"])

    @property
    def ended(self) -> bool:
        """True if the person has completed the plan or left."""
        return any(row["kind"] == "end" for row in self.rows)

    @property
    def exists(self) -> bool:
        """True if the event log is on the disk; False after it was erased."""
        return (self.folder / DIARY).exists()

    def write(self, kind: str, **row: Any) -> None:
        """Add a line with the current time as ``at``."""
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
                os.truncate(path, size)  # A partial line would damage later lines.
            return
        self._unwritten, self.failure = [], ""


def page_digest(page: str) -> str:
    """Return the digest of a page's key, which identifies the page."""
    return hashlib.sha256(page.encode()).hexdigest()[:16]


def claim_folder(folder: Path, plan: Path) -> None:
    """Reserve a folder for a plan and copy the plan to it.

    Raises:
        ValueError: The folder belongs to another plan, or cannot be written.
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
            f"--out {folder}: it belongs to another plan ({copy}); give another folder"
        )


def _new_folder(folder: Path, role: str) -> tuple[int, Path]:
    """Create a folder with the lowest free number; return both.

    Several servers of one study can do this at the same time.
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
    """Yield the event logs of a study.

    Raises:
        ValueError: An event log has another format.
    """
    for path in sorted(folder.glob(f"*/{DIARY}")):
        rows = []
        for line in path.read_text().splitlines():
            try:
                rows.append(json.loads(line))
            except json.JSONDecodeError:
                break  # This is the last line before a crash.
        if rows and rows[0]["format"] != FORMAT:
            raise ValueError(f"{path}: format {rows[0]['format']}, expected {FORMAT}")
        if rows:
            yield Diary(path.parent, rows)


def erase(folder: Path, code: str) -> int:
    """Delete all data of a person; return the number of files.

    This includes games as the opponent of another participant, and reports in the
    folder. A line with time and number, but without the code, is added to
    ``erased.jsonl``.

    Raises:
        ValueError: There are no data of this code.
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
        raise ValueError(f"{folder}: it contains no data of {code!r}")
    for name in REPORTS:
        (folder / name).unlink(missing_ok=True)
    with (folder / "erased.jsonl").open("a") as log:
        now = datetime.datetime.now(datetime.UTC).isoformat()
        log.write(json.dumps({"at": now, "number": number, "files": gone}) + "\n")
    return gone

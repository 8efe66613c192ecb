"""Trial table: plan of the trials of a comparison, and a row for each played one."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.evaluation.comparison import Comparison, Outcomes, compare

PLAN, ROWS = "plan.json", "trials.csv"
"""Names of the files of the plan and of the rows."""


@dataclass(frozen=True)
class TrialPlan:
    """Plan of a comparison."""

    scenario: str
    where: dict[str, Any]
    """Backend, profile, options and the person who puts the puck on the table."""
    methods: dict[str, list[str]]
    """Policies by the name of their method, for example one policy for each seed."""
    codes: dict[str, str]
    """Letter of each method, which replaces its name in the rows."""
    starts: list[int]
    """Seed of the episode that begins at each start."""
    trials: list[list[Any]]
    """Index of the start, name of the method and index of its policy, in order of
    play."""


@dataclass(frozen=True)
class TrialRow:
    """Row of a trial that was played."""

    trial: int
    start: int
    code: str
    policy: int
    """Index of the policy among the policies of its method."""
    success: int
    returns: float
    seconds: float
    """Length of the episode, s."""
    touches: float
    began: str
    ended: str
    """Times of beginning and end, ISO 8601, UTC."""
    reason: str
    """Reason why a real table ended the trial early, which is not a success; "" for
    none."""

    @classmethod
    def read(cls, row: Mapping[str, str]) -> TrialRow:
        """Return a row of the file.

        Raises:
            ValueError: A field is missing or has the wrong type.
        """
        kinds = {"int": int, "float": float, "str": str}
        try:
            return cls(**{f.name: kinds[str(f.type)](row[f.name]) for f in fields(cls)})
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"{ROWS}: row {dict(row)}: {error}") from error


def plan_trials(
    scenario: str,
    methods: Mapping[str, Sequence[str]],
    starts: Sequence[int],
    trials: int,
    where: Mapping[str, Any],
    seed: int = 0,
) -> TrialPlan:
    """Return a plan in which every method plays from every start.

    Trial k of a method begins at start k modulo the number of starts. The policies of a
    method take turns. Within each k the order of the methods is sampled.

    Args:
        scenario: Name of the scenario.
        methods: Policies by the name of their method.
        starts: Seeds of the starts.
        trials: Number of trials of each method.
        where: Description of the table and its rules, see `TrialPlan`.
        seed: Seed of the order and of the letters.
    """
    rng = np.random.default_rng(seed)
    names = list(methods)
    letters = rng.permutation(len(names))
    order = [
        [k % len(starts), names[i], k % len(methods[names[i]])]
        for k in range(trials)
        for i in rng.permutation(len(names))
    ]
    codes = {name: _letter(int(i)) for name, i in zip(names, letters, strict=True)}
    kept = {name: list(paths) for name, paths in methods.items()}
    return TrialPlan(scenario, dict(where), kept, codes, list(starts), order)


def _letter(index: int) -> str:
    """Return the letter of an index: A, B, ..., Z, A1, ..."""
    return chr(ord("A") + index % 26) + (str(index // 26) if index >= 26 else "")


class TrialSheet:
    """Trial table in a folder: plan of a comparison, and a row for each played trial.

    An interrupted comparison is continued after its last row.

    Args:
        folder: Folder of the files, which is created if it does not exist.
        plan: Plan of the trials.

    Raises:
        ValueError: The folder contains trials of another plan, or broken rows.
    """

    def __init__(self, folder: Path, plan: TrialPlan) -> None:
        self.folder, self.plan = folder, plan
        folder.mkdir(parents=True, exist_ok=True)
        path, text = folder / PLAN, json.dumps(asdict(plan), indent=1)
        if path.exists() and path.read_text() != text:
            raise ValueError(
                f"{folder} contains trials of another plan: choose another --out"
            )
        path.write_text(text)
        self.rows = self._read()

    def _read(self) -> list[TrialRow]:
        path = self.folder / ROWS
        if not path.exists():
            path.write_text(",".join(f.name for f in fields(TrialRow)) + "\n")
        text = path.read_text()
        if not text.endswith("\n"):
            # The last row is incomplete after an interruption.
            text = text[: text.rfind("\n") + 1]
            path.write_text(text)
        return [TrialRow.read(row) for row in csv.DictReader(text.splitlines())]

    def add(self, row: TrialRow) -> None:
        """Append a row to the file and to `rows`."""
        with (self.folder / ROWS).open("a", newline="") as file:
            csv.writer(file, lineterminator="\n").writerow(asdict(row).values())
        self.rows.append(row)

    def compare(self) -> Comparison:
        """Return the comparison of the methods by the rows so far.

        Raises:
            ValueError: A method has no trial yet.
        """
        found = {}
        for name, code in self.plan.codes.items():
            rows = [row for row in self.rows if row.code == code]
            if not rows:
                raise ValueError(f"{self.folder}: {name!r} has no trials yet")
            found[name] = Outcomes(
                np.array([row.policy for row in rows]),
                np.array([row.success for row in rows], float),
                np.array([row.returns for row in rows]),
                np.array([bool(row.reason) for row in rows]),
            )
        return compare(found)

    @property
    def trials_an_hour(self) -> float:
        """Number of trials per hour, from the first beginning to the last end."""
        began = min(datetime.fromisoformat(row.began) for row in self.rows)
        ended = max(datetime.fromisoformat(row.ended) for row in self.rows)
        return 3600 * len(self.rows) / max((ended - began).total_seconds(), 1e-3)

"""Scripts of `scripts/reproduce` say what is there and compute what is missing."""

import csv
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "scripts/reproduce"
KEEP_ROWS = sorted(
    path.name for path in FOLDER.glob("*.py") if "rows: RowsFile" in path.read_text()
)
FOREIGN = {"marl.py": "benchmarl has an environment of its own"}


def run(name, *words, cwd):
    done = subprocess.run(
        [sys.executable, str(FOLDER / name), *words],
        cwd=cwd,
        capture_output=True,
        text=True,
    )
    assert not done.returncode, done.stderr
    return done.stdout


def test_all_that_keep_rows_are_known():
    assert len(KEEP_ROWS) >= 7
    for path in FOLDER.glob("*.py"):
        text = path.read_text()
        assert ("Book(" in text) == (path.name in [*KEEP_ROWS, "rows.py"]), path


@pytest.mark.parametrize("name", [n for n in KEEP_ROWS if n not in FOREIGN])
def test_committed_rows_are_named_and_not_computed(name, tmp_path):
    few = {"tasks.py": ["--tasks", "reach", "--seeds", "3"]}
    few["hindsight.py"] = ["--tasks", "reach"]
    few["table.py"] = ["--tasks", "touch,reach,strike", "--algos", "bc", "--seeds", "1"]
    shown = run(name, *few.get(name, []), cwd=tmp_path)
    head, *rest = shown.splitlines()
    there, wanted = head.split(": ")[1].split(" rows")[0].split(" of ")
    assert there == wanted != "0"
    assert rest == [
        "nothing to compute; --again computes the rows again, --rows FILE writes them "
        "to another file"
    ]


def test_rows_are_computed_again_into_another_file(tmp_path):
    words = ["--tasks", "touch,reach", "--algos", "random", "--seeds", "1"]
    words += ["--rows", "mine.csv", "--jobs", "1"]
    shown = run("table.py", *words, cwd=tmp_path)
    assert "mine.csv: 0 of 2 rows are there" in shown
    assert "to compute: 2d expert touch random 0" in shown
    assert "2 of 2, " in shown
    with (tmp_path / "mine.csv").open() as file:
        first = list(csv.DictReader(file))
    assert [row["task"] for row in first] == ["reach", "touch"]
    again = run("table.py", *words, "--again", "--tasks", "touch", cwd=tmp_path)
    assert "1 of 1 rows are there" in again
    assert "1 of 1, " in again
    with (tmp_path / "mine.csv").open() as file:
        assert list(csv.DictReader(file)) == first

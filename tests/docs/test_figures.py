"""Figures in README and docs are those of the files in docs/data."""

import csv
import json
from pathlib import Path
from statistics import mean

import pytest

ROOT = Path(__file__).parents[2]
DATA = ROOT / "docs/data"
COLUMNS = {
    "success": ("success", mean),
    "worst seed": ("success", min),
    "first shot": ("first_shot", mean),
    "sampled": ("sampled", mean),
    "on pymunk": ("pymunk", mean),
    "with the arm": ("arm", mean),
    "delayed": ("delayed", mean),
}
"""Columns of the tables of tasks: a column of tasks.csv, and what is made of it."""


def rows_of(name):
    with (DATA / name).open() as file:
        return list(csv.DictReader(file))


def tables(page):
    """The tables of a page: header and rows of cells."""
    found, last = [], False
    for line in (ROOT / page).read_text().splitlines():
        cells = [cell.strip() for cell in line.strip()[1:-1].split("|")]
        is_row = line.startswith("|")
        if is_row and not last:
            found.append((cells, []))
        elif is_row and not set(line) <= set("| -"):
            found[-1][1].append(cells)
        last = is_row
    return found


def table(page, *titles, number=0):
    """The n-th table of a page whose header has these titles, as dicts."""
    fitting = [(h, r) for h, r in tables(page) if set(titles) <= set(h)]
    header, rows = fitting[number]
    return [dict(zip(header, row, strict=True)) for row in rows]


def seeds(task, profile, column):
    found = [
        float(row[column])
        for row in rows_of("tasks.csv")
        if (row["task"], row["profile"], row["variant"]) == (task, profile, "")
    ]
    assert len(found) == 5
    return found


@pytest.mark.parametrize(
    ("page", "profile", "number"),
    [
        ("README.md", "ideal", 0),
        ("docs/tasks.md", "ideal", 0),
        ("docs/tasks.md", "ur5e", 1),
    ],
)
def test_tables_of_tasks_are_the_means_of_their_rows(page, profile, number):
    shown = table(page, "task", "success", "worst seed", number=number)
    assert len(shown) == 10
    for row in shown:
        for title in set(row) & set(COLUMNS):
            column, summary = COLUMNS[title]
            expected = summary(seeds(row["task"], profile, column))
            assert float(row[title]) == pytest.approx(expected, abs=6e-4), (row, title)


def test_table_of_the_arm_is_the_same():
    shown = table("docs/arm.md", "2D, ideal", "arm, ur5e")
    assert len(shown) == 10
    for row in shown:
        for title in ("2D, ideal", "arm, ideal", "2D, ur5e", "arm, ur5e"):
            where, profile = title.split(", ")
            column = {"2D": "success", "arm": "arm"}[where]
            expected = mean(seeds(row["task"], profile, column))
            assert float(row[title]) == pytest.approx(expected, abs=6e-4), (row, title)


def test_table_of_offline_learning_has_its_rows():
    known = {(r["task"], r["algo"], r["seed"]): r for r in rows_of("offline.csv")}
    for row in table("docs/training.md", "BC", "IQL"):
        for algo in ("BC", "IQL"):
            mine = known[row[""], algo.lower(), "0"]
            assert float(row[algo]) == pytest.approx(float(mine["success"]), abs=6e-4)


@pytest.mark.parametrize("game", ["duel", "doubles", "free_for_all"])
def test_ladders_have_the_ratings_of_their_files(game):
    header, rows = next(t for t in tables("docs/games.md") if t[0][0] == "level")
    column = header.index(f"{game}: steps") + 1
    ladder = rows_of(f"{game}_ladder.csv")
    assert len(ladder) == len(rows)
    for cells, known in zip(rows, ladder, strict=True):
        assert float(cells[column]) == pytest.approx(float(known["elo"]), abs=0.6)


def test_blind_controllers_are_those_of_their_rows():
    rows = {(row["task"], row["profile"]): row for row in rows_of("blind.csv")}
    shown = table("docs/tasks.md", "blind, ideal")
    assert len(shown) == 5
    for row in shown:
        for profile in ("ideal", "ur5e"):
            found = rows[row["task"], profile]
            expected = f"{found['success']} ({found['low']} .. {found['high']})"
            assert row[f"blind, {profile}"] == expected
        assert row["first shot"] == rows[row["task"], "ideal"]["first_shot"]


def pairs_of(cell):
    """Numbers of a cell "median / worst"; none of an empty one."""
    return [float(x) for x in cell.split("/") if x.strip()]


@pytest.mark.parametrize(
    ("name", "key", "first", "columns"),
    [
        (
            "stops.json",
            "case",
            "driver brakes, ms",
            [
                ("driver brakes, ms", "driver_brakes_s", 1e3),
                ("a tenth slower, ms", "slower_s", 1e3),
                ("at rest, ms", "rest_s", 1e3),
                ("m/s2", "deceleration_m_s2", 1.0),
            ],
        ),
        (
            "stops_emulated.json",
            "faults",
            "braking begins, ms",
            [
                ("braking begins, ms", "begins_s", 1e3),
                ("at rest, ms", "rest_s", 1e3),
                ("joint, rad/s2", "joint_rad_s2", 1.0),
                ("tool, m/s2", "tool_m_s2", 1.0),
            ],
        ),
    ],
)
def test_stops_are_those_of_their_rows(name, key, first, columns):
    rows = {row[key]: row for row in json.loads((DATA / name).read_text())}
    for shown in table("docs/robot.md", first):
        case = next(iter(shown.values())).strip("`")
        if case == "worst of all pairs":
            pairs = [row for case, row in rows.items() if "+" in case]
            for title, column, scale in columns:
                worst = scale * max(row[column]["worst"] for row in pairs)
                assert float(shown[title]) == pytest.approx(worst, abs=0.51), title
            continue
        for title, column, scale in columns:
            known = [x for x in rows[case][column].values() if x is not None]
            expected = [scale * x for x in known]
            found = pairs_of(shown[title])
            assert found == pytest.approx(expected, abs=0.51), (case, title)


def test_tracking_and_filters_are_those_of_their_rows():
    rows = rows_of("tracking.csv")
    for shown in table("docs/robot.md", "latency, ms"):
        row = next(
            r
            for r in rows
            if (r["filter"], r["time_s"], r["clock"])
            == (shown["filter"], shown["time, s"], shown["clock"])
        )
        assert shown["latency, ms"] == row["latency_ms"]
        assert pairs_of(shown["error, mm"]) == [
            float(row["rms_mm"]),
            float(row["largest_mm"]),
        ]

"""Figures in README and docs are those of the files in docs/data."""

import csv
import json
import math
import runpy
from pathlib import Path
from statistics import mean

import pytest

import marl_airhockey as ah
from marl_airhockey.evaluation.stats import interval
from marl_airhockey.hardware.rig import LATEST
from marl_airhockey.hardware.robot import MotionLimits
from marl_airhockey.registry import scenario_names, zoo_names
from marl_airhockey.sim.contracts.camera_model import lab_camera
from marl_airhockey.sim.core.profiles import PROFILES
from marl_airhockey.sim.core.table import TABLES

ROOT = Path(__file__).parents[2]
DATA = ROOT / "docs/data"
SPEED = DATA / "speed.json"
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


def script(name):
    path = ROOT / "scripts" / name
    with pytest.MonkeyPatch.context() as patch:
        # Scripts import what lies beside them.
        patch.syspath_prepend(path.parent)
        return runpy.run_path(str(path))


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


CHANGED = {"reach", "reach_velocity", "move_block", "hit_goal", "hit_goal_velocity"}
"""Tasks of version 1, which were trained with 3 seeds."""
SHOTS = {"move_block", "hit_goal", "hit_goal_velocity"}
"""Tasks that were trained with 2 seeds in the profile ur5e."""


def seeds(task, profile, column):
    found = [
        float(row[column])
        for row in rows_of("tasks.csv")
        if (row["task"], row["profile"], row["variant"]) == (task, profile, "")
    ]
    few = 2 if profile == "ur5e" and task in SHOTS else 3
    assert len(found) == (5 if profile == "ideal" and task not in CHANGED else few)
    return found


@pytest.mark.parametrize(
    ("page", "profile", "number", "titles"),
    [
        ("docs/task_results.md", "ideal", 0, ("success", "worst seed")),
        ("docs/task_results.md", "ur5e", 1, ("success", "worst seed")),
        ("docs/task_results.md", "ideal", 0, ("sampled", "on pymunk")),
        ("docs/task_results.md", "ur5e", 1, ("sampled", "on pymunk")),
        ("docs/task_results.md", "ur5e-calibrated", 2, ("success", "worst seed")),
        ("docs/task_results.md", "ur5e-calibrated", 2, ("sampled", "on pymunk")),
    ],
)
def test_tables_of_tasks_are_the_means_of_their_rows(page, profile, number, titles):
    shown = table(page, "task", *titles, number=number)
    assert len(shown) == (4 if profile == "ur5e-calibrated" else 10)
    for row in shown:
        for title in set(row) & set(COLUMNS):
            column, summary = COLUMNS[title]
            expected = summary(seeds(row["task"], profile, column))
            value = 0.0 if row[title] == "-" else float(row[title])
            assert value == pytest.approx(expected, abs=6e-4), (row, title)


@pytest.mark.parametrize(
    ("profile", "number"), [("ideal", 0), ("ur5e", 1), ("ur5e-calibrated", 2)]
)
def test_intervals_of_tasks_count_each_episode_once(profile, number):
    for row in table("docs/task_results.md", "task", "95 % interval", number=number):
        low, high = interval(mean(seeds(row["task"], profile, "success")), 2000)
        assert row["95 % interval"] == f"{low:.3f} .. {high:.3f}"


def test_the_zoo_is_that_of_its_rows():
    rows = {row["policy"]: row for row in rows_of("zoo.csv")}
    shown = table("docs/task_results.md", "task", "`zoo/TASK`, ideal")
    policies = []
    for line in shown:
        task, *cells = line.values()
        for end, cell in zip(("", "_ur5e", "_full_size"), cells, strict=True):
            if cell == "-":
                continue
            policies.append(f"{task}{end}")
            success, low, high = (
                float(rows[policies[-1]][name]) for name in ("success", "low", "high")
            )
            assert cell == f"{success:.3f} ({low:.3f} .. {high:.3f})"
    assert sorted(policies) == sorted(rows)


def test_sentences_of_the_readme_are_those_of_the_rows():
    text = " ".join((ROOT / "README.md").read_text().split())
    rows = [r for r in rows_of("tasks.csv") if r["profile"] == "ideal"]
    slowest = max(float(row["cpu_seconds_to_0.95"]) for row in rows)
    assert f"reaches a success of 0.95 within {math.ceil(slowest)} CPU-seconds" in text
    rates = [r["env_steps_per_cpu_s"] for r in json.loads(SPEED.read_text())]
    assert f"up to {max(rates) / 1e6:.0f} million environment steps" in text
    assert f"{len(rows_of('datasets.csv'))} datasets" in text
    policies = {policy.partition("_ur5e")[0] for policy in zoo_names()}
    assert policies >= {f"zoo/{name}" for name in scenario_names()}


def test_the_table_of_speed_is_that_of_its_run():
    found = json.loads(SPEED.read_text())
    shown = table("docs/speed.md", "ours / this")
    for row, run in zip(shown, found, strict=True):
        _, *cells = [cell.strip("*") for cell in row.values()]
        rates = [run["env_steps_per_cpu_s"], run["agent_steps_per_cpu_s"]]
        assert cells == [*(f"{x:,.0f}" for x in rates), f"{run['ours_over_this']:.3g}"]
        unit = run["compared"].replace("-", "_").split(" of ")[0] + "_per_cpu_s"
        ours = next(r for r in found if r["name"] == run["ours"])
        assert run["ours_over_this"] == pytest.approx(ours[unit] / run[unit])


def test_blind_columns_are_those_of_the_search():
    rows = {(r["task"], r["profile"]): r["success"] for r in rows_of("blind.csv")}
    for page, profile, number in (
        ("docs/task_results.md", "ideal", 0),
        ("docs/task_results.md", "ur5e", 1),
    ):
        for row in table(page, "task", "blind", number=number):
            assert row["blind"] == rows.get((row["task"], profile), "-")


def test_answer_times_are_those_that_were_measured():
    rows = {f"`{row['profile']}`": row for row in rows_of("answer_times.csv")}
    shown = table("docs/profiles.md", "profile", "end-to-end latency")
    assert len(shown) == len(rows)
    for row in shown:
        assert row["end-to-end latency"] == f"{rows[row['profile']]['answer_ms']} ms"


def test_table_of_the_arm_is_the_same():
    shown = table("docs/arm.md", "2D, ideal", "arm, ur5e")
    assert len(shown) == 10
    for row in shown:
        for title in ("2D, ideal", "arm, ideal", "2D, ur5e", "arm, ur5e"):
            where, profile = title.split(", ")
            column = {"2D": "success", "arm": "arm"}[where]
            expected = mean(seeds(row["task"], profile, column))
            assert float(row[title]) == pytest.approx(expected, abs=6e-4), (row, title)


def test_tables_of_offline_learning_are_those_of_their_rows():
    made = script("reproduce/offline_tables.py")["tables_of"](rows_of("offline.csv"))
    shown = [
        rows for head, rows in tables("docs/offline_results.md") if head[0] == "task"
    ]
    heads = [head for head, _ in tables("docs/offline_results.md") if head[0] == "task"]
    assert [[head, *rows] for head, rows in zip(heads, shown, strict=True)] == [
        *made.values()
    ]


def test_what_the_paper_announces_is_that_of_its_rows():
    header, *made = script("reproduce/announced.py")["table"]()
    shown = table("docs/offline_results.md", "study", "case")
    assert shown == [dict(zip(header, line, strict=True)) for line in made]


def test_the_cost_of_learning_is_that_of_all_rows():
    names = ("offline.csv", "announced.csv", "hindsight.csv")
    spent = sum(float(r["cpu_minutes"]) for name in names for r in rows_of(name))
    text = (ROOT / "docs/offline_results.md").read_text()
    assert f" {spent / 60:.1f} CPU-hours of learning in all" in text


def test_hindsight_is_that_of_its_rows():
    rows = {(row["task"], row["variant"]): row for row in rows_of("hindsight.csv")}
    shown = table("docs/training.md", "terminations", "success")
    assert len(shown) == len(rows)
    for line in shown:
        row = rows[line["task"], line["terminations"]]
        assert float(line["success"]) == float(row["success"])
        assert line["steps"] == row["steps"]
        assert line["CPU-minutes"] == row["cpu_minutes"]


@pytest.mark.parametrize("game", ["duel", "doubles", "free_for_all"])
def test_ladders_have_the_ratings_of_their_files(game):
    found = tables("docs/game_results.md")
    header, rows = next(t for t in found if t[0][0] == "level")
    column = header.index(f"{game}: steps") + 1
    ladder = rows_of(f"{game}_ladder.csv")
    assert len(ladder) == len(rows)
    for cells, known in zip(rows, ladder, strict=True):
        assert float(cells[column]) == pytest.approx(float(known["elo"]), abs=0.6)


def test_set_pieces_have_the_shares_of_their_rows():
    rows = {(row["suite"], row["driver"]): row for row in rows_of("suites.csv")}
    shown = table("docs/set_pieces.md", "driver", "attack-v1")
    for line in shown:
        driver, *_ = line.values()
        for suite in list(line)[1:]:
            policy = "zoo/doubles" if suite == "pass-v1" else "zoo/duel"
            name = driver.replace("zoo, level ", f"{policy}_")
            known = rows[suite, policy if name == "zoo" else name]
            assert line[suite] == f"{float(known['success']):.3f}"
            low, high = interval(float(known["success"]), 1000)
            assert high - low < 0.065
    visible = [key for key in rows if key[0] == "blackout-v1, visible"]
    assert len(shown) * (len(line) - 1) == len(rows) - len(visible)
    for line in table("docs/set_pieces.md", "driver in blackout-v1"):
        driver = line["driver in blackout-v1"]
        for title, name in (("hidden", ""), ("visible", ", visible")):
            known = rows[f"blackout-v1{name}", driver]
            assert line[title] == f"{float(known['success']):.3f}"
    for line in table("docs/set_pieces.md", "driver in defence-v1"):
        driver, *shares = line.values()
        known = rows["defence-v1", driver]
        for k, share in enumerate(shares):
            assert float(share) == pytest.approx(
                float(known[f"class_{k + 1}"]), abs=0.0051
            )
    for line in table("docs/set_pieces.md", "suite", "solvable"):
        task = ah.load_suite(line["suite"].strip("`")).pieces.task
        assert line["task of `paddle_0`"] == task.title
        others = [f"`{name}`" for name in task.drivers.values()]
        assert line["other drivers"] == ", ".join(others)
        assert float(line["seconds"]) == task.seconds
        assert line["solvable"] == f"{task.solvable:.2f}"


def test_speed_of_images_is_that_of_its_rows():
    rows = json.loads((DATA / "images.json").read_text())
    titles = {
        "velocity": "velocities",
        "pixels": "three grey frames",
        "pixels:colour=rgb,frames=1": "one colour frame",
    }
    rates = {
        (r["scenario"], str(r["worlds"]), titles[r["observe"]]): r[
            "agent_steps_per_cpu_s"
        ]
        for r in rows
    }
    shown = table("docs/image_observations.md", "scenario", "worlds")
    assert len(shown) * len(titles) == len(rates)
    for line in shown:
        scenario, worlds, *_ = line.values()
        for title in titles.values():
            assert line[title] == f"{rates[scenario, worlds, title]:,.0f}"
    spreads = [100 * row["spread"] for row in rows]
    frames = json.loads((DATA / "camera_speed.json").read_text())
    one, some, many = (f"{row['agent_steps_per_cpu_s']:,.0f}" for row in frames)
    text = " ".join(Path("docs/image_observations.md").read_text().split())
    assert f"{one} of them with 1 world, {some} with 64 and {many} with 1,024" in text
    assert f"{min(spreads):.0f} to {max(spreads):.0f} % of the median" in text


def test_agreement_of_camera_frames_is_that_of_its_rows():
    row = json.loads((DATA / "camera_images.json").read_text())
    text = " ".join(Path("docs/image_observations.md").read_text().split())
    levels = f"by {row['mean']:.1f} of 255 on average, and 98 % of the values differ by"
    assert f"{levels} at most {row['quantile_98']:.0f}." in text
    most = row["puck_centre_most_px"]
    # A pixel of the image shows 1/84 of the window.
    window = lab_camera(TABLES["full_size"]).window(TABLES["full_size"])
    metres = most * window.side / row["size"] / (602.0 / 2.15)
    assert f"at most {most:.2f} pixels, which is {1e3 * metres:.0f} mm" in text


def test_results_of_image_policies_are_those_of_their_rows():
    lines = script("reproduce/image_policies.py")["summary"](
        rows_of("image_policies.csv")
    )
    shown = table("docs/image_observations.md", "method", "reach")
    assert [list(line.values()) for line in shown] == lines


def test_success_by_latency_is_that_of_its_rows():
    found = script("reproduce/delay.py")
    groups = found["groups"](rows_of("delay.csv"))
    shown = {}
    for task in found["TASKS"]:
        for line in table("docs/latency.md", f"method in {task}"):
            method, *cells = line.values()
            shown[task, method] = cells
    for suite in found["SUITES"]:
        for line in table("docs/latency.md", f"driver in {suite}"):
            driver, *cells = line.values()
            shown[suite, driver] = cells
    assert shown == {
        key: [f"{share:.2f}" for share in values.mean(0)]
        for key, values in groups.items()
    }


def test_gaps_of_coordination_are_those_of_their_rows():
    rows = rows_of("coordination.csv")
    shown = {
        (line["game"], line["method"]): line
        for line in table("docs/game_results.md", "method", "other seeds")
    }
    assert set(shown) == {(row["game"], row["method"]) for row in rows}
    for key, line in shown.items():
        mine = [row for row in rows if (row["game"], row["method"]) == key]
        scripts = ("striker", "allround")
        groups = {
            "with itself": [r for r in mine if r["partner"] == r["seed"]],
            "other seeds": [
                r for r in mine if r["partner"] not in (r["seed"], *scripts)
            ],
            **{n: [r for r in mine if r["partner"] == n] for n in scripts},
        }
        means = {}
        for name, group in groups.items():
            means[name] = mean(float(r["return"]) for r in group)
            share = mean(float(r["success"]) for r in group)
            assert line[name] == f"{means[name]:.1f} ({share:.2f})"
        gap = means["with itself"] - means["other seeds"]
        assert line["gap"].split()[0] == f"{gap:.1f}"


def test_scores_of_games_are_those_of_their_rows():
    games = script("reproduce/games.py")
    columns = games["COLUMNS"]
    lines = games["summary"](rows_of("games.csv"))
    known = {tuple(line[:2]): dict(zip(columns, line, strict=True)) for line in lines}
    shown = [
        line
        for titles in (("game", "player", "allround"), ("game", "player", "return"))
        for line in table("docs/game_results.md", *titles)
    ]
    for line in shown:
        row = known.pop((line["game"], line["player"]))
        assert line == {title: row[title] or "-" for title in line}
    assert not known


def test_the_leaderboard_is_that_of_its_cards():
    page = script("reproduce/leaderboard.py")["page"]()
    assert (ROOT / "docs/leaderboard.md").read_text() == page


def test_best_responses_are_those_of_their_rows():
    rows = sorted(rows_of("exploitability.csv"), key=lambda row: row["response_seed"])
    scores = [f"{float(row['score']):.2f}" for row in rows]
    text = " ".join((ROOT / "docs/game_results.md").read_text().split())
    assert f"score {', '.join(scores[:-1])} and {scores[-1]} in 400 games" in text


def test_duels_are_those_of_their_rows():
    rows = {
        (float(row["reaction"]), row["home"], row["far"]): row
        for row in rows_of("reaction.csv")
    }
    for line in table("docs/game_results.md", "opponent", "bank shots"):
        row = rows.pop((0.15, "zoo/duel", line["opponent"]))
        goals = f"{float(row['home_goals']):.1f} : {float(row['far_goals']):.1f}"
        assert line["level games"] == f"{float(row['level']):.2f}"
        assert line["goals"] == goals
        assert line["goals per minute"] == f"{float(row['goals_per_minute']):.1f}"
        assert line["goals per shot"] == f"{float(row['goals_per_shot']):.2f}"
        assert line["bank shots"] == f"{float(row['bank_shots']):.2f}"
    (found,) = [t for t in tables("docs/game_results.md") if t[0][0] == "latency, s"]
    for latency, *cells in found[1]:
        for k, pair in enumerate(
            (("allround", "goalkeeper"), ("striker", "goalkeeper"), ("allround",) * 2)
        ):
            row = rows.pop((float(latency), *pair))
            shown = (
                f"{float(row['level']):.2f}",
                f"{float(row['goals_per_minute']):.1f}",
            )
            assert tuple(cells[2 * k : 2 * k + 2]) == shown
    assert not rows


def test_games_go_as_in_their_rows():
    rows = {(row["game"], row["player"]): row for row in rows_of("stalls.csv")}
    shown = table("docs/game_results.md", "at rest", "pinned")
    assert len(shown) == len(rows)
    for line in shown:
        row = rows[line["game"], line["player"]]
        assert line["at rest"] == f"{float(row['rests']):.3f}"
        assert line["in corners"] == f"{float(row['rests_in_corner']):.3f}"
        assert line["pinned"] == f"{float(row['pinned']):.3f}"
        assert line["goals per minute"] == f"{float(row['goals_per_minute']):.1f}"
        serves = float(row["other_serves_per_minute"])
        assert line["other serves per minute"] == f"{serves:.1f}"
        assert line["decided"] == f"{float(row['decided']):.2f}"


def test_blind_controllers_are_those_of_their_rows():
    rows = {(row["task"], row["profile"]): row for row in rows_of("blind.csv")}
    shown = table("docs/task_results.md", "blind, ideal")
    assert len(shown) == 5
    for row in shown:
        for profile in ("ideal", "ur5e"):
            found = rows[row["task"], profile]
            expected = f"{found['success']} ({found['low']} .. {found['high']})"
            assert row[f"blind, {profile}"] == expected
        assert row["first shot"] == rows[row["task"], "ideal"]["first_shot"]


STOPS = {
    "stops.json": {
        "driver brakes, ms": ("driver_brakes_s", 1e3, 0),
        "a tenth slower, ms": ("slower_s", 1e3, 0),
        "at rest, ms": ("rest_s", 1e3, 0),
        "m/s2": ("deceleration_m_s2", 1.0, 1),
    },
    "stops_emulated.json": {
        "braking begins, ms": ("begins_s", 1e3, 0),
        "at rest, ms": ("rest_s", 1e3, 0),
        "joint, rad/s2": ("joint_rad_s2", 1.0, 1),
        "tool, m/s2": ("tool_m_s2", 1.0, 1),
    },
}
"""Columns of the tables of stops: that of the file, its scale, and digits"""


@pytest.mark.parametrize("name", STOPS)
def test_stops_are_those_of_their_rows(name):
    rows = json.loads((DATA / name).read_text())
    found = {row.get("case") or row["faults"]: row for row in rows}
    pairs = [row for case, row in found.items() if "+" in case]
    lines = table("docs/robot_results.md", *STOPS[name])
    # The pairs have one line.
    assert len(lines) == len(found) - len(pairs) + bool(pairs)
    for shown in lines:
        case = next(iter(shown.values())).strip("`")
        for title, (column, scale, digits) in STOPS[name].items():
            if case == "worst of all pairs":
                worst = [row[column]["worst"] for row in pairs]
                known = [max(x for x in worst if x is not None)]
            else:
                known = [x for x in found[case][column].values() if x is not None]
            expected = " / ".join(f"{scale * x:.{digits}f}" for x in known)
            assert shown[title] == expected, (case, title)


def test_every_trial_of_a_stop_comes_to_rest():
    rows = json.loads((DATA / "stops_emulated.json").read_text())
    for row in rows:
        # A caller goes on where somebody only turned the slider down.
        expected = 0 if row["faults"] == "speed_slider" else row["trials"]
        assert row["come_to_rest"] == expected, row["faults"]


def test_the_long_run_is_that_of_its_row():
    row = json.loads((DATA / "soak.json").read_text())
    changes = row["changes"].items()
    stops, holds = (
        sum(count for name, count in changes if name.startswith(kind))
        for kind in ("FAULT", "HOLD")
    )
    (shown,) = table("docs/robot_results.md", "emulated hours", "leaps")
    assert list(shown.values()) == [
        f"{row['hours']:g}",
        f"{row['cycles']:,}",
        f"{row['faults']:,}",
        f"{stops} / {holds}",
        f"{row['longest_cycle_cpu_ms']:.1f}",
        f"{row['top_speed']:.3f}",
        f"{row['leaps']}",
        f"{row['outside_mm']:.1f} / {row['below_table_mm']:.1f}",
    ]
    assert row["leaps"] == 0


def test_faults_of_the_lab_are_those_of_their_rows():
    rows = json.loads((DATA / "lab_faults.json").read_text())
    alone = [row for row in rows if "+" not in row["faults"]]
    shown = table("docs/robot_results.md", "fault", "reason of the end")
    titles = "episode ends, ms", "at rest, ms", "moved on, mm"
    for line, row in zip(shown, alone, strict=True):
        assert line["fault"] == f"`{row['faults']}`"
        assert line["reason of the end"] == (row["reason"] or "continues")
        columns = "ended_s", "rest_s", "moved_m"
        for title, column in zip(titles, columns, strict=True):
            value = row[column]
            assert line[title] == ("" if value is None else f"{1e3 * value:.0f}")


def test_pairs_of_faults_are_those_of_their_rows():
    rows = json.loads((DATA / "lab_faults.json").read_text())
    assert sum("+" in row["faults"] for row in rows) == 136
    shown = table("docs/robot_results.md", "reason of the end", "pairs")
    assert shown == script("bench/lab_faults.py")["summary_of"](rows)


def test_success_of_datasets_is_that_of_their_rows():
    rows = {row["name"]: row for row in rows_of("datasets.csv")}
    tiers = "medium-replay", "synthetic-human"
    header, *lines = script("reproduce/datasets.py")["table_of"](rows)
    shown = table("docs/datasets.md", *tiers)
    assert shown == [dict(zip(header, line, strict=True)) for line in lines]
    header, *lines = script("reproduce/datasets.py")["tiers_of"](rows)
    shown = table("docs/datasets.md", "tier", "MB")
    assert shown == [dict(zip(header, line, strict=True)) for line in lines]


def test_latency_of_the_lab_is_that_of_its_rows():
    rows = rows_of("lab_latency.csv")
    shown = table("docs/robot_results.md", "median, ms", "profile `ur5e`, ms")
    for line, row in zip(shown, rows, strict=True):
        assert line["part"] == row["part"]
        assert line["median, ms"] == row["median_ms"]
        assert line["5 % .. 95 %, ms"] == row["range_ms"]
        assert line["profile `ur5e`, ms"] == row["profile_ms"]


def test_tasks_through_the_lab_are_those_of_their_rows():
    rows = {row["task"]: row for row in rows_of("lab_tasks.csv")}
    shown = table("docs/robot_results.md", "through camera and arm", "plant alone")
    assert len(shown) == len(rows) == 5
    for line in shown:
        row = rows[line["task"]]
        for title, column in (
            ("through camera and arm", "lab"),
            ("plant alone", "plant"),
            ("profile `ur5e`", "ur5e"),
        ):
            assert line[title] == row[column]


def test_shots_in_a_fitted_lab_are_those_of_their_rows():
    rows = {row["task"]: row for row in rows_of("lab_shots.csv")}
    shown = table("docs/robot_results.md", "first shot there")
    assert len(shown) == len(rows)
    columns = ("task", "lab", "first_shot", "profile", "profile_first_shot")
    for line in shown:
        row = rows[line["task"]]
        assert [*line.values()] == [row[column] for column in columns]


def test_first_starts_are_those_that_were_measured():
    found = {(row["case"], row["place"]): row for row in rows_of("first_start.csv")}
    listed = table("docs/backends.md", "first start")
    assert len(listed) == len(found) / 2
    for row in listed:
        for title, place in (("checkout", "here"), ("wheel", "there")):
            costs = found[row["first start"], place]
            for unit, column in (("s", "seconds"), ("CPU-s", "cpu_seconds")):
                assert row[f"{title}, {unit}"] == f"{float(costs[column]):.1f}"


def test_tracking_is_that_of_its_rows():
    rows = {(row["filter"], row["clock"]): row for row in rows_of("tracking.csv")}
    shown = table("docs/robot_results.md", "latency, ms")
    assert len(shown) == len(rows)
    for line in shown:
        row = rows[line["filter"], line["clock"]]
        assert line["latency, ms"] == row["latency_ms"]
        assert line["error, mm"] == f"{row['rms_mm']} / {row['largest_mm']}"


def test_filters_are_those_of_their_rows():
    cell = "task", "commands", "limits"
    rows = {
        (*map(row.get, cell), f"{row['filter']}, {row['time_s']} s"): row
        for row in rows_of("smoothing.csv")
    }
    columns = {
        "largest acceleration, m/s2": "acceleration_peak",
        "largest jerk, m/s3": "jerk_peak",
        "protective stops an hour": "stops_per_hour",
    }
    shown = table("docs/robot_results.md", *columns)
    assert len(shown) >= 20
    for line in shown:
        row = rows[(*map(line.get, cell), line["filter, its time"])]
        assert line["success"] == f"{row['success']} ({row['low']} .. {row['high']})"
        for title, column in columns.items():
            assert line[title] == row[column]


def test_distances_after_a_stop_are_those_of_the_limits():
    for line in table("docs/robot.md", "stopping distance"):
        speed = float(line["speed"].removesuffix(" m/s"))
        distance = LATEST * speed + MotionLimits(speed=speed).stopping_distance
        assert line["stopping distance"] == f"{distance:.2f} m"


def test_figures_of_the_page_without_a_server_are_those_of_its_row():
    row = json.loads((DATA / "static_page.json").read_text())
    shown = table("docs/browser_page.md", "measure", "value")
    assert [line["value"] for line in shown] == [
        f"{row['mb']:.2f} MB",
        f"{row['loaded_mb']:.2f} MB",
        f"{row['first_frame_s']:.2f} s",
        f"{row['frames_per_s']:.1f}",
        f"{row['ticks_per_s']:.1f}",
        f"{100 * row['core_share']:.0f} %",
    ]


def test_scores_of_the_engine_device_are_those_of_their_rows():
    shown = table("docs/gpu.md", "seed of the training", "steps")
    for line, row in zip(shown, rows_of("device_games.csv"), strict=True):
        assert line["seed of the training"] == row["seed"]
        assert line["steps"] == f"{int(row['steps']) / 1e6:.1f} M"
        assert line["CPU-minutes"] == row["cpu_minutes"]
        assert line["score against `zoo/duel`"] == row["score"]
        assert line["95 % interval"] == f"{row['low']} .. {row['high']}"


def test_figures_of_marked_pucks_are_those_of_their_rows():
    shown = table("docs/robot_results.md", "puck", "bar read")
    for line, name in zip(shown, ("vision_marked", "vision_plain"), strict=True):
        row = json.loads((DATA / f"{name}.json").read_text())["tags of measured places"]
        assert line["spin error, RMS"] == f"{row['spin_rmse']:.2f} rad/s"
        assert line["mean error of the position"] == f"{row['mean']:.2f} mm"
        if name == "vision_marked":
            assert line["bar read"] == f"{100 * row['read']:.1f} %"
            assert line["orientation error, RMS"] == f"{row['angle']:.3f} rad"


def test_accuracies_of_the_vision_are_those_of_their_rows():
    rows = json.loads((DATA / "vision_plain.json").read_text())
    shown = table("docs/robot_results.md", "position error, mean")
    for line, row in zip(shown, rows.values(), strict=True):
        assert line["position error, mean"] == f"{row['mean']:.2f} mm"
        assert line["position error, 95 % quantile"] == f"{row['p95']:.2f} mm"
        assert line["velocity error, RMS"] == f"{row['rmse']:.3f} m/s"


def test_errors_of_calibrated_cameras_are_those_of_their_rows():
    rows = json.loads((DATA / "camera_map.json").read_text())
    shown = table("docs/robot_results.md", "outside, median")
    for line, row in zip(shown, rows.values(), strict=True):
        least, most = (row[f"inside_sd_per_axis_{end}"] for end in ("best", "worst"))
        assert list(line.values())[1:] == [
            f"{row['inside_median']:.2f}",
            f"{row['inside_median_worst']:.2f}",
            f"{least:.2f} .. {most:.2f}",
            f"{row['outside_median']:.2f}",
        ]


def test_the_calibrated_profile_has_the_intervals_of_the_fits():
    profile, middle = PROFILES["ur5e-calibrated"], PROFILES["ur5e"]
    for name in ("puck_drag", "wall_restitution", "paddle_restitution"):
        rows = [r for r in rows_of("fitted_tables.csv") if r["parameter"] == name]
        half = mean([(float(r["high"]) - float(r["low"])) / 2 for r in rows])
        low, high = profile.ranges[name]
        assert (high - low) / 2 == pytest.approx(half, rel=0.1)
        assert low + high == pytest.approx(sum(middle.ranges[name]), abs=1e-9)
    vision = json.loads((DATA / "vision_marked.json").read_text())
    row = vision["tags of measured places"]
    assert profile.ranges["angle_noise"][1] == pytest.approx(row["angle"], abs=5e-4)
    dropout = profile.ranges["angle_dropout"][1]
    assert dropout == pytest.approx(1.0 - row["read"], abs=5e-4)
    row = json.loads((DATA / "camera_map.json").read_text())["tags and edges"]
    ends = [1e-3 * row[f"inside_sd_per_axis_{end}"] for end in ("best", "worst")]
    assert profile.ranges["calibration_error"] == pytest.approx(ends, abs=1e-6)


def test_what_each_error_costs_is_that_of_its_rows():
    tasks = "hit_goal", "move_block", "hit_goal_velocity"
    rows = rows_of("ceilings.csv")
    shown = table("docs/task_results.md", "unknown to the planner")
    for name in tasks:
        of = [row for row in rows if row["task"] == name]
        assert [line[name] for line in shown] == [
            f"{float(row['success']):.2f}" for row in of
        ]
        for row in of:
            assert float(row["high"]) - float(row["low"]) < 0.1

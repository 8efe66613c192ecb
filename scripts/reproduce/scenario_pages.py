"""Write a page of documentation for every scenario, from its class and its results.

    python scripts/reproduce/scenario_pages.py --out docs/scenarios

`make docs` runs it. Ranges of the start are those of 1000 sampled starts; results are
the rows of the files in ``docs/data``.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import fields
from pathlib import Path
from statistics import mean
from typing import Annotated, Any

import numpy as np
import typer
from pictures import moment, save
from rows import DATA, read

import marl_airhockey as ah
from marl_airhockey.envs.describe import describe
from marl_airhockey.sim.contracts.scenario import Scenario

STARTS = 1000
"""Number of starts of which the ranges are shown, and of episodes of random actions"""
COMMON = {field.name for field in fields(Scenario)}
"""Options of all scenarios"""
WIDTH = 720
"""Width of an image, pixels"""


def table(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> list[str]:
    """Return the lines of a Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return [f"| {' | '.join(map(str, line))} |" for line in lines]


def rows_of(name: str, **where: str) -> list[dict[str, str]]:
    """Return the rows of a file in which some columns have some values."""
    return [row for row in read(DATA / name) if where.items() <= row.items()]


def starts(name: str) -> list[str]:
    """Return the range of every element of the observation at the start, as text."""
    first = np.asarray(ah.make_world(name, STARTS).reset(0))[:, 0]
    low, high = first.min(0), first.max(0)
    return [
        f"{a:.2f}"
        if a == b
        else f"{np.floor(100 * a) / 100:.2f} to {np.ceil(100 * b) / 100:.2f}"
        for a, b in zip(low.tolist(), high.tolist(), strict=True)
    ]


def results(name: str) -> list[str]:
    """Return the lines of the table of results; none if there are no rows."""
    rows = []
    if len(ah.make_scenario(name).scene.seats) == 1:
        chance = ah.evaluate("random", name, episodes=STARTS)
        low, high = chance.success_interval
        text = f"{chance.success:.3f} ({low:.3f} to {high:.3f})"
        rows.append(("random actions, `ideal`", text))
    for profile in ("ideal", "ur5e"):
        trained = rows_of("tasks.csv", task=name, profile=profile, variant="")
        blind = rows_of("blind.csv", task=name, profile=profile)
        if blind:
            cells = (f"{float(blind[0][k]):.3f}" for k in ("success", "low", "high"))
            text = "{} ({} to {})".format(*cells)
            rows.append((f"best controller that does not aim, `{profile}`", text))
        if trained:
            success = mean(float(row["success"]) for row in trained)
            minutes = mean(float(row["cpu_minutes"]) for row in trained)
            what = f"PPO, {len(trained)} seeds, {minutes:.1f} CPU-minutes, `{profile}`"
            rows.append((what, f"{success:.3f}"))
    for row in rows_of("zoo.csv", policy=name):
        text = "{:.3f} ({:.3f} to {:.3f})".format(
            *(float(row[k]) for k in ("success", "low", "high"))
        )
        rows.append((f"`zoo/{name}`, `ideal`", text))
    if not rows:
        return []
    about = "Success of policies; numbers in brackets are 95 % intervals."
    where = "The commands are on the page of [all results](../task_results.md)."
    return ["## Results", "", about, where, "", *table(("policy", "success"), rows), ""]


def page(name: str) -> str:
    """Return the page of a scenario."""
    data, scenario = describe(name), ah.make_scenario(name)
    seats = scenario.scene.seats
    size = len(data["observation"])
    agents = (
        f"`paddle_0` to `paddle_{len(seats) - 1}`" if len(seats) > 1 else "`paddle_0`"
    )
    make = f'`ah.parallel_env("{name}")`'
    if len(seats) == 1:
        make = f'`gymnasium.make("{data["id"]}")`, {make}'
    facts = [
        ("create", make),
        ("agents", agents),
        ("action", "`Box(-1, 1, (2,))`: target velocity / top speed, ego frame"),
        ("observation", f"`Box({size},)`"),
        ("latency by the rules", f"{scenario.reaction:g} s"),
        ("top speed", f"{seats[0].speed:g} m/s"),
        ("time limit", f"{data['seconds']:g} s, 20 steps per second"),
    ]
    observation = [
        (k, f"`{e['label']}`", e["unit"], e["low"], e["high"], start)
        for k, (e, start) in enumerate(
            zip(data["observation"], starts(name), strict=True)
        )
    ]
    meanings = dict.fromkeys(e["meaning"] for e in data["observation"])
    options = [
        (f"`{o['option']}`", f"`{o['default']}`", o["meaning"].replace("|", "\\|"))
        # Those of the base class are last.
        for o in sorted(data["options"], key=lambda o: o["option"] in COMMON)
    ]
    lines = [
        f"# {name.replace('_', ' ').capitalize()}",
        "",
        data["description"].replace("\n", "\n\n").replace("``", "`"),
        "",
        f"![{name.replace('_', ' ')}, played by a script](images/{name}.png)",
        "",
        *table(("property", "value"), facts),
        "",
        "## Start",
        "",
        data["start"],
        "",
        "## Observation",
        "",
        *(f"- {meaning}" for meaning in meanings if meaning),
        "",
        "The last column is the range at the start of an episode.",
        "",
        *table(("index", "label", "unit", "min", "max", "start"), observation),
        "",
        "## Reward",
        "",
        "The reward is the sum of these terms.",
        "",
        *table(
            ("term", "value"),
            [
                (f"`{r['term']}`", r["meaning"].replace("``", "`"))
                for r in data["reward"]
            ],
        ),
        "",
        "## End",
        "",
        f"Termination: {data['termination']}",
        "",
        f"Truncation: after {data['seconds']:g} s.",
        "",
        f"Success: {data['success']}",
        "",
        *results(name),
    ]
    lines += ["## Options", ""]
    lines += [*table(("option", "default", "meaning"), options), ""]
    lines += ["[Obstacles and regions](../scene_options.md) has examples."]
    return "\n".join(lines) + "\n"


def main(
    out: Annotated[Path, typer.Option(help="Folder of the pages.")] = Path(
        "docs/scenarios"
    ),
) -> None:
    """Write a page and an image of each scenario."""
    (out / "images").mkdir(parents=True, exist_ok=True)
    for name in ah.scenario_names():
        (out / f"{name}.md").write_text(page(name))
        save(out / "images" / f"{name}.png", moment(name, WIDTH))


if __name__ == "__main__":
    typer.run(main)

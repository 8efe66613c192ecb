"""Command ``airhockey list``."""

from __future__ import annotations

import json
from typing import Annotated

import typer
from rich.table import Table

from marl_airhockey.cli.options import (
    AsJson,
    console,
)
from marl_airhockey.envs.describe import describe, describe_profile, summary
from marl_airhockey.registry import plugin_names, runs_code, scenario_names
from marl_airhockey.sim.core.errors import unknown_name
from marl_airhockey.sim.core.profiles import PROFILES, SUFFIX


def list_scenarios(
    scenario: Annotated[
        str | None,
        typer.Argument(
            help="Scenario or profile to describe; by default everything is listed."
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """List everything by name, or describe a scenario or a profile.

    The description of a scenario lists its start, termination, success, seats,
    observation, reward terms and options.
    """
    if scenario is None:
        data = summary()
        if as_json:
            console.print_json(json.dumps(data))
            return
        table = Table("scenario", "what", "seats", "seconds")
        for row in data["scenarios"]:
            table.add_row(*(str(row[k]) for k in ("name", "what", "seats", "seconds")))
        console.print(table)
        console.print("drivers: ", ", ".join(data["drivers"]))
        console.print("zoo:     ", ", ".join(data["zoo"]))
        console.print("backends:", ", ".join(data["backends"]))
        console.print("profiles:", ", ".join(data["profiles"]))
        return
    if scenario in PROFILES or scenario.endswith(SUFFIX):
        _show_profile(scenario, as_json)
        return
    known = [*scenario_names(), *plugin_names("scenarios"), *PROFILES]
    if scenario not in known and not runs_code(scenario):
        raise ValueError(unknown_name("scenario or profile", scenario, known))
    data = describe(scenario)
    if as_json:
        console.print_json(json.dumps(data))
        return
    console.print(
        f"[bold]{scenario}[/bold]  {data['id'] or ''}\n{data['description']}\n"
    )
    for title in ("start", "termination", "success"):
        console.print(f"[italic]{title}[/italic]: {data[title]}\n")
    for title in ("seats", "observation", "reward", "options"):
        table = Table(*data[title][0], title=title, title_justify="left")
        above = ""
        for row in data[title]:
            # Rows that share a meaning print it once.
            shown = {**row, "meaning": ""} if row.get("meaning") == above else row
            above = row.get("meaning", "")
            table.add_row(*(str(v) for v in shown.values()))
        console.print(table)


def _show_profile(name: str, as_json: bool) -> None:
    data = describe_profile(name)
    if as_json:
        console.print_json(json.dumps(data))
        return
    console.print(f"[bold]{name}[/bold]  {data['what']}\ndelay: {data['delay']}\n")
    if data["parameters"]:
        table = Table(*data["parameters"][0])
        for row in data["parameters"]:
            table.add_row(*(str(v) for v in row.values()))
        console.print(table)

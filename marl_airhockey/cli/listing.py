"""Command ``airhockey list``."""

from __future__ import annotations

import json
from typing import Annotated

import typer
from rich.table import Table

from marl_airhockey.cli.options import (
    AsJson,
    app,
    console,
)
from marl_airhockey.envs.describe import describe, summary


@app.command("list")
def list_scenarios(
    scenario: Annotated[str | None, typer.Argument(help="Describe this one.")] = None,
    as_json: AsJson = False,
) -> None:
    """List scenarios, drivers and backends, or describe one scenario."""
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
        return
    data = describe(scenario)
    if as_json:
        console.print_json(json.dumps(data))
        return
    console.print(f"[bold]{scenario}[/bold]  {data['id'] or ''}\n{data['what']}\n")
    console.print(f"[italic]success[/italic]: {data['success']}\n")
    for title in ("seats", "observation", "reward", "options"):
        table = Table(*data[title][0], title=title, title_justify="left")
        above = ""
        for row in data[title]:
            # What several rows share is said once.
            shown = {**row, "meaning": ""} if row.get("meaning") == above else row
            above = row.get("meaning", "")
            table.add_row(*(str(v) for v in shown.values()))
        console.print(table)

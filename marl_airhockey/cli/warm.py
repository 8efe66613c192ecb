"""Command ``airhockey warm``."""

from __future__ import annotations

from typing import Annotated

import typer

from marl_airhockey.cli.options import Backend, Profile, app, bar
from marl_airhockey.registry import DEFAULT_BACKEND, find_scenario, scenario_names
from marl_airhockey.world.build import compile_world


@app.command("warm")
def warm(
    scenarios: Annotated[
        list[str] | None, typer.Argument(help="Scenarios; all if none are given.")
    ] = None,
    backend: Backend = DEFAULT_BACKEND,
    profile: Profile = "ideal",
) -> None:
    """Compile scenarios now, once per machine, so that nothing waits for it later."""
    games = [(name, find_scenario(name)) for name in scenarios or scenario_names()]
    with bar() as progress:
        task = progress.add_task("compiling", total=len(games), note="")
        for name, game in games:
            progress.update(task, note=name)
            compile_world(game, {"backend": backend, "profile": profile})
            progress.advance(task)

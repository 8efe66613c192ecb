"""Command ``airhockey warm``."""

from __future__ import annotations

from typing import Annotated

import numpy as np
import typer

from marl_airhockey.cli.options import Backend, Profile, app, bar
from marl_airhockey.make import make_world
from marl_airhockey.registry import find_scenario, scenario_names


@app.command("warm")
def warm(
    scenarios: Annotated[
        list[str] | None, typer.Argument(help="Scenarios; all if none are given.")
    ] = None,
    backend: Backend = "numba",
    profile: Profile = "ideal",
) -> None:
    """Compile scenarios now, once per machine, so that nothing waits for it later."""
    games = [(name, find_scenario(name)) for name in scenarios or scenario_names()]
    with bar() as progress:
        task = progress.add_task("compiling", total=len(games), note="")
        for name, game in games:
            progress.update(task, note=name)
            world = make_world(game, 2, backend=backend, profile=profile)
            world.reset(0)
            # An episode begins again: what that needs is compiled, too.
            world.max_cycles = 1
            for _ in range(2):
                world.step(np.zeros((2, len(world.open), 2)))
            world.close()
            progress.advance(task)

"""Command ``airhockey warm``."""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from typing import Annotated

import typer

from marl_airhockey.cli.options import Backend
from marl_airhockey.cli.progress import bar
from marl_airhockey.registry import DEFAULT_BACKEND, find_scenario, scenario_names
from marl_airhockey.world.build import Keywords, compile_world


def warm(
    scenarios: Annotated[
        list[str] | None, typer.Argument(help="Scenarios; all if none are given.")
    ] = None,
    backend: Backend = DEFAULT_BACKEND,
    profile: Annotated[str, typer.Option(help="ideal, ur5e, gantry.")] = "ideal",
    jobs: Annotated[
        int, typer.Option(help="Number of processes that compile.", min=1)
    ] = os.cpu_count() or 1,
) -> None:
    """Compile scenarios now, once per machine, so that nothing waits for it later."""
    names = scenarios or scenario_names()
    seats = {name: len(find_scenario(name).scene.seats) for name in names}
    # Those with many seats take longest and begin first.
    names = sorted(seats, key=lambda name: -seats[name])
    keywords: Keywords = {"backend": backend, "profile": profile}
    with bar() as progress:
        task = progress.add_task("compiling", total=len(names), note="")
        for name in _compiled(names, keywords, min(jobs, len(names))):
            progress.update(task, note=name, advance=1)


def _compiled(names: list[str], keywords: Keywords, jobs: int) -> Iterator[str]:
    """Compile scenarios in some processes; yield the name of each when it is done."""
    if jobs == 1:
        yield from (_compile(name, keywords) for name in names)
        return
    with ProcessPoolExecutor(jobs, get_context("spawn")) as pool:
        for done in as_completed(pool.submit(_compile, n, keywords) for n in names):
            yield done.result()


def _compile(name: str, keywords: Keywords) -> str:
    compile_world(find_scenario(name), keywords)
    return name

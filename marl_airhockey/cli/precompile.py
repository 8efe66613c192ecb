"""Command ``airhockey precompile``."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated

import typer

from marl_airhockey.build import compile_world
from marl_airhockey.cli.options import Backend
from marl_airhockey.cli.progress import bar
from marl_airhockey.registry import (
    DEFAULT_BACKEND,
    driver_class,
    find_scenario,
    independent_driver_names,
    make_driver,
    scenario_names,
    zoo_names,
)
from marl_airhockey.rollouts.as_trained import as_trained
from marl_airhockey.sim.contracts.image_form import CAMERA, IMAGES
from marl_airhockey.sim.core.errors import unknown_name
from marl_airhockey.sim.jit import shipped
from marl_airhockey.sim.jit.cache import used
from marl_airhockey.sim.world.keywords import Keywords


def precompile(
    scenarios: Annotated[
        list[str] | None,
        typer.Argument(help="Names of scenarios; by default all scenarios."),
    ] = None,
    backend: Backend = DEFAULT_BACKEND,
    profile: Annotated[
        list[str] | None,
        typer.Option(
            help="Sensing and actuation: ideal (the default), ur5e, "
            "ur5e-calibrated, ur5e-authors, gantry, or a file of airhockey fit-table. "
            "Can be repeated."
        ),
    ] = None,
    target: Annotated[
        str | None,
        typer.Option(
            help="Processor level to compile for, which needs --out: "
            f"{', '.join(shipped.LEVELS)}. By default code is compiled for the "
            "processor of this machine."
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            file_okay=False, help="New folder for the machine code of --target."
        ),
    ] = None,
    jobs: Annotated[
        int, typer.Option(help="Number of processes that compile.", min=1)
    ] = os.cpu_count() or 1,
) -> None:
    """Compile scenarios in advance, so that their first reset does not have to."""
    if target is not None and target not in shipped.LEVELS:
        raise ValueError(unknown_name("target", target, list(shipped.LEVELS)))
    if (target is None) != (out is None):
        raise ValueError(
            "--target and --out need each other; give both, or none for this machine"
        )
    if out is not None and out.exists() and not (out / shipped.MANIFEST).exists():
        raise ValueError(f"--out {out}: this folder exists; give a new folder")
    names = scenarios or scenario_names()
    seats = {name: len(find_scenario(name).scene.seats) for name in names}
    # Scenarios with many seats take the longest time, so they are started first.
    names = sorted(seats, key=lambda name: -seats[name])
    profiles = profile or ["ideal"]
    work = [(n, Keywords(backend=backend, profile=p)) for n in names for p in profiles]
    if target is None or out is None:
        with _variables({shipped.VARIABLE: "0"}):
            _compile_all(work, jobs)
        return
    work += [] if scenarios else [*_images(), *_drivers()]
    given = {"NUMBA_CPU_NAME": target, "NUMBA_CPU_FEATURES": ""}
    with _variables({shipped.VARIABLE: "0", **given}):
        paths = _compile_all(work, jobs)
    out.mkdir(parents=True, exist_ok=True)
    for path in out.glob("*.code"):
        path.unlink()
    for path in paths:
        shutil.copy(path, out)
    shipped.write_manifest(out, target)


def _images() -> Iterator[tuple[str, Keywords]]:
    """Yield each scenario with keywords for images, and for a camera if it has one."""
    for name in scenario_names():
        yield name, Keywords(observe=IMAGES)
        if len(find_scenario(name).scene.seats) == 1:
            yield name, Keywords(observe=CAMERA)


def _drivers() -> Iterator[tuple[str, Keywords]]:
    """Yield a scenario with its keywords for each driver and policy of the library."""
    for name in independent_driver_names():
        if driver_class(name).needs_goal:
            yield "reach", Keywords(drivers={"paddle_0": name})
        else:
            yield "duel", Keywords(drivers={"paddle_0": name, "paddle_1": name})
    for name in zoo_names():
        scenario, keywords = as_trained({name: make_driver(name)}, None, {})
        drivers = {**keywords.get("drivers", {}), "paddle_0": name}
        yield str(scenario), {**keywords, "drivers": drivers}


@contextmanager
def _variables(values: dict[str, str]) -> Iterator[None]:
    """Set environment variables for processes that are started in this context."""
    before = dict(os.environ)
    os.environ.update(values)
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


def _compile_all(work: list[tuple[str, Keywords]], jobs: int) -> set[Path]:
    """Compile worlds in parallel processes and return the files of machine code."""
    paths: set[Path] = set()
    with (
        bar() as progress,
        ProcessPoolExecutor(min(jobs, len(work)), get_context("spawn")) as pool,
    ):
        task = progress.add_task("compiling", total=len(work), note="")
        for done in as_completed(pool.submit(_compile, *one) for one in work):
            name, found = done.result()
            paths |= found
            progress.update(task, note=name, advance=1)
    return paths


def _compile(name: str, keywords: Keywords) -> tuple[str, set[Path]]:
    compile_world(name, keywords)
    return name, used

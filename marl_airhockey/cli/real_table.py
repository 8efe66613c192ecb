"""Options of commands that play on a real table, or in the virtual lab."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from marl_airhockey.build import table_keywords
from marl_airhockey.cli.progress import waiting
from marl_airhockey.registry import REAL, zoo_names
from marl_airhockey.sim.world.keywords import Keywords

SUFFIX = "_full_size"
"""Ending of the names of policies of the zoo that were trained for the real table"""

LabOption = Annotated[
    bool,
    typer.Option(
        "--lab", help="Of --backend real: the virtual lab, started if none runs."
    ),
]
RigOption = Annotated[
    Path | None,
    typer.Option(help="Of --backend real: file of the devices and their calibration."),
]


def name_on_table(driver: str, backend: str) -> str:
    """Return the policy of the zoo that is for the real table, if one is asked for."""
    own = f"{driver}{SUFFIX}"
    return own if backend == REAL and own in zoo_names() else driver


@contextmanager
def real_table(keywords: Keywords, lab: bool, rig: Path | None) -> Iterator[Keywords]:
    """Give the keywords with what a real table needs, while its lab runs.

    Args:
        keywords: of the environment.
        lab: whether the table is the virtual lab's.
        rig: file of the devices of another.

    Raises:
        ValueError: a table without the backend, or both, or none with it.
        RuntimeError: the lab does not start.
    """
    real = keywords["backend"] == REAL
    if (lab or rig) and not real:
        raise ValueError("--lab and --rig: add --backend real")
    if not real:
        yield keywords
    else:
        with rig_of(lab, rig) as path:
            yield table_keywords({**keywords, "rig": str(path)})


@contextmanager
def rig_of(lab: bool, rig: Path | None) -> Iterator[Path]:
    """Give the file of the devices of a real table, while its lab runs.

    Args:
        lab: whether the table is the virtual lab's.
        rig: file of the devices of another.

    Raises:
        ValueError: both, or none.
        RuntimeError: the lab does not start.
    """
    if lab and rig:
        raise ValueError("--lab, --rig: one table at a time")
    if rig:
        yield rig
        return
    if not lab:
        raise ValueError("which real table? --lab, or --rig FILE")
    from marl_airhockey.hardware.calibration.lab_rig import lab_rig

    with waiting("opening the lab (longer when it is the first time)"):
        opened = lab_rig()
        path = opened.__enter__()
    try:
        yield path
    finally:
        opened.__exit__(None, None, None)

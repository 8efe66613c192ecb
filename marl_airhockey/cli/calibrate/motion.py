"""Code that is shared by the commands that move an arm to measure it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from marl_airhockey.cli.environment import rig_of
from marl_airhockey.cli.progress import bar
from marl_airhockey.hardware.rig import Rig
from marl_airhockey.sim.core.errors import require
from marl_airhockey.sim.core.seat import make_seat
from marl_airhockey.sim.core.table import TABLES
from marl_airhockey.types import Array


@contextmanager
def moving_arm(
    lab: bool, rig: Path | None, motions: int
) -> Iterator[tuple[Rig, Path, Callable[[int], None]]]:
    """Open the table of an arm and wait until its operator confirms the motions.

    Args:
        lab: True for the virtual lab.
        rig: Rig file of another table.
        motions: Number of motions, for the progress bar.

    Yields:
        Rig, its file, and a function that takes the number of completed motions.
    """
    require("rtde_control", "hardware")
    from marl_airhockey.hardware.table.operator import make_operator

    with rig_of(lab, rig) as path:
        known = Rig.load(path)
        reach = make_seat("robot", TABLES[known.table], 0).reach
        make_operator(known.operator).begin(known.motion_words(reach))
        with bar() as progress:
            task = progress.add_task("motions", total=motions, note="")
            yield known, path, lambda done: progress.update(task, completed=done)


def summarize(values: Array) -> dict[str, float]:
    """Return mean, standard deviation, minimum and maximum of values (n,)."""
    return {
        "mean": float(values.mean()),
        "sd": float(values.std()),
        "least": float(values.min()),
        "most": float(values.max()),
    }

"""Measure the rates of ticks and of images of the 3D scene, without a browser.

    python scripts/bench/scene.py --seconds 20

The loop of ticks is that of `airhockey play --backend robosuite`. A page receives every
frame of state, and a thread waits for every image, like the video of a page. For each
case the script prints the rate of ticks, the longest time between two ticks, the rate
of images, and the share of a core that each process uses.
"""

from __future__ import annotations

import asyncio
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from marl_airhockey.play.game_menu import GameMenu
from marl_airhockey.play.live_match import LiveMatch
from marl_airhockey.play.open_table import OpenTable
from marl_airhockey.play.plant import Plant
from marl_airhockey.play.scene_view import SceneView
from marl_airhockey.play.seats import Seats
from marl_airhockey.play.session import Session
from marl_airhockey.sim.world.keywords import Keywords

ROBOT: Keywords = {"backend": "robosuite", "options": {"seats": "robot"}}
CASES: list[tuple[str, str, Keywords]] = [
    ("juggle", "juggle", {"backend": "robosuite"}),
    ("strike", "strike", {"backend": "robosuite"}),
    ("duel, two arms", "duel", ROBOT),
]
"""Captions, scenarios and keywords."""


def cpu(pid: int) -> float:
    """Return the CPU-seconds that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class ShownSession(Session):
    """Session that offers every tick to a view, and starts the match again.

    Args:
        match: Match of the session.
        view: View of the 3D scene; None for none.
    """

    def __init__(self, match: LiveMatch, view: SceneView | None) -> None:
        super().__init__(OpenTable(Seats(match), None, Plant(), GameMenu()))
        self.view = self.host.scene = view
        self.ticked: list[float] = []
        """Times of the ticks, s."""

    def tick(self) -> None:
        self.ticked.append(time.perf_counter())
        if self.match.phase in ("lobby", "done"):
            self.match.start()
            self.match.time_left = 0.0  # Nothing moves during a countdown.
        super().tick()


def watch(view: SceneView, until: Callable[[], bool], times: list[float]) -> None:
    """Store the time of every image."""
    number = -1
    while not until():
        found = view.newest(number)
        if found is not None:
            number = found[0]
            times.append(time.perf_counter())


async def run(session: ShownSession, seconds: float, times: list[float]) -> list[str]:
    """Run the loop; return a row of the table."""
    loop = asyncio.create_task(session.run())
    session.connect()
    view, over = session.view, False
    watching = (
        asyncio.to_thread(watch, view, lambda: over, times)
        if view is not None
        else asyncio.sleep(0.0)
    )
    task = asyncio.ensure_future(watching)
    await asyncio.sleep(5.0)
    session.ticked.clear()
    times.clear()
    pids = [os.getpid()]
    if view is not None and view.process.pid:
        pids.append(view.process.pid)
    began, used = time.perf_counter(), [cpu(pid) for pid in pids]
    await asyncio.sleep(seconds)
    spent = time.perf_counter() - began
    shares = [(cpu(pid) - u) / spent for pid, u in zip(pids, used, strict=True)]
    row = [
        f"{len(session.ticked) / spent:.2f}",
        f"{1e3 * np.diff(session.ticked).max():.0f}",
        f"{len(times) / spent:.1f}",
        " ".join(f"{share:.0%}" for share in shares),
    ]
    over = True
    await task
    loop.cancel()
    return row


def main(
    seconds: Annotated[float, typer.Option(help="Duration of each case, s.")] = 20.0,
    images: Annotated[
        Path | None, typer.Option(help="Folder for the last image of each case.")
    ] = None,
) -> None:
    """Measure and print."""
    table = Table("case", "ticks/s", "longest ms", "images/s", "match, renderer")
    for caption, scenario, keywords in CASES:
        for shown in (False, True):
            match = LiveMatch(scenario, {}, keywords, seed=0)
            best = match.drivers.ladder[-1]
            for i in range(len(match.seats)):
                match.set_driver(i, best.driver, best.handicap)
            match.warm_up()
            view = SceneView(match) if shown else None
            row = asyncio.run(run(ShownSession(match, view), seconds, []))
            table.add_row(caption if shown else f"{caption}, no images", *row)
            if view is not None:
                last = view.newest(-1)
                if images is not None and last is not None:
                    images.mkdir(parents=True, exist_ok=True)
                    (images / f"{scenario}.jpg").write_bytes(last[1])
                if view.failure:
                    raise SystemExit(view.failure)
                view.close()
            match.close()
    Console().print(table)


if __name__ == "__main__":
    typer.run(main)

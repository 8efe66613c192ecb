"""Commands ``airhockey data`` that make recordings and datasets of others."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from marl_airhockey.cli.data.recordings import show
from marl_airhockey.cli.options import Options, console, settings
from marl_airhockey.sim.core.errors import require


def repair(
    recording: Annotated[Path, typer.Argument(help="Recording.")],
    out: Annotated[Path, typer.Option(file_okay=False, help="Folder of the new one.")],
) -> None:
    """Write the good episodes of a recording as a new one; the old one stays."""
    from marl_airhockey.data.derived import repaired

    for words in repaired(recording, out):
        console.print(f"left out: {words}", soft_wrap=True, markup=False)
    show([out], False)


def merge(
    paths: Annotated[
        list[Path], typer.Argument(help="Recordings, or folders of them.")
    ],
    out: Annotated[
        Path, typer.Option(file_okay=False, help="Folder of the new recording.")
    ],
) -> None:
    """Write recordings of one kind as one recording."""
    from marl_airhockey.data.derived import merged
    from marl_airhockey.data.files import whole_recordings_in

    merged(whole_recordings_in(paths), out)
    show([out], False)


def split(
    recording: Annotated[Path, typer.Argument(help="Recording.")],
    out: Annotated[
        Path, typer.Option(file_okay=False, help="Folder of the two: train and test.")
    ],
    test: Annotated[
        float, typer.Option(help="Fraction of the episodes that go to test.")
    ] = 0.1,
    seed: Annotated[int, typer.Option(help="Seed of the random division.")] = 0,
) -> None:
    """Divide the episodes of a recording into two, at random."""
    from marl_airhockey.data.derived import divided
    from marl_airhockey.data.files import one_recording

    show(divided(one_recording(recording), out, test, seed), False)


def relabel(
    recording: Annotated[Path, typer.Argument(help="Recording.")],
    out: Annotated[
        Path, typer.Option(file_okay=False, help="Folder of the new recordings.")
    ],
    task: Annotated[
        list[str] | None,
        typer.Option(help="Scenario, repeatable; all that fit if none is given."),
    ] = None,
    hindsight: Annotated[
        int,
        typer.Option(
            help="Copies of each episode with goals that it reached; 0 for the goals "
            "of the task.",
            min=0,
        ),
    ] = 0,
) -> None:
    """Write a recording as data of other tasks with the same bodies, by name."""
    from marl_airhockey.data.files import one_recording
    from marl_airhockey.data.hindsight import with_hindsight
    from marl_airhockey.data.relabel import fitting, relabelled
    from marl_airhockey.registry import has_goals

    recording = one_recording(recording)
    names = task or fitting(recording)
    if hindsight:
        names = task or [name for name in names if has_goals(name)]
        paths = [with_hindsight(recording, n, out / n, hindsight) for n in names]
    else:
        paths = [relabelled(recording, name, out / name) for name in names]
    show(paths, False)


def extract(
    video: Annotated[
        Path, typer.Argument(help="A video of a table, or a recording with one.")
    ],
    rig: Annotated[
        Path | None, typer.Option(help="File of the table's devices; the recording's.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(file_okay=False, help="Folder of CSV and plot; the video's own."),
    ] = None,
) -> None:
    """Find where puck and paddle were in each picture; write a CSV and a plot."""
    require("matplotlib", "train")
    from marl_airhockey.data.extract import extract as find_trajectories
    from marl_airhockey.data.plots import plot_trajectories
    from marl_airhockey.hardware.rig import Rig

    found = find_trajectories(video, Rig.load(rig) if rig else None)
    folder = out or video.parent
    folder.mkdir(parents=True, exist_ok=True)
    rows, plot = folder / f"{video.stem}.csv", folder / f"{video.stem}.png"
    found.write(rows)
    plot_trajectories(found, plot)
    for name, places in (("puck", found.puck), ("paddle", found.paddle)):
        gaps = found.gaps(places)
        longest = max((end - begin for begin, end in gaps), default=0.0)
        seen = np.isfinite(places[:, 0])
        console.print(
            f"{name}: seen in {seen.sum()} of {len(seen)} pictures, {len(gaps)} gaps, "
            f"the longest {longest:.2f} s"
        )
    console.print("files:", rows, plot, soft_wrap=True)


def export(
    paths: Annotated[
        list[Path], typer.Argument(help="Recordings, or folders of them.")
    ],
    name: Annotated[
        str, typer.Option(help="Name of the dataset: airhockey/juggle/test-v0.")
    ],
    to: Annotated[
        str, typer.Option(help="Format: minari, lerobot, hdf5 or rows.")
    ] = "minari",
    seat: Annotated[
        int,
        typer.Option(help="Seat whose steps are written; -1 for all.", min=-1),
    ] = 0,
    out: Annotated[
        Path | None,
        typer.Option(
            file_okay=False, help="Folder of all datasets; Minari's, else datasets."
        ),
    ] = None,
) -> None:
    """Write recordings as a dataset that others load without this library."""
    from marl_airhockey.data.exchange.formats import find_format
    from marl_airhockey.data.files import size_of, whole_recordings_in

    files = whole_recordings_in(paths)
    chosen = None if seat < 0 else seat
    folder = find_format(to).export(files, name, out, chosen)
    console.print(f"wrote {folder} ({size_of(folder) / 1e6:.1f} MB)", soft_wrap=True)


def import_dataset(
    source: Annotated[
        str,
        typer.Argument(
            help="Name of a Minari dataset; folder of a LeRobot dataset; or HDF5 "
            "trajectories or CSV rows t,x,y, a file or a folder of them."
        ),
    ],
    scenario: Annotated[
        str, typer.Option("--scenario", "-s", help="Scenario that it is of.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            file_okay=False, help="Folder of the recording; recordings/SOURCE."
        ),
    ] = None,
    option: Options = None,
    root: Annotated[
        Path | None,
        typer.Option(
            file_okay=False, help="Folder of all Minari datasets; Minari's own."
        ),
    ] = None,
    control_dt: Annotated[
        float,
        typer.Option(help="Time of a step, s, if the data do not give it.", min=1e-4),
    ] = 0.05,
) -> None:
    """Write a dataset of others as a recording, to learn from it or to relabel it."""
    from marl_airhockey.data.exchange.formats import import_dataset as imported
    from marl_airhockey.data.exchange.settings import ImportSettings

    folder = out or Path("recordings") / source.strip("/.").replace("/", "-")
    options = settings(option) if option else {}
    given = ImportSettings(source, scenario, folder, options, control_dt, root)
    show([imported(given)], False)


COMMANDS = (repair, merge, split, relabel, extract, export)
"""Functions of the commands but `import`, whose name is a word of Python"""

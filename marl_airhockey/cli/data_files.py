"""Commands ``airhockey data`` that make recordings and datasets of others."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from marl_airhockey.cli.data import show
from marl_airhockey.cli.options import console
from marl_airhockey.core.errors import require


def repair(
    recording: Annotated[Path, typer.Argument(help="Recording.")],
    out: Annotated[Path, typer.Option(help="Folder of the new one.")],
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
    out: Annotated[Path, typer.Option(help="Folder of the new recording.")],
) -> None:
    """Write recordings of one kind as one recording."""
    from marl_airhockey.data.derived import merged
    from marl_airhockey.data.files import recordings_in

    merged(recordings_in(paths), out)
    show([out], False)


def split(
    recording: Annotated[Path, typer.Argument(help="Recording.")],
    out: Annotated[Path, typer.Option(help="Folder of the two: train and test.")],
    test: Annotated[
        float, typer.Option(help="Fraction of the episodes that go to test.")
    ] = 0.1,
    seed: Annotated[int, typer.Option(help="Seed of the random division.")] = 0,
) -> None:
    """Divide the episodes of a recording into two, at random."""
    from marl_airhockey.data.derived import divided

    show(divided(recording, out, test, seed), False)


def relabel(
    recording: Annotated[Path, typer.Argument(help="Recording.")],
    out: Annotated[Path, typer.Option(help="Folder of the new recordings.")],
    task: Annotated[
        list[str] | None,
        typer.Option(help="Scenario, repeatable; all that fit if none is given."),
    ] = None,
) -> None:
    """Write a recording as data of other tasks with the same bodies, by name."""
    from marl_airhockey.data.relabel import fitting, relabelled

    names = task or fitting(recording)
    show([relabelled(recording, name, out / name) for name in names], False)


def convert(
    files: Annotated[
        list[Path], typer.Argument(help="Files of former versions, *.rec.")
    ],
    out: Annotated[Path, typer.Option(help="Folder of the recordings.")],
) -> None:
    """Write recordings of former versions as recordings of today."""
    from marl_airhockey.data.format_3 import convert as converted

    show([converted(path, out) for path in files], False)


def extract(
    video: Annotated[
        Path, typer.Argument(help="A video of a table, or a recording with one.")
    ],
    rig: Annotated[
        Path | None, typer.Option(help="File of the table's devices; the recording's.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder of CSV and plot; the video's own.")
    ] = None,
) -> None:
    """Find where puck and paddle were in each picture; write a CSV and a plot."""
    require("matplotlib", "train")
    from marl_airhockey.data.extract import extract as find_trajectories
    from marl_airhockey.data.plots import plot_trajectories
    from marl_airhockey.devices.rig import Rig

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
        str, typer.Option(help="Of the Minari dataset: airhockey/juggle/test-v0.")
    ],
    seat: Annotated[int, typer.Option(help="Whose steps; -1 for all, by agent.")] = 0,
    out: Annotated[
        Path | None, typer.Option(help="Folder of all datasets; Minari's own.")
    ] = None,
) -> None:
    """Write recordings as a Minari dataset, which others load without this library."""
    from marl_airhockey.data.files import recordings_in
    from marl_airhockey.data.minari_files import export_minari

    files = recordings_in(paths)
    folder = export_minari(files, name, out, None if seat < 0 else seat)
    size = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
    console.print(f"wrote {folder} ({size / 1e6:.1f} MB)", soft_wrap=True)


def import_dataset(
    name: Annotated[str, typer.Argument(help="Of a Minari dataset of one seat.")],
    scenario: Annotated[str, typer.Option("--scenario", "-s", help="That it is of.")],
    out: Annotated[Path, typer.Option(help="Folder of recordings.")] = Path(
        "recordings"
    ),
    root: Annotated[
        Path | None, typer.Option(help="Folder of all datasets; Minari's own.")
    ] = None,
    control_dt: Annotated[
        float, typer.Option(help="Time of a step, s, where it does not say.", min=1e-4)
    ] = 0.05,
) -> None:
    """Write a Minari dataset as a recording, to learn from it."""
    from marl_airhockey.data.minari_files import import_minari

    show([import_minari(name, scenario, out, control_dt, root)], False)


COMMANDS = (repair, merge, split, convert, relabel, extract, export)
"""Functions of the commands but `import`, whose name is a word of Python"""

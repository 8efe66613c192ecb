"""Commands ``airhockey data`` that convert recordings and datasets."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from marl_airhockey.cli.data.recordings import show
from marl_airhockey.cli.options import Options, console, settings
from marl_airhockey.sim.core.errors import require


def repair(
    recording: Annotated[Path, typer.Argument(help="Folder of a recording.")],
    out: Annotated[
        Path, typer.Option(file_okay=False, help="Folder of the new recording.")
    ],
) -> None:
    """Write the intact episodes of a recording as a new recording.

    The old recording is not changed.
    """
    from marl_airhockey.data.derived import repaired

    for words in repaired(recording, out):
        console.print(f"left out: {words}", soft_wrap=True, markup=False)
    show([out], False)


def merge(
    paths: Annotated[
        list[Path],
        typer.Argument(
            help="Recordings, folders of recordings, or names of built datasets."
        ),
    ],
    out: Annotated[
        Path, typer.Option(file_okay=False, help="Folder of the new recording.")
    ],
) -> None:
    """Merge recordings of the same environment into one recording."""
    from marl_airhockey.data.derived import merged
    from marl_airhockey.data.files import whole_recordings_in

    merged(whole_recordings_in(paths), out)
    show([out], False)


def split(
    recording: Annotated[Path, typer.Argument(help="Folder of a recording.")],
    out: Annotated[
        Path,
        typer.Option(
            file_okay=False,
            help="Folder of the two new recordings, which are named train and test.",
        ),
    ],
    test: Annotated[
        float,
        typer.Option(help="Fraction of the episodes in the recording test, 0..1."),
    ] = 0.1,
    seed: Annotated[int, typer.Option(help="Seed of the random split.")] = 0,
) -> None:
    """Split the episodes of a recording at random into train and test."""
    from marl_airhockey.data.derived import divided
    from marl_airhockey.data.files import one_recording

    show(divided(one_recording(recording), out, test, seed), False)


def relabel(
    recording: Annotated[Path, typer.Argument(help="Folder of a recording.")],
    out: Annotated[
        Path, typer.Option(file_okay=False, help="Folder of the new recordings.")
    ],
    task: Annotated[
        list[str] | None,
        typer.Option(
            help="Name of the new scenario; by default all fitting scenarios. Can be "
            "repeated."
        ),
    ] = None,
    hindsight: Annotated[
        int,
        typer.Option(
            help="Number of copies of each episode whose goals are replaced by goals "
            "that it reached; 0 keeps the goals of the task.",
            min=0,
        ),
    ] = 0,
) -> None:
    """Write a recording as data of other scenarios with the same bodies.

    Rewards, success and observations are computed again for each scenario. The new
    recordings have the names of the scenarios.
    """
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
        Path,
        typer.Argument(help="Video of a table, or folder of a recording with one."),
    ],
    rig: Annotated[
        Path | None,
        typer.Option(help="Rig file of the table; by default that of the recording."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            file_okay=False,
            help="Folder of the CSV file and the plot; by default that of the video.",
        ),
    ] = None,
) -> None:
    """Detect puck and paddle in each frame of a video; write a CSV file and a plot."""
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
            f"{name}: seen in {seen.sum()} of {len(seen)} frames, {len(gaps)} gaps, "
            f"the longest {longest:.2f} s"
        )
    console.print("files:", rows, plot, soft_wrap=True)


def export(
    paths: Annotated[
        list[Path],
        typer.Argument(
            help="Recordings, folders of recordings, or names of built datasets."
        ),
    ],
    name: Annotated[
        str,
        typer.Option(
            help="Name of the new dataset, for example airhockey/juggle/test-v0."
        ),
    ],
    to: Annotated[
        str, typer.Option(help="Format: minari, lerobot, hdf5 or rows.")
    ] = "minari",
    seat: Annotated[
        int,
        typer.Option(
            help="Index of the seat whose steps are written; -1 for all seats.", min=-1
        ),
    ] = 0,
    out: Annotated[
        Path | None,
        typer.Option(
            file_okay=False,
            help="Folder of all datasets; by default Minari's own folder for minari, "
            "else datasets.",
        ),
    ] = None,
    images: Annotated[
        bool,
        typer.Option(
            "--images",
            help="Render an image of the table for each step, and leave out the true "
            "state; for lerobot.",
        ),
    ] = False,
) -> None:
    """Export recordings as a dataset that can be loaded without this library."""
    from marl_airhockey.data.exchange.formats import find_format
    from marl_airhockey.data.exchange.lerobot import export_lerobot
    from marl_airhockey.data.files import size_of, whole_recordings_in

    files = whole_recordings_in(paths)
    chosen = None if seat < 0 else seat
    if images and to != "lerobot":
        raise ValueError(f"--images: {to} has no images; use --to lerobot")
    if images:
        folder = export_lerobot(files, name, out, chosen, images=True)
    else:
        folder = find_format(to).export(files, name, out, chosen)
    console.print(f"wrote {folder} ({size_of(folder) / 1e6:.1f} MB)", soft_wrap=True)


def import_dataset(
    source: Annotated[
        str,
        typer.Argument(
            help="Name of a Minari dataset; folder of a LeRobot dataset; file or "
            "folder of HDF5 trajectories, or of CSV rows t,x,y (s, m); or games "
            "that the page without a server has saved (.airhockey)."
        ),
    ],
    scenario: Annotated[
        str | None,
        typer.Option(
            "--scenario",
            "-s",
            help="Name of the scenario to which the data belong; not for saved games.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            file_okay=False,
            help="Folder of the new recording; by default recordings/SOURCE.",
        ),
    ] = None,
    option: Options = None,
    root: Annotated[
        Path | None,
        typer.Option(
            file_okay=False,
            help="Folder of all Minari datasets; by default Minari's own folder.",
        ),
    ] = None,
    control_dt: Annotated[
        float,
        typer.Option(
            help="Time of a step, s, for data that do not contain it.", min=1e-4
        ),
    ] = 0.05,
) -> None:
    """Import a dataset of another library, or saved games, as a recording.

    Saved games are played again. If a state differs, nothing is written.
    """
    from marl_airhockey.data.exchange.formats import import_dataset as imported
    from marl_airhockey.data.exchange.settings import ImportSettings
    from marl_airhockey.data.saved_games import SUFFIX, import_games

    folder = out or Path("recordings") / source.strip("/.").replace("/", "-")
    if source.endswith(SUFFIX):
        if scenario is not None or option:
            raise ValueError(f"{source}: saved games need no --scenario or --option")
        show([import_games(Path(source), folder)], False)
        console.print("the hash of the file agrees with the replay")
        return
    if scenario is None:
        raise ValueError(f"{source}: give the scenario with --scenario")
    options = settings(option) if option else {}
    given = ImportSettings(source, scenario, folder, options, control_dt, root)
    show([imported(given)], False)


COMMANDS = (repair, merge, split, relabel, extract, export)
"""Functions of all commands except `import`, which is a keyword of Python."""

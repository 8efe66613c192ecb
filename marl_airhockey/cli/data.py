"""Commands ``airhockey data``: ``record``, ``info``, ``extract``, ``export``..."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.table import Table

from marl_airhockey.cli.options import (
    AsJson,
    Backend,
    Drivers,
    Options,
    Profile,
    Trusting,
    as_trained_unless_given,
    console,
    environment,
)
from marl_airhockey.cli.options import Scenario as ScenarioOption
from marl_airhockey.cli.real_table import (
    LabOption,
    RigOption,
    name_on_table,
    real_table,
)
from marl_airhockey.core.errors import require
from marl_airhockey.registry import DEFAULT_BACKEND, make_agent

data = typer.Typer(
    help="Recordings: make them, look into them, sum them up.", no_args_is_help=True
)


@data.command()
def record(
    driver: Annotated[str, typer.Argument(help="A driver's name or a policy's path.")],
    scenario: ScenarioOption = None,
    episodes: Annotated[int, typer.Option(help="How many.", min=1)] = 100,
    out: Annotated[Path, typer.Option(help="Folder of the recordings.")] = Path(
        "recordings"
    ),
    seed: Annotated[int, typer.Option(help="Of the first episode.")] = 0,
    observe: Annotated[
        str | None, typer.Option(help="Form of the observations that are kept.")
    ] = None,
    film: Annotated[
        bool, typer.Option("--film", help="Keep a real table's pictures beside it.")
    ] = False,
    backend: Backend = DEFAULT_BACKEND,
    profile: Profile = None,
    option: Options = None,
    other: Drivers = None,
    lab: LabOption = False,
    rig: RigOption = None,
    trust: Trusting = False,
    as_json: AsJson = False,
) -> None:
    """Let a driver play and record it: states, observations, actions, rewards."""
    from marl_airhockey.data.record import record_episodes

    keywords = environment(backend, profile, option, other)
    name = name_on_table(driver, backend)
    game, keywords, players = as_trained_unless_given(
        {name: make_agent(name)}, scenario, keywords, as_json
    )
    player = players[name]
    if observe is not None:
        keywords["observe"] = observe
    with real_table(keywords, lab, rig) as table:
        path = record_episodes(player, name, game, episodes, out, seed, table, film)
    _show([path], as_json)


@data.command()
def info(
    paths: Annotated[
        list[Path], typer.Argument(help="Recordings, or folders of them.")
    ],
    as_json: AsJson = False,
) -> None:
    """Say what recordings hold; a file that cannot be read is named and skipped."""
    from marl_airhockey.data.files import recordings_in

    _show(recordings_in(paths), as_json)


def _show(files: list[Path], as_json: bool) -> None:
    """Print a row for each recording.

    Raises:
        ValueError: none of them can be read.
    """
    from marl_airhockey.data.summary import Summary, summarize_recording

    found: list[Summary] = []
    broken: list[str] = []
    for path in files:
        try:
            found.append(summarize_recording(path))
        except ValueError as error:
            broken.append(str(error))
    if as_json:
        rows = [summary.to_json() for summary in found]
        console.print_json(json.dumps({"recordings": rows, "broken": broken}))
    elif found:
        table = Table()
        table.add_column("file", overflow="fold", min_width=10)
        for name in ("scenario", "profile", "who", "episodes", "steps"):
            table.add_column(name, overflow="fold")
        for name in ("success", "return", "MB"):
            table.add_column(name, justify="right")
        for summary in found:
            table.add_row(*summary.row())
        console.print(table)
    if not found:
        raise ValueError("; ".join(broken))
    if not as_json:
        for words in broken:
            console.print(f"skipped: {words}", soft_wrap=True, markup=False)


@data.command()
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


@data.command()
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


@data.command(name="import")
def import_dataset(
    name: Annotated[str, typer.Argument(help="Of a Minari dataset of one seat.")],
    scenario: Annotated[str, typer.Option("--scenario", "-s", help="That it is of.")],
    out: Annotated[Path, typer.Option(help="Folder of the recording.")] = Path(
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

    _show([import_minari(name, scenario, out, control_dt, root)], False)


@data.command()
def report(
    folder: Annotated[Path, typer.Argument(help="Of recordings.")],
    out: Annotated[
        Path | None, typer.Option(help="Folder of the report; the recordings' own.")
    ] = None,
    scenario: Annotated[
        str | None, typer.Option("--scenario", "-s", help="Of this one alone.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Summarize recordings: results, reactions, shots, limits, a study's answers."""
    require("matplotlib", "train")
    from marl_airhockey.play.plots import plot_report
    from marl_airhockey.play.report import summarize
    from marl_airhockey.study.answers import read_answers

    found, answers = summarize(folder, scenario), read_answers(folder)
    files = found.save(out or folder)
    plot = (out or folder) / "report.png"
    plot_report(found, plot)
    files.append(plot)
    if answers.participants:
        files += answers.save(out or folder)
    if as_json:
        console.print_json(files[0].read_text())
        return
    for path in files:
        if path.suffix == ".md":
            console.print(path.read_text(), markup=False, soft_wrap=True)
    console.print("files:", *files, soft_wrap=True)

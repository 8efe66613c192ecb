"""Commands ``airhockey data`` that write, check and summarize recordings."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.box import SIMPLE
from rich.table import Table

from marl_airhockey.cli.environment import EnvironmentOptions, in_environment
from marl_airhockey.cli.options import AsJson, console
from marl_airhockey.cli.options import Scenario as ScenarioOption
from marl_airhockey.cli.progress import bar
from marl_airhockey.sim.core.errors import require

data = typer.Typer(
    help="Write, check, convert and summarize recordings and datasets.",
    no_args_is_help=True,
)


@data.command()
@in_environment
def record(
    name: Annotated[
        str,
        typer.Argument(metavar="DRIVER", help="Name of a driver, or path of a policy."),
    ],
    environment: EnvironmentOptions,
    scenario: ScenarioOption = None,
    episodes: Annotated[int, typer.Option(help="Number of episodes.", min=1)] = 100,
    out: Annotated[
        Path | None,
        typer.Option(
            file_okay=False,
            help="Folder of the recording; by default recordings/TIME-SCENARIO.",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the first episode.")] = 0,
    film: Annotated[
        bool,
        typer.Option(
            "--record-video", help="Record the video of a real table's camera."
        ),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Record episodes of a driver: states, observations, actions and rewards.

    With --out, an interrupted recording is resumed.
    """
    from marl_airhockey.data.files import new_recording
    from marl_airhockey.data.record import record_episodes

    name, driver, game, keywords = environment.one_driver(name, scenario, as_json)
    path = out or new_recording(Path("recordings"), game)
    with environment.table(keywords) as table, bar() as shown:
        task = shown.add_task("recording", total=episodes, note="")

        def count(done: float) -> None:
            shown.update(task, completed=done)

        record_episodes(driver, name, game, episodes, path, seed, table, film, count)
    show([path], as_json)


@data.command()
def info(
    paths: Annotated[
        list[Path],
        typer.Argument(
            help="Recordings, folders of recordings, or names of built datasets."
        ),
    ],
    as_json: AsJson = False,
) -> None:
    """Summarize the content of recordings; unreadable files are skipped."""
    from marl_airhockey.data.files import recordings_in

    show(recordings_in(paths), as_json)


def show(paths: list[Path], as_json: bool) -> None:
    """Print a row for each recording.

    Raises:
        ValueError: None of the recordings can be read.
    """
    from marl_airhockey.data.summary import Summary, summarize_recording

    found: list[Summary] = []
    broken: list[str] = []
    for path in paths:
        try:
            found.append(summarize_recording(path))
        except ValueError as error:
            broken.append(str(error))
    if as_json:
        rows = [summary.to_json() for summary in found]
        console.print_json(json.dumps({"recordings": rows, "broken": broken}))
    elif found:
        table = Table(box=SIMPLE, pad_edge=False)
        for name in ("recording", "scenario", "players", "episodes"):
            table.add_column(name, overflow="fold")
        for name in ("steps", "success", "return", "MB"):
            table.add_column(name, justify="right", no_wrap=True)
        for summary in found:
            table.add_row(*summary.row())
        console.print(table)
    if not found:
        raise ValueError("; ".join(broken))
    if not as_json:
        for words in broken:
            console.print(f"skipped: {words}", soft_wrap=True, markup=False)


@data.command()
def plot(
    paths: Annotated[
        list[Path],
        typer.Argument(
            help="Recordings, folders of recordings, or names of built datasets."
        ),
    ],
    out: Annotated[Path, typer.Option(help="PNG file to write.")] = Path(
        "recordings.png"
    ),
) -> None:
    """Plot returns, lengths, positions, speeds, gaps and players of recordings."""
    require("matplotlib", "train")
    from marl_airhockey.data.content_plot import plot_content
    from marl_airhockey.data.files import recordings_in

    plot_content(recordings_in(paths), out)
    console.print(f"wrote {out}", soft_wrap=True)


@data.command()
def check(
    paths: Annotated[
        list[Path],
        typer.Argument(
            help="Recordings, folders of recordings, or names of built datasets."
        ),
    ],
    replay: Annotated[
        bool,
        typer.Option(
            "--replay",
            help="Compute rewards, success and observations from the recorded states, "
            "and compare them with the recorded values.",
        ),
    ] = False,
) -> None:
    """Read recordings completely and list all faults.

    The exit status is 1 if there is a fault.
    """
    from marl_airhockey.data.files import recordings_in
    from marl_airhockey.data.film import episodes_without_film
    from marl_airhockey.data.reader import episodes_of, missing_steps
    from marl_airhockey.data.verify import EXACT, replay_differences

    count = 0
    wrong: list[str] = []
    for path in recordings_in(paths):
        try:
            cut = missing_steps(path)
            filmed = episodes_of(path, ("frame",), bad=[])
            cut |= episodes_without_film(path, filmed)
            count += sum(e.index not in cut for e in episodes_of(path, bad=wrong))
            wrong += cut.values()
            found = replay_differences(path) if replay else {}
        except ValueError as error:
            wrong.append(str(error))
            continue
        wrong += [
            f"{path}: {name} differs by {off:.3g} from the value of the recorded states"
            for name, off in sorted(found.items())
            if off > EXACT
        ]
        if replay:
            largest = max(found.values(), default=0.0)
            words = f"{path}: replayed, largest difference {largest:.1e}"
            console.print(words, soft_wrap=True, markup=False)
    for words in wrong:
        console.print(words, soft_wrap=True, markup=False)
    console.print(f"{count} good episodes, {len(wrong)} faults")
    if wrong:
        raise typer.Exit(1)


@data.command()
def report(
    folder: Annotated[Path, typer.Argument(help="Folder of recordings.")],
    out: Annotated[
        Path | None,
        typer.Option(
            file_okay=False,
            help="Folder of the report; by default the folder of the recordings.",
        ),
    ] = None,
    scenario: Annotated[
        str | None,
        typer.Option(
            "--scenario",
            "-s",
            help="Scenario of the recordings to use; required if there are several.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Summarize recordings of games by player, and the answers of a study.

    The report has score, Elo rating, shots, time at the limits and round trips, with
    95 % intervals.
    """
    require("matplotlib", "train")
    from marl_airhockey.play.plots import plot_report
    from marl_airhockey.play.report import summarize
    from marl_airhockey.play.study.answers import read_answers
    from marl_airhockey.play.study.tables import save

    found, answers = summarize(folder, scenario), read_answers(folder)
    files = found.save(out or folder)
    plot = (out or folder) / "report.png"
    plot_report(found, plot)
    files.append(plot)
    if answers.participants:
        files += save(answers, out or folder)
    if as_json:
        console.print_json(files[0].read_text())
        return
    for path in files:
        if path.suffix == ".md":
            console.print(path.read_text(), markup=False, soft_wrap=True)
    for words in found.skipped:
        console.print(f"skipped: {words}", soft_wrap=True, markup=False)
    console.print("files:", *files, soft_wrap=True)

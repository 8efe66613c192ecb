"""Commands ``airhockey data`` that make recordings and look into them."""

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
    help="Recordings: make them, look into them, sum them up.", no_args_is_help=True
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
            file_okay=False, help="Folder of the recording; recordings/TIME-SCENARIO."
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
    """Let a driver play and record it: states, observations, actions, rewards.

    With --out, a recording that was interrupted is resumed.
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
        list[Path], typer.Argument(help="Recordings, or folders of them.")
    ],
    as_json: AsJson = False,
) -> None:
    """Say what recordings hold; a file that cannot be read is named and skipped."""
    from marl_airhockey.data.files import recordings_in

    show(recordings_in(paths), as_json)


def show(paths: list[Path], as_json: bool) -> None:
    """Print a row for each recording.

    Raises:
        ValueError: none of them can be read.
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
        list[Path], typer.Argument(help="Recordings, or folders of them.")
    ],
    out: Annotated[Path, typer.Option(help="Picture, PNG.")] = Path("recordings.png"),
) -> None:
    """Plot returns, lengths, places, speeds, gaps and players of recordings."""
    require("matplotlib", "train")
    from marl_airhockey.data.content_plot import plot_content
    from marl_airhockey.data.files import recordings_in

    plot_content(recordings_in(paths), out)
    console.print(f"wrote {out}", soft_wrap=True)


@data.command()
def check(
    paths: Annotated[
        list[Path], typer.Argument(help="Recordings, or folders of them.")
    ],
    replay: Annotated[
        bool,
        typer.Option(
            "--replay",
            help="Compute rewards, success and observations again, and compare them.",
        ),
    ] = False,
) -> None:
    """Read all of recordings and name what is wrong; exit 1 if anything is."""
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
            f"{path}: {name} differs by {off:.3g} from what its states give today"
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
    folder: Annotated[Path, typer.Argument(help="Of recordings.")],
    out: Annotated[
        Path | None,
        typer.Option(
            file_okay=False, help="Folder of the report; the recordings' own."
        ),
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

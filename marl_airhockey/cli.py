"""The command line: ``airhockey list | train | evaluate | watch | play | league``..."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from marl_airhockey import cli_games, cli_play, cli_study, cli_transfer
from marl_airhockey.catalogue import describe, summary
from marl_airhockey.cli_common import (
    AsJson,
    Backend,
    Drivers,
    Options,
    Physics,
    Profile,
    Scenario,
    Workers,
    app,
    bar,
    console,
    environment,
    grade,
    settings,
    train_shown,
)
from marl_airhockey.extras import need
from marl_airhockey.learn.policy import Policy
from marl_airhockey.match import TEST_SEED, Result, evaluate
from marl_airhockey.physics import load_physics
from marl_airhockey.registry import make_driver

FLOORS = ("still", "random", "sticky")
app.command()(cli_games.league)
app.command()(cli_play.play)
app.command()(cli_transfer.transfer)
app.command()(cli_transfer.fit)
record = typer.Typer(help="Recordings of play.", no_args_is_help=True)
record.command()(cli_play.report)
app.add_typer(record, name="record")
app.add_typer(cli_study.study, name="study")


@app.command("list")
def list_scenarios(
    scenario: Annotated[str | None, typer.Argument(help="Describe this one.")] = None,
    as_json: AsJson = False,
) -> None:
    """List scenarios, drivers and backends, or describe one scenario."""
    if scenario is None:
        data = summary()
        if as_json:
            console.print_json(json.dumps(data))
            return
        table = Table("scenario", "what", "seats", "seconds")
        for row in data["scenarios"]:
            table.add_row(*(str(row[k]) for k in ("name", "what", "seats", "seconds")))
        console.print(table)
        console.print("drivers: ", ", ".join(data["drivers"]))
        console.print("zoo:     ", ", ".join(data["zoo"]))
        console.print("backends:", ", ".join(data["backends"]))
        return
    data = describe(scenario)
    if as_json:
        console.print_json(json.dumps(data))
        return
    console.print(f"[bold]{scenario}[/bold]  {data['id']}\n{data['what']}\n")
    for title in ("seats", "observation", "reward", "options"):
        table = Table(*data[title][0], title=title, title_justify="left")
        for row in data[title]:
            table.add_row(*(str(v) for v in row.values()))
        console.print(table)


@app.command()
def train(
    scenario: Annotated[str, typer.Argument(help="Name of a scenario.")] = "",
    seed: Annotated[int, typer.Option(help="Seed of worlds and network.")] = 0,
    backend: Backend = "batched",
    profile: Profile = "ideal",
    steps: Annotated[int | None, typer.Option(help="Steps of single worlds.")] = None,
    hidden: Annotated[
        int | None, typer.Option(help="Units of both layers; the paper's size is 256.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the run.")] = None,
    engine: Annotated[
        str | None, typer.Option(help="sb3 in this process (usual), rllib over many.")
    ] = None,
    num_env_runners: Annotated[
        int | None, typer.Option(help="Of rllib: processes that step the worlds.")
    ] = None,
    init: Annotated[
        Path | None, typer.Option(help="Begin with the weights of this run.")
    ] = None,
    change: Annotated[
        list[str] | None,
        typer.Option("--set", help="A setting of the preset, NAME=VALUE; repeatable."),
    ] = None,
    option: Options = None,
    other: Drivers = None,
    physics: Physics = None,
    resume: Annotated[Path | None, typer.Option(help="Go on with this run.")] = None,
    num_workers: Workers = None,
    as_json: AsJson = False,
) -> None:
    """Train a policy with PPO and its preset; SCENARIO or --resume is needed."""
    from marl_airhockey.learn.config import preset

    if resume is None:
        changes = settings(change) | {
            "seed": seed,
            "backend": backend,
            "profile": profile,
            "options": settings(option),
            "drivers": settings(other),
        }
        if physics is not None:
            changes["physics"] = load_physics(physics)
        if steps is not None:
            changes["total_steps"] = steps
        if hidden is not None:
            changes["hidden"] = [hidden, hidden]
        if init is not None:
            changes["init"] = str(init)
        if engine is not None:
            changes["engine"] = engine
        if num_env_runners is not None:
            changes["num_env_runners"] = num_env_runners
        config = preset(scenario, changes)
        folder = out or Path("runs") / f"{scenario}-{seed}"
    else:
        given = (scenario, change, option, other, steps, hidden, out, engine)
        if any(given) or any(x is not None for x in (num_env_runners, init, physics)):
            raise ValueError("--resume goes on as the run was begun: give nothing else")
        config, folder = None, resume
    row = train_shown(config, folder)
    if as_json:
        console.print_json(json.dumps({"run": str(folder), **row}))
        return
    console.print(
        f"{folder}: {grade(row)} {row[grade(row)]:.3f} after {row['steps']:,.0f} steps "
        f"and {row['cpu_seconds'] / 60:.1f} CPU-minutes"
    )
    name = scenario or "SCENARIO"
    console.print(f"next: airhockey evaluate {folder} --scenario {name}")


@app.command()
def export(
    run: Annotated[Path, typer.Argument(help="Folder of a training run.")],
    out: Annotated[Path, typer.Option(help="The file to write.")] = Path("policy.npz"),
) -> None:
    """Freeze a trained policy into one small file with a card, measured anew."""
    need("stable_baselines3", "train")
    from marl_airhockey.learn.export import export as freeze

    console.print_json(json.dumps(dict(freeze(run, out).card)))
    console.print(f"{out}: {out.stat().st_size / 1000:.0f} kB")


@app.command("evaluate")
def evaluate_driver(
    driver: Annotated[str, typer.Argument(help="A driver's name or a policy's path.")],
    scenario: Scenario,
    backend: Backend = "pymunk",
    profile: Profile = "ideal",
    episodes: Annotated[int, typer.Option(help="How many.")] = 200,
    seed: Annotated[int, typer.Option(help="Of the first episode.")] = TEST_SEED,
    option: Options = None,
    other: Drivers = None,
    physics: Physics = None,
    floors: Annotated[bool, typer.Option(help="still, random, sticky too.")] = True,
    num_workers: Workers = None,
    as_json: AsJson = False,
) -> None:
    """Measure a driver over episodes that training never sees."""
    keywords = environment(backend, profile, option, other, physics)
    if episodes < 1:
        raise ValueError(f"--episodes: {episodes} must be at least 1")
    seated = make_driver(driver)
    entries = [(driver, seated)]
    if isinstance(seated, Policy):
        sampled = replace(seated, deterministic=False)
        entries.append((f"{driver} (sampled)", sampled))
    if floors:
        entries += [(f, make_driver(f)) for f in FLOORS if f != driver]
    results: list[Result] = []
    with bar() as progress:
        task = progress.add_task(scenario, total=len(entries), note="")
        for name, entry in entries:
            progress.update(task, note=name)
            results.append(evaluate(entry, name, scenario, episodes, seed, keywords))
            progress.advance(task)
    if as_json:
        main_result = results[0].to_json()
        for result in results[1:]:
            key = "sampled" if "(sampled)" in result.driver else result.driver
            main_result.setdefault("beside", {})[key] = result.to_json()
        console.print_json(json.dumps(main_result))
        return
    console.print(result_table(results))


def result_table(results: list[Result]) -> Table:
    """Results side by side, one column a driver."""
    first = results[0]
    table = Table(
        title=f"{first.scenario} on {first.backend}, {first.profile} profile, "
        f"{first.episodes} episodes",
    )
    table.add_column("")
    for result in results:
        table.add_column(result.driver, justify="right")
    lines: dict[str, Callable[[Result], str]] = {
        "success": lambda r: f"{r.success:.3f}",
        "  95 % from": lambda r: f"{r.success_interval[0]:.3f}",
        "  95 % to": lambda r: f"{r.success_interval[1]:.3f}",
        "first-shot success": lambda r: f"{r.first_shot:.3f}",
        "return": lambda r: f"{r.returns:.2f}",
        "  interquartile": lambda r: f"{r.returns_iqm:.2f}",
        "  95 % from ": lambda r: f"{r.returns_interval[0]:.2f}",
        "  95 % to ": lambda r: f"{r.returns_interval[1]:.2f}",
        "control steps": lambda r: f"{r.length:.0f}",
        "touches": lambda r: f"{r.hits:.1f}",
        "violations a minute": lambda r: f"{r.deployability.violations_per_minute:.0f}",
        "jerk, m/s3": lambda r: f"{r.deployability.jerk:.0f}",
        "power above 5 Hz": lambda r: f"{r.deployability.power_above_5hz:.2f}",
        "ms an action": lambda r: f"{r.deployability.act_ms:.2f}",
        "deployability": lambda r: r.deployability.grade,
    }
    for name, line in lines.items():
        table.add_row(name, *(line(result) for result in results))
    return table


@app.command()
def watch(
    driver: Annotated[
        str, typer.Argument(help="A driver's name, a policy's path, or a recording.")
    ],
    scenario: Annotated[
        str, typer.Option("--scenario", "-s", help="What the driver plays.")
    ] = "",
    backend: Backend = "pymunk",
    profile: Profile = "ideal",
    seed: Annotated[int, typer.Option(help="Of the first episode.")] = 0,
    episodes: Annotated[int, typer.Option(help="How many.")] = 1,
    video: Annotated[
        Path | None, typer.Option(help="Write a .gif or .mp4 instead of a window.")
    ] = None,
    option: Options = None,
    other: Drivers = None,
    camera: Annotated[
        str, typer.Option(help="top, or a camera of the backend: agentview...")
    ] = "top",
    host: cli_play.Host = "127.0.0.1",
    port: cli_play.Port = 0,
    browser: cli_play.Browser = True,
) -> None:
    """Watch a driver play, in a window or as a video; or a recording of play.

    --host, --port and --browser are those of a recording's page.
    """
    from marl_airhockey.film import film

    if driver.endswith(".jsonl"):
        if video is None:
            cli_play.show(Path(driver), host, port, browser)
        else:
            watch_recording(Path(driver), video)
        return
    if any(Path(driver).glob("*.jsonl")):
        raise ValueError(f"{driver}: holds recordings; name one of its .jsonl files")
    if not scenario:
        raise ValueError("--scenario: say what the driver is to play")
    keywords = environment(backend, profile, option, other)
    player = make_driver(driver)
    film(scenario, player, keywords, seed, episodes, video, camera=camera)
    if video is not None:
        console.print(f"wrote {video} ({video.stat().st_size // 1000} kB)")


def watch_recording(recording: Path, video: Path) -> None:
    """Make a video of a recording."""
    from marl_airhockey.play.film import film

    film(recording, video)
    console.print(f"wrote {video} ({video.stat().st_size // 1000} kB)")


@app.command("bench")
def bench_environments(
    scenario: Annotated[str, typer.Option(help="Comma-separated.")] = "juggle",
    backend: Annotated[str, typer.Option(help="Comma-separated.")] = "batched,pymunk",
    worlds: Annotated[
        str, typer.Option(help="Comma-separated; 0 is the PettingZoo dict environment.")
    ] = "0,1,64,1024,4096",
    rounds: Annotated[int, typer.Option(help="Turns.")] = 3,
    seconds: Annotated[float, typer.Option(help="CPU-seconds of a turn.")] = 1.0,
    out: Annotated[Path | None, typer.Option(help="Draw a PNG here.")] = None,
    num_workers: Workers = None,
    as_json: AsJson = False,
) -> None:
    """Measure env-steps per second, of CPU and of time."""
    from marl_airhockey.bench import Case, measure, picture

    try:
        numbers = [int(n) for n in worlds.split(",")]
    except ValueError:
        raise ValueError(f"--worlds: {worlds!r} must be numbers and commas") from None
    if min(numbers) < 0 or rounds < 1 or seconds <= 0:
        raise ValueError("--worlds, --rounds and --seconds must not be negative or 0")
    cases = [
        Case(s, b, n)
        for s in scenario.split(",")
        for b in backend.split(",")
        for n in numbers
    ]
    with bar() as progress:
        task = progress.add_task("measuring", total=rounds * len(cases), note="")
        rates = measure(cases, rounds, seconds, lambda: progress.advance(task))
    if out is not None:
        need("matplotlib", "train")
        picture(rates, out)
    if as_json:
        console.print_json(json.dumps([rate.to_json() for rate in rates]))
        return
    table = Table(
        title=f"{rounds} turns of {seconds} CPU-s, {rates[0].threads} threads"
    )
    for name in ("scenario", "backend", ""):
        table.add_column(name)
    for name in ("env-steps per CPU-s", "agent-steps per CPU-s", "per s", "spread"):
        table.add_column(name, justify="right")
    for rate in rates:
        speeds = (rate.env_steps_per_cpu_s, rate.agent_steps_per_cpu_s)
        table.add_row(
            rate.case.scenario,
            rate.case.backend,
            rate.case.name,
            *(f"{speed:,.0f}" for speed in (*speeds, rate.env_steps_per_s)),
            f"{rate.spread:.0%}",
        )
    console.print(table)
    if out is not None:
        console.print(f"wrote {out}")


@app.command()
def demo(
    out: Annotated[Path, typer.Option(help="Folder for what it makes.")] = Path(
        "runs/demo"
    ),
    scenario: Annotated[str, typer.Option(help="What to learn.")] = "juggle",
    steps: Annotated[int | None, typer.Option(help="Steps of single worlds.")] = None,
) -> None:
    """Train a paddle to juggle, measure it, and show what it learned."""
    need("stable_baselines3", "train")
    from marl_airhockey.learn.demo import run

    with bar() as progress:
        task = progress.add_task(f"learning to {scenario}", total=None, note="")

        def report(done: int, total: int, row: dict[str, float]) -> None:
            name = grade(row)
            note = f"{name} {row[name]:.2f}" if row else ""
            progress.update(task, completed=done, total=total, note=note)

        results, files = run(scenario, out, steps, report)
    console.print(result_table(results))
    for what, path in files.items():
        console.print(f"{what:>16}: {path}")
    console.print(
        "\ntry next:\n"
        f"  airhockey watch {out / 'run'} --scenario {scenario}\n"
        "  airhockey train hit_goal && airhockey evaluate runs/hit_goal-0 -s hit_goal\n"
        "  airhockey list"
    )


def main() -> None:
    """Run the command line; bad input gives one line and exit status 1."""
    try:
        app()
    except (ValueError, RuntimeError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(1)


if __name__ == "__main__":
    main()

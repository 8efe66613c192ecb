"""Commands ``airhockey transfer | fit``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from marl_airhockey.cli.options import (
    AsJson,
    Options,
    Physics,
    Trusting,
    Workers,
    console,
    physics_of,
    settings,
    train_with_progress,
)
from marl_airhockey.cli.progress import bar, waiting
from marl_airhockey.contracts.driver import Driver
from marl_airhockey.core.errors import require, unknown_name
from marl_airhockey.core.parameters import PARAMETERS
from marl_airhockey.core.profiles import PROFILES, find_profile
from marl_airhockey.core.table import TABLES
from marl_airhockey.policies.trust import require_trust
from marl_airhockey.registry import find_backend, find_scenario, make_agent
from marl_airhockey.world.build import Keywords

if TYPE_CHECKING:
    from marl_airhockey.learn.ppo_config import PPOConfig
    from marl_airhockey.transfer.measure import TransferResult


def transfer(
    scenario: Annotated[str, typer.Argument(help="Name of a scenario.")],
    policy: Annotated[
        list[str] | None,
        typer.Option(
            help="A policy or run; repeatable. None: two are trained in --out, one "
            "in each profile, unless they are there."
        ),
    ] = None,
    to: Annotated[
        str, typer.Option(help="Backends, comma-separated.")
    ] = "numba,pymunk,robosuite",
    profile: Annotated[
        str, typer.Option(help="Profiles, comma-separated.")
    ] = "ideal,ur5e",
    episodes: Annotated[int, typer.Option(help="Of each.", min=1)] = 200,
    fine_tune: Annotated[
        int,
        typer.Option(help="Steps by which runs are trained on, on robosuite.", min=0),
    ] = 0,
    seed: Annotated[int, typer.Option(help="Of training.")] = 0,
    out: Annotated[
        Path | None, typer.Option(help="Folder of runs and results.")
    ] = None,
    option: Options = None,
    num_workers: Workers = None,
    trust: Trusting = False,
    as_json: AsJson = False,
) -> None:
    """Measure policies from the 2D table elsewhere: success with 95 % intervals."""
    from marl_airhockey.transfer.measure import measure_transfer, plot_transfer

    folder = out or Path("runs") / f"transfer-{scenario}"
    # Everything that may be wrong is checked before anything takes time.
    backends, profiles = _list(to), _list(profile)
    _check_names(backends, profiles)
    find_scenario(scenario, **settings(option))
    policies = _policies(scenario, policy or [], profiles, fine_tune, seed, folder)
    with bar() as progress:
        total = len(policies) * len(backends) * len(profiles)
        task = progress.add_task("measuring", total=total, note="")
        rows = measure_transfer(
            policies,
            scenario,
            backends,
            profiles,
            episodes,
            {"options": settings(option)},
            lambda: progress.advance(task),
        )
    folder.mkdir(parents=True, exist_ok=True)
    data = json.dumps([row.to_json() for row in rows], indent=1)
    (folder / "transfer.json").write_text(data)
    require("matplotlib", "train")
    plot_transfer(rows, folder / "transfer.png")
    if as_json:
        console.print_json(data)
        return
    console.print(_table(rows, f"{scenario}: success in {episodes} episodes"))
    console.print("files:", folder / "transfer.json", folder / "transfer.png")


def _policies(
    scenario: str,
    names: list[str],
    profiles: list[str],
    fine_tune: int,
    seed: int,
    folder: Path,
) -> dict[str, Driver]:
    """Return the policies to measure, by name, after all training that they need.

    Args:
        scenario: what they play.
        names: of policies or runs; if empty, one is trained in each profile.
        profiles: names of profiles.
        fine_tune: steps by which each run is trained on; 0 for none.
        seed: of training.
        folder: of the runs.
    """
    from marl_airhockey.transfer.measure import fine_tuning_config, pretraining_config

    for name in names:
        make_agent(name)
    names = list(names)
    if not names:
        for kind in profiles:
            names.append(_run(folder / kind, pretraining_config(scenario, kind, seed)))
    if fine_tune:
        runs = [n for n in names if (Path(n) / "config.toml").exists()]
        if not runs:
            raise ValueError(f"--fine-tune: of {names}, none is the folder of a run")
        for name in runs:
            run = folder / f"{Path(name).name}-tuned-{fine_tune}"
            names.append(_run(run, fine_tuning_config(Path(name), fine_tune)))
    policies: dict[str, Driver] = {}
    for name in names:
        short = Path(name).name if Path(name).exists() else name
        policies[name if short in policies else short] = make_agent(name)
    return policies


def _table(rows: list[TransferResult], title: str) -> Table:
    """Return a table with a row for each policy and backend, a column for a profile."""
    table = Table("policy", "in", title=title)
    for kind in dict.fromkeys(row.profile for row in rows):
        table.add_column(f"{kind} profile (95 %)", justify="right")
    for policy, backend in dict.fromkeys((row.policy, row.backend) for row in rows):
        table.add_row(
            policy,
            backend,
            *(
                f"{r.success:.3f} ({r.interval[0]:.2f}..{r.interval[1]:.2f})"
                for r in rows
                if (r.policy, r.backend) == (policy, backend)
            ),
        )
    return table


def _check_names(backends: list[str], profiles: list[str]) -> None:
    """Raise an error that names an unknown backend or profile."""
    for backend in backends:
        find_backend(backend)
    for profile in profiles:
        find_profile(profile)


def _list(names: str) -> list[str]:
    """Return the names in a list with commas, each once."""
    return list(dict.fromkeys(name.strip() for name in names.split(",")))


def _run(folder: Path, config: PPOConfig) -> str:
    """Train a run, or resume it if it is there; return its folder.

    Raises:
        ValueError: a run with other settings, or a cut off one that is not trusted.
    """
    from marl_airhockey.learn.ppo_config import PPOConfig
    from marl_airhockey.learn.run import TrainingRun
    from marl_airhockey.learn.settings import load_config

    begun = (folder / "config.toml").exists()
    if begun:
        run = TrainingRun(load_config(PPOConfig, folder / "config.toml"), folder)
        if run.config != config:
            raise ValueError(f"{folder} holds another run: say another --out")
        if run.steps_left > 0 and (folder / "last.zip").exists():
            require_trust(folder / "last.zip")
    train_with_progress(None if begun else config, folder)
    return str(folder)


def fit(
    scenario: Annotated[
        str,
        typer.Argument(
            metavar="SCENARIO or FILE.csv...",
            help="What is played, without blocks; or a file of rows t,x,y (s, m), "
            "optionally with paddle_x,paddle_y, of a real table.",
        ),
    ] = "juggle",
    more: Annotated[
        list[Path] | None, typer.Argument(hidden=True, help="Further files.")
    ] = None,
    driver: Annotated[
        str | None, typer.Option(help="Who plays it; of the zoo unless given.")
    ] = None,
    backend: Annotated[str, typer.Option(help="Where it is played.")] = "robosuite",
    physics: Physics = None,
    recordings: Annotated[
        Path | None,
        typer.Option(help="Folder of recordings of play, instead of playing."),
    ] = None,
    steps: Annotated[int, typer.Option(help="Control steps of play.", min=1)] = 3000,
    seed: Annotated[int, typer.Option(help="Of the play.")] = 0,
    table: Annotated[
        str, typer.Option(help="Table of the rows, by name.")
    ] = "standard",
    origin: Annotated[
        str, typer.Option(help="Of the rows: centre, or corner (of least x and y).")
    ] = "centre",
    base: Annotated[
        str | None,
        typer.Option(
            help="Of rows: write a profile for --profile, with the rest of this one."
        ),
    ] = None,
    delays: Annotated[
        list[Path] | None,
        typer.Option(help="Of --base: what calibrate delay (arm) --json has printed."),
    ] = None,
    out: Annotated[Path, typer.Option(help="The file.")] = Path("fit.toml"),
) -> None:
    """Fit the 2D table's physics to play on another one, for --physics FILE."""
    if scenario.endswith(".csv"):
        paths = [Path(scenario), *(more or [])]
        _fit_rows(paths, table, origin, out, base, delays)
        return
    if base is not None or delays:
        raise ValueError("--base, --delays: they go with rows t,x,y of a table")
    if more:
        raise ValueError(f"fit: {more[0]} follows a scenario; files must end in .csv")
    from marl_airhockey.core.recording import SUFFIX
    from marl_airhockey.transfer.recorded_play import load_recordings, record_play
    from marl_airhockey.transfer.system_id import fit_physics

    if recordings is not None:
        seen = load_recordings(sorted(recordings.glob(f"*{SUFFIX}")))
    else:
        player = make_agent(driver or f"zoo/{scenario}")
        there = physics_of(physics)
        with waiting(f"playing {steps} steps on {backend}"):
            keywords: Keywords = {"backend": backend, "physics": there}
            seen = record_play(scenario, player, steps, seed, keywords)
    with waiting("fitting"):
        found = fit_physics(seen)
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(found.to_toml())
    shown = Table("", "usual values", "fitted", title=f"{found.segments} segments")
    for name, value in found.physics.items():
        usual = seen.scene.defaults.get(name, PARAMETERS[name].default)
        shown.add_row(f"{name}, {PARAMETERS[name].unit}", f"{usual:g}", f"{value:.4g}")
    for k, name in enumerate(("pucks off, mm", "paddles off, mm")):
        errors = (f"{1000 * x[k]:.2f}" for x in (found.before, found.after))
        shown.add_row(name, *errors)
    console.print(shown)
    console.print(
        f"{found.error_reduction:.0%} of the pucks' error is gone; wrote {out}"
    )


def _fit_rows(
    paths: list[Path],
    table: str,
    origin: str,
    out: Path,
    base: str | None,
    delays: list[Path] | None,
) -> None:
    """Fit a table's laws to files of rows, write them and print them."""
    from marl_airhockey.transfer.corrected_fit import fit_corrected
    from marl_airhockey.transfer.profile_file import profile_toml, read_delays
    from marl_airhockey.transfer.track import read_track

    if table not in TABLES:
        raise ValueError(unknown_name("table", table, TABLES))
    if base is not None and base not in PROFILES:
        raise ValueError(f"--base: {unknown_name('profile', base, PROFILES)}")
    if delays and base is None:
        raise ValueError("--delays: add --base, the profile that has the rest")
    measured = read_delays(delays) if delays else None
    with waiting("fitting"):
        tracks = [read_track(path, TABLES[table], origin) for path in paths]
        found = fit_corrected(tracks, TABLES[table])
    count = sum(len(track.time) for track in tracks)
    what = f"{table}, fitted to {count} rows of play"
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(
        found.to_toml() if base is None else profile_toml(found, base, measured, what)
    )
    shown = Table("", "fitted", "95 % interval", "flights or bounces", title=table)
    rows = [(f"{n}, {PARAMETERS[n].unit}", e) for n, e in found.found.items()]
    rows += [(f"wall_restitution, side {k}", e) for k, e in found.by_side.items()]
    for label, e in rows:
        interval = f"{e.low:.4g} .. {e.high:.4g}"
        shown.add_row(label, f"{e.value:.4g}", interval, str(e.count))
    for name, why in found.missing.items():
        shown.add_row(name, "-", why, "")
    console.print(shown)
    console.print("wrote", out)

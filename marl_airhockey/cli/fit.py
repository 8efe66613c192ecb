"""Commands ``airhockey fit | fit-table``, which fit the physics of the 2D table."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from marl_airhockey.cli.options import Physics, console, physics_of
from marl_airhockey.cli.progress import waiting
from marl_airhockey.registry import make_driver
from marl_airhockey.sim.core.errors import unknown_name
from marl_airhockey.sim.core.parameters import PARAMETERS
from marl_airhockey.sim.core.profiles import PROFILES
from marl_airhockey.sim.core.table import TABLES
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.system_id.table_fit import FittedTable

FitFile = Annotated[Path, typer.Option(help="TOML file to write.")]


def fit(
    scenario: Annotated[
        str, typer.Argument(help="Name of a scenario without blocks.")
    ] = "juggle",
    driver: Annotated[
        str | None,
        typer.Option(help="Driver that plays; by default the policy zoo/SCENARIO."),
    ] = None,
    backend: Annotated[
        str,
        typer.Option(
            help="Backend on which the driver plays: numba, pymunk or robosuite."
        ),
    ] = "robosuite",
    physics: Physics = None,
    recordings: Annotated[
        Path | None,
        typer.Option(
            file_okay=False,
            help="Folder of recordings to fit to; no driver plays then.",
        ),
    ] = None,
    steps: Annotated[
        int, typer.Option(help="Number of control steps that the driver plays.", min=1)
    ] = 3000,
    seed: Annotated[int, typer.Option(help="Seed of the first episode.")] = 0,
    out: FitFile = Path("fit.toml"),
) -> None:
    """Fit the physics of the 2D table to episodes on another backend.

    The file that is written is a value of --physics.
    """
    if scenario.endswith(".csv"):
        raise ValueError(
            "fit: expected the name of a scenario; for a CSV file use "
            f"airhockey fit-table {scenario}"
        )
    from marl_airhockey.data.files import recordings_in
    from marl_airhockey.system_id.recorded_play import load_recordings, record_play
    from marl_airhockey.system_id.system_id import fit_physics

    if recordings is not None:
        seen = load_recordings(recordings_in([recordings]))
    else:
        player = make_driver(driver or f"zoo/{scenario}")
        there = physics_of(physics)
        with waiting(f"playing {steps} steps on {backend}"):
            keywords: Keywords = {"backend": backend, "physics": there}
            seen = record_play(scenario, player, steps, seed, keywords)
    with waiting("fitting"):
        found = fit_physics(seen)
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(found.to_toml())
    shown = Table("", "default values", "fitted", title=f"{found.segments} segments")
    for name, value in found.physics.items():
        usual = seen.scene.defaults.get(name, PARAMETERS[name].default)
        shown.add_row(f"{name}, {PARAMETERS[name].unit}", f"{usual:g}", f"{value:.4g}")
    for k, name in enumerate(("error of pucks, mm", "error of paddles, mm")):
        errors = (f"{1000 * x[k]:.2f}" for x in (found.before, found.after))
        shown.add_row(name, *errors)
    console.print(shown)
    console.print(f"{found.error_reduction:.0%} less error of the pucks; wrote {out}")


def fit_table(
    rows: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE.csv...",
            help="CSV files of a real table with the columns t,x,y (s, m), and "
            "optionally paddle_x,paddle_y (m).",
        ),
    ],
    table: Annotated[
        str,
        typer.Option(
            help="Preset of the table: standard, full_size, ubc_pro or ubc_wood."
        ),
    ] = "standard",
    origin: Annotated[
        str,
        typer.Option(
            help="Origin of x and y: centre, or corner (the one with the smallest x "
            "and y)."
        ),
    ] = "centre",
    base: Annotated[
        str | None,
        typer.Option(
            help="Profile that supplies the parameters that are not fitted. The file "
            "is then a value of --profile, else of --physics."
        ),
    ] = None,
    delays: Annotated[
        list[Path] | None,
        typer.Option(
            help="File with the output of calibrate delay --json or calibrate arm "
            "--json; needs --base. Can be repeated."
        ),
    ] = None,
    out: FitFile = Path("fit.toml"),
) -> None:
    """Fit the physics of a real table to measured trajectories of the puck."""
    from marl_airhockey.system_id.corrected_fit import fit_corrected
    from marl_airhockey.system_id.profile_file import profile_toml, read_delays
    from marl_airhockey.system_id.track import read_track

    if table not in TABLES:
        raise ValueError(unknown_name("table", table, TABLES))
    if base is not None and base not in PROFILES:
        raise ValueError(f"--base: {unknown_name('profile', base, PROFILES)}")
    if delays and base is None:
        raise ValueError("--delays needs --base, the profile of all other parameters")
    measured = read_delays(delays) if delays else None
    with waiting("fitting"):
        tracks = [read_track(path, TABLES[table], origin) for path in rows]
        found = fit_corrected(tracks, TABLES[table])
    if not found.found and base is None:
        reasons = "; ".join(f"{name}: {why}" for name, why in found.missing.items())
        raise ValueError(f"no parameter of the table could be identified: {reasons}")
    count = sum(len(track.time) for track in tracks)
    what = f"{table}, fitted to {count} rows of play"
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(
        found.to_toml() if base is None else profile_toml(found, base, measured, what)
    )
    console.print(_fitted(found, table))
    console.print("wrote", out)


def _fitted(found: FittedTable, table: str) -> Table:
    """Return a table of the fitted parameters with their 95 % intervals."""
    shown = Table("", "fitted", "95 % interval", "flights or bounces", title=table)
    lines = [(f"{n}, {PARAMETERS[n].unit}", e) for n, e in found.found.items()]
    lines += [(f"wall_restitution, side {k}", e) for k, e in found.by_side.items()]
    for label, e in lines:
        interval = f"{e.low:.4g} .. {e.high:.4g}"
        shown.add_row(label, f"{e.value:.4g}", interval, str(e.count))
    for name, why in found.missing.items():
        shown.add_row(name, "-", why, "")
    return shown

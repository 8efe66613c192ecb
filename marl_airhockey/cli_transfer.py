"""The command ``airhockey transfer``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from marl_airhockey.cli_common import AsJson, Options, bar, console, settings
from marl_airhockey.extras import need
from marl_airhockey.registry import make_driver


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
    ] = "batched,pymunk,robosuite",
    profile: Annotated[
        str, typer.Option(help="Profiles, comma-separated.")
    ] = "ideal,robot",
    episodes: Annotated[int, typer.Option(help="Of each.", min=1)] = 200,
    fine_tune: Annotated[
        int, typer.Option(help="Steps by which runs are trained on, on robosuite.")
    ] = 0,
    seed: Annotated[int, typer.Option(help="Of training.")] = 0,
    out: Annotated[
        Path | None, typer.Option(help="Folder of runs and results.")
    ] = None,
    option: Options = None,
    as_json: AsJson = False,
) -> None:
    """How do policies from the 2D table do elsewhere? Success with 95 % intervals."""
    from marl_airhockey.learn.train import train
    from marl_airhockey.transfer import measure, picture, schooled, tuned

    folder = out or Path("runs") / f"transfer-{scenario}"
    backends, profiles = to.split(","), profile.split(",")
    names = list(policy or [])
    if not names:
        for kind in ("ideal", "robot"):
            run = folder / kind
            if not (run / "best.zip").exists():
                console.print(f"training in the {kind} profile: {run}")
                train(schooled(scenario, kind, seed), run)
            names.append(str(run))
    if fine_tune:
        for name in [n for n in names if (Path(n) / "config.toml").exists()]:
            run = folder / f"{Path(name).name}-tuned"
            if not (run / "best.zip").exists():
                console.print(f"training on, on robosuite: {run}")
                train(tuned(Path(name), fine_tune), run)
            names.append(str(run))
    policies = {
        Path(name).name if Path(name).exists() else name: make_driver(name)
        for name in names
    }
    with bar() as progress:
        total = len(policies) * len(backends) * len(profiles)
        task = progress.add_task("measuring", total=total, note="")
        rows = measure(
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
    need("matplotlib", "train")
    picture(rows, folder / "transfer.png")
    if as_json:
        console.print_json(data)
        return
    table = Table("policy", "in", title=f"{scenario}: success in {episodes} episodes")
    for kind in profiles:
        table.add_column(f"{kind} profile (95 %)", justify="right")
    for name in policies:
        for backend in backends:
            mine = [r for r in rows if (r.policy, r.backend) == (name, backend)]
            cells = [
                f"{r.success:.3f} ({r.interval[0]:.2f}..{r.interval[1]:.2f})"
                for r in mine
            ]
            table.add_row(name, backend, *cells)
    console.print(table)
    console.print("files:", folder / "transfer.json", folder / "transfer.png")

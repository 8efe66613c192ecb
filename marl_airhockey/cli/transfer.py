"""Command ``airhockey transfer``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from marl_airhockey.cli.options import (
    AsJson,
    Options,
    Trusting,
    Workers,
    console,
    settings,
    train_with_progress,
)
from marl_airhockey.cli.progress import bar
from marl_airhockey.policies.trust import require_trust
from marl_airhockey.registry import find_backend, find_scenario, make_driver
from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.sim.core.errors import require
from marl_airhockey.sim.core.profiles import find_profile

if TYPE_CHECKING:
    from marl_airhockey.evaluation.evaluate import EvaluationResult
    from marl_airhockey.learn.ppo_config import PPOConfig


def transfer(
    scenario: Annotated[str, typer.Argument(help="Name of a scenario.")],
    policy: Annotated[
        list[str] | None,
        typer.Option(
            help="Path of a policy or run. Can be repeated. By default one policy is "
            "trained in each profile; its run is in --out, and a complete one is used "
            "again."
        ),
    ] = None,
    to: Annotated[
        str,
        typer.Option(
            help="Backends, separated by commas: numba, pymunk and robosuite."
        ),
    ] = "numba,pymunk,robosuite",
    profile: Annotated[
        str,
        typer.Option(
            help="Profiles, separated by commas: ideal, ur5e, ur5e-calibrated, "
            "ur5e-authors, gantry, or files of airhockey fit-table."
        ),
    ] = "ideal,ur5e",
    episodes: Annotated[
        int,
        typer.Option(
            help="Number of episodes of each policy, backend and profile.", min=1
        ),
    ] = 200,
    fine_tune: Annotated[
        int,
        typer.Option(
            help="Number of steps for which runs are trained further on robosuite.",
            min=0,
        ),
    ] = 0,
    seed: Annotated[int, typer.Option(help="Seed of the training.")] = 0,
    out: Annotated[
        Path | None,
        typer.Option(
            file_okay=False,
            help="Folder of runs and results; by default runs/transfer-SCENARIO.",
        ),
    ] = None,
    option: Options = None,
    num_workers: Workers = None,
    trust: Trusting = False,
    as_json: AsJson = False,
) -> None:
    """Measure the success of policies on several backends and in several profiles.

    The results have 95 % intervals.
    """
    from marl_airhockey.system_id.measure import measure_transfer, plot_transfer

    folder = out or Path("runs") / f"transfer-{scenario}"
    # All inputs are checked before any long computation starts.
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
    """Return the policies to measure by name; train them first if necessary.

    Args:
        scenario: Name of the scenario.
        names: Names of policies or runs; if empty, one is trained in each profile.
        profiles: Names of the profiles.
        fine_tune: Number of steps for which each run is trained further; 0 for none.
        seed: Seed of the training.
        folder: Folder of the runs.
    """
    from marl_airhockey.system_id.measure import fine_tuning_config, pretraining_config

    for name in names:
        make_driver(name)
    names = list(names)
    if not names:
        for kind in profiles:
            names.append(_run(folder / kind, pretraining_config(scenario, kind, seed)))
    if fine_tune:
        runs = [n for n in names if (Path(n) / "config.toml").exists()]
        if not runs:
            raise ValueError(
                f"--fine-tune: none of {names} is a folder of a run; it needs one"
            )
        for name in runs:
            run = folder / f"{Path(name).name}-tuned-{fine_tune}"
            names.append(_run(run, fine_tuning_config(Path(name), fine_tune)))
    policies: dict[str, Driver] = {}
    for name in names:
        short = Path(name).name if Path(name).exists() else name
        policies[name if short in policies else short] = make_driver(name)
    return policies


def _table(rows: list[EvaluationResult], title: str) -> Table:
    """Return a table: a row for each policy and backend, a column for each profile."""
    table = Table("policy", "in", title=title)
    for kind in dict.fromkeys(row.profile for row in rows):
        table.add_column(f"{kind} profile (95 %)", justify="right")
    for policy, backend in dict.fromkeys((row.driver, row.backend) for row in rows):
        table.add_row(
            policy,
            backend,
            *(
                "{:.3f} ({:.2f}..{:.2f})".format(r.success, *r.success_interval)
                for r in rows
                if (r.driver, r.backend) == (policy, backend)
            ),
        )
    return table


def _check_names(backends: list[str], profiles: list[str]) -> None:
    """Raise an error if a backend or a profile does not exist."""
    for backend in backends:
        find_backend(backend)
    for profile in profiles:
        find_profile(profile)


def _list(names: str) -> list[str]:
    """Return the different names in a text with commas."""
    return list(dict.fromkeys(name.strip() for name in names.split(",")))


def _run(folder: Path, config: PPOConfig) -> str:
    """Train a run, or resume it if it exists; return its folder.

    Raises:
        ValueError: The folder contains a run with other settings, or an interrupted run
            that is not trusted.
    """
    from marl_airhockey.learn.ppo_config import PPOConfig
    from marl_airhockey.learn.run import TrainingRun
    from marl_airhockey.learn.settings import load_config

    begun = (folder / "config.toml").exists()
    if begun:
        run = TrainingRun(load_config(PPOConfig, folder / "config.toml"), folder)
        if run.config != config:
            raise ValueError(
                f"{folder} contains a run with other settings; give another --out"
            )
        if run.steps_left > 0 and (folder / "last.zip").exists():
            require_trust(folder / "last.zip")
    train_with_progress(None if begun else config, folder)
    return str(folder)

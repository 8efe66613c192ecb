"""Command ``airhockey trials``."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from marl_airhockey.cli.environment import (
    EnvironmentOptions,
    as_trained_unless_given,
    in_environment,
)
from marl_airhockey.cli.options import AsJson, console
from marl_airhockey.cli.options import Scenario as ScenarioOption
from marl_airhockey.cli.progress import bar
from marl_airhockey.data.files import is_recording
from marl_airhockey.registry import make_driver
from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.sim.world.keywords import Keywords

if TYPE_CHECKING:
    from marl_airhockey.evaluation.comparison import Comparison, Estimates
    from marl_airhockey.evaluation.trial_sheet import TrialPlan, TrialSheet

STARTS = "starts.csv"


@in_environment
def trials(
    policies: Annotated[
        list[str],
        typer.Argument(
            metavar="[METHOD=]POLICY...",
            help="Names of drivers, paths of policies, or folders of recordings. "
            "Policies with the same METHOD are seeds of one method.",
        ),
    ],
    environment: EnvironmentOptions,
    scenario: ScenarioOption = None,
    out: Annotated[
        Path,
        typer.Option(
            file_okay=False,
            help="Folder of the trial table; an interrupted one is resumed.",
        ),
    ] = Path("trials"),
    number: Annotated[
        int, typer.Option("--trials", help="Number of trials of each method.", min=1)
    ] = 50,
    starts: Annotated[
        int,
        typer.Option(
            help="Number of fixed start states, which all methods play.", min=1
        ),
    ] = 25,
    operator: Annotated[
        str,
        typer.Option(
            help="Name of the person who places the puck, for the trial table."
        ),
    ] = "",
    seed: Annotated[int, typer.Option(help="Seed of the order of trials.")] = 0,
    as_json: AsJson = False,
) -> None:
    """Compare policies on a table in blinded trials from the same start states.

    The methods alternate in random order, and the operator does not see which of them
    plays. Recordings are compared without new trials.
    """
    from marl_airhockey.evaluation.trial_sheet import plan_trials

    methods = _methods([_on_table(text, environment) for text in policies])
    if recorded := _recordings(methods):
        _compare_recordings(recorded, as_json)
        return
    drivers = {
        name: [make_driver(path) for path in paths] for name, paths in methods.items()
    }
    players = {
        f"{name} {number}": driver
        for name, some in drivers.items()
        for number, driver in enumerate(some)
    }
    given, backend = environment.keywords, environment.backend
    game, keywords, _ = as_trained_unless_given(players, scenario, given, as_json)
    where = {
        "backend": backend,
        "profile": keywords.get("profile", "ideal"),
        "options": environment.option or [],
        "drivers": environment.driver or [],
        "physics": " ".join(environment.physics or []),
        "table": "lab" if environment.lab else str(environment.rig or ""),
        "operator": operator,
    }

    def plan(chosen: list[int]) -> TrialPlan:
        return plan_trials(game, methods, chosen, number, where, seed)

    with environment.table(keywords) as table:
        sheet = _play(drivers, game, table, min(starts, number), plan, out)
    found = sheet.compare()
    result = {**found.to_json(), "trials_an_hour": sheet.trials_an_hour}
    (out / "result.json").write_text(json.dumps(result, indent=1))
    if as_json:
        console.print_json(json.dumps(result))
        return
    _show(found, f"{game} on {backend}")
    console.print(f"{sheet.trials_an_hour:.0f} trials per hour; files: {out}")


def _recordings(methods: dict[str, list[str]]) -> dict[str, list[Path]]:
    """Return the recordings by method; an empty dict for drivers and policies.

    Raises:
        ValueError: Only some of them are recordings.
    """
    found = {name: [Path(path) for path in paths] for name, paths in methods.items()}
    are = [is_recording(path) for paths in found.values() for path in paths]
    if any(are) and not all(are):
        raise ValueError("trials: give either recordings or policies, not both")
    return found if all(are) else {}


def _compare_recordings(methods: dict[str, list[Path]], as_json: bool) -> None:
    """Compare methods by recordings; each recording is of one policy."""
    from marl_airhockey.data.files import shared_head
    from marl_airhockey.evaluation.comparison import compare
    from marl_airhockey.evaluation.evaluate import recorded_outcomes

    head = shared_head([path for paths in methods.values() for path in paths])
    found = compare({n: recorded_outcomes(paths) for n, paths in methods.items()})
    if as_json:
        console.print_json(json.dumps(found.to_json()))
        return
    _show(found, f"{head['scenario']}, as recorded")


def _play(
    drivers: dict[str, list[Driver]],
    game: str,
    keywords: Keywords,
    starts: int,
    plan: Callable[[list[int]], TrialPlan],
    out: Path,
) -> TrialSheet:
    """Play the trials of a plan from spread start states; return the trial table."""
    from marl_airhockey.build import build_driven_world
    from marl_airhockey.evaluation.trial_sheet import TrialSheet
    from marl_airhockey.evaluation.trials import (
        play_trials,
        spread_starts,
        write_starts,
    )

    every = [driver for policies in drivers.values() for driver in policies]
    forms = [driver.observe for driver in every if driver.observe]
    world = build_driven_world(every[0], game, 1, keywords, forms)
    try:
        chosen = spread_starts(world, starts)
        sheet = TrialSheet(out, plan(chosen))
        write_starts(world, chosen, out / STARTS)
        with bar() as progress:
            task = progress.add_task(game, total=len(sheet.plan.trials), note="")
            play_trials(
                *(world, sheet, drivers),
                lambda done: progress.update(task, completed=done),
            )
    finally:
        world.close()
    return sheet


def _on_table(text: str, environment: EnvironmentOptions) -> str:
    """Return METHOD=POLICY with the policy that was trained for the table."""
    method, equals, policy = text.rpartition("=")
    return method + equals + environment.on_table(policy)


def _methods(texts: list[str]) -> dict[str, list[str]]:
    """Return the policies of each method, by name.

    Raises:
        ValueError: A policy is given twice.
    """
    found: dict[str, list[str]] = {}
    for text in texts:
        method, _, policy = text.rpartition("=")
        method = method or policy
        if policy in found.setdefault(method, []):
            raise ValueError(f"{text}: this policy is given twice")
        found[method].append(policy)
    return found


def _show(found: Comparison, title: str) -> None:
    """Print a table of the methods and of the differences between them."""
    table = Table("method", title=title)
    for name in ("policies", "trials", "interrupted", "success (95 %)"):
        table.add_column(name, justify="right")
    table.add_column("return (95 %)", justify="right")
    for row in found.methods:
        table.add_row(
            row.name,
            *(str(row.policies), str(row.trials), str(row.interrupted)),
            *_values(row),
        )
    for gap in found.differences:
        table.add_row(
            f"{gap.first} - {gap.second}",
            *("", "", ""),
            *_values(gap),
        )
    console.print(table)


def _values(row: Estimates) -> list[str]:
    """Return success and return of a row as texts, with their 95 % intervals."""
    success = row.success, row.success_interval
    returns = row.returns, row.returns_interval
    return [f"{v:.3f} ({low:.2f}..{high:.2f})" for v, (low, high) in (success, returns)]

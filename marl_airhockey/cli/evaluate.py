"""Command ``airhockey evaluate`` and its table of results."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from marl_airhockey.cli.environment import (
    EnvironmentOptions,
    as_trained_unless_given,
    in_environment,
)
from marl_airhockey.cli.options import AsJson, Scenario, Workers, console
from marl_airhockey.cli.progress import bar
from marl_airhockey.data.files import is_recording
from marl_airhockey.evaluation.evaluate import (
    TEST_SEED,
    EvaluationResult,
    evaluate,
    evaluate_recording,
)
from marl_airhockey.evaluation.over_runs import OverRuns
from marl_airhockey.policies.policy import Policy
from marl_airhockey.registry import REAL, make_driver

FLOORS = ("still", "random", "sticky")
"""Names of the baselines: drivers without skill."""


@in_environment
def evaluate_driver(
    drivers: Annotated[
        list[str],
        typer.Argument(
            metavar="DRIVER...",
            help="Name of a driver, path of a policy, or folder of a recording. "
            "Several runs with different seeds also give a mean with an interval over "
            "the runs.",
        ),
    ],
    environment: EnvironmentOptions,
    scenario: Scenario = None,
    episodes: Annotated[int, typer.Option(help="Number of episodes.", min=1)] = 200,
    seed: Annotated[int, typer.Option(help="Seed of the first episode.")] = TEST_SEED,
    floors: Annotated[
        bool,
        typer.Option(help="Evaluate the baselines still, random and sticky, too."),
    ] = True,
    num_workers: Workers = None,
    as_json: AsJson = False,
) -> None:
    """Evaluate a driver on episodes that are not part of any training.

    A policy is evaluated in the environment in which it was trained, unless an option
    changes it. A policy that can sample its actions is evaluated with and without
    sampling.

    On a real table and in the virtual lab there are no baselines, and a policy does not
    sample its actions.

    For a recording, the options of the environment have no effect.
    """
    recorded = [is_recording(Path(name)) for name in drivers]
    if all(recorded):
        _report([evaluate_recording(Path(name)) for name in drivers], None, as_json)
        return
    if any(recorded):
        raise ValueError(
            "recordings and drivers cannot be evaluated together; use two commands"
        )
    names = [environment.on_table(name) for name in drivers]
    scenario, keywords, players = as_trained_unless_given(
        {name: make_driver(name) for name in names},
        scenario,
        environment.keywords,
        as_json,
    )
    entries, first = list(players.items()), players[names[0]]
    simulated = environment.backend != REAL
    alone = isinstance(first, Policy) and first.can_sample and len(entries) == 1
    if isinstance(first, Policy) and alone and simulated:
        sampled = replace(first, deterministic=False)
        entries.append((f"{names[0]} (sampled)", sampled))
    if floors and simulated:
        entries += [(f, make_driver(f)) for f in FLOORS if f not in names]
    results: list[EvaluationResult] = []
    with environment.table(keywords) as keywords, bar() as progress:
        task = progress.add_task(scenario, total=len(entries), note="")
        for name, entry in entries:
            progress.update(task, note=name)
            results.append(
                evaluate(
                    entry,
                    scenario,
                    episodes=episodes,
                    seed=seed,
                    name=name,
                    exact=True,
                    **keywords,
                )
            )
            progress.advance(task)
    runs = OverRuns.of(results[: len(players)]) if len(players) > 1 else None
    _report(results, runs, as_json)


def _report(
    results: list[EvaluationResult], runs: OverRuns | None, as_json: bool
) -> None:
    """Print the results; those of the baselines follow that of the driver."""
    if as_json:
        main_result = results[0].to_json()
        for result in results[1:]:
            key = "sampled" if "(sampled)" in result.driver else result.driver
            main_result.setdefault("beside", {})[key] = result.to_json()
        if runs is not None:
            main_result["over_runs"] = asdict(runs)
        console.print_json(json.dumps(main_result))
        return
    console.print(result_table(results))
    for result in results:
        for reason, count in result.interruptions.items():
            console.print(f"{result.driver}: {count} interrupted by {reason}")
    if runs is not None:
        console.print(runs.text)


def result_table(results: list[EvaluationResult]) -> Table:
    """Return a table with a column for each driver."""
    first = results[0]
    table = Table(
        title=f"{first.scenario} on {first.backend}, {first.profile} profile, "
        f"{first.episodes} episodes",
    )
    table.add_column("")
    for result in results:
        table.add_column(result.driver, justify="right")
    lines: dict[str, Callable[[EvaluationResult], str]] = {
        "success": lambda r: f"{r.success:.3f}",
        "  95 % from": lambda r: f"{r.success_interval[0]:.3f}",
        "  95 % to": lambda r: f"{r.success_interval[1]:.3f}",
        "first-shot success": lambda r: f"{r.first_shot:.3f}",
        "return": lambda r: f"{r.returns:.2f}",
        "  interquartile": lambda r: f"{r.returns_iqm:.2f}",
        "  95 % from ": lambda r: f"{r.returns_interval[0]:.2f}",
        "  95 % to ": lambda r: f"{r.returns_interval[1]:.2f}",
        "interrupted": lambda r: f"{r.interrupted}",
        "control steps": lambda r: f"{r.length:.0f}",
        "touches": lambda r: f"{r.hits:.1f}",
        "violations a minute": lambda r: f"{r.deployability.violations_per_minute:.0f}",
        "jerk, m/s3": lambda r: f"{r.deployability.jerk:.0f}",
        "power above 5 Hz": lambda r: f"{r.deployability.power_above_5hz:.2f}",
        "ms an action": lambda r: f"{r.deployability.act_ms:.2f}",
        "deployability": lambda r: r.deployability.grade,
    }
    if first.backend != REAL:
        del lines["interrupted"]
    for name, line in lines.items():
        table.add_row(name, *(line(result) for result in results))
    return table

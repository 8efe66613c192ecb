"""Commands ``airhockey train | export | demo``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from marl_airhockey.cli.evaluate import result_table
from marl_airhockey.cli.options import (
    AsJson,
    Backend,
    Drivers,
    Options,
    Physics,
    Trusting,
    Workers,
    console,
    measure_of,
    physics_of,
    settings,
    train_with_progress,
)
from marl_airhockey.cli.progress import bar
from marl_airhockey.registry import DEFAULT_BACKEND
from marl_airhockey.sim.core.errors import require

if TYPE_CHECKING:
    from marl_airhockey.learn.algorithms import AnyConfig
    from marl_airhockey.learn.ppo_config import PPOConfig


def train(
    scenario: Annotated[str, typer.Argument(help="Name of a scenario.")] = "",
    seed: Annotated[int, typer.Option(help="Seed of worlds and network.")] = 0,
    backend: Backend = DEFAULT_BACKEND,
    profile: Annotated[
        str | None, typer.Option(help="What robots sense: ideal, ur5e, gantry.")
    ] = None,
    steps: Annotated[
        int | None, typer.Option(help="Steps of single worlds; of the gradient.")
    ] = None,
    hidden: Annotated[
        int | None, typer.Option(help="Units of both layers; the paper's size is 256.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(file_okay=False, help="Folder of the run.")
    ] = None,
    engine: Annotated[
        str | None, typer.Option(help="torch (usual), sb3, or rllib over many.")
    ] = None,
    num_env_runners: Annotated[
        int | None, typer.Option(help="Of rllib: processes that step the worlds.")
    ] = None,
    init: Annotated[
        Path | None, typer.Option(help="Begin with the weights of this run.")
    ] = None,
    algo: Annotated[
        str,
        typer.Option(
            help="ppo; sac_her; bc, iql, td3_bc and rebrac learn from --data."
        ),
    ] = "ppo",
    data: Annotated[
        list[Path] | None,
        typer.Option(help="Recordings to learn from, or a folder of them; repeatable."),
    ] = None,
    change: Annotated[
        list[str] | None,
        typer.Option("--set", help="A setting of the preset, NAME=VALUE; repeatable."),
    ] = None,
    option: Options = None,
    other: Drivers = None,
    physics: Physics = None,
    resume: Annotated[Path | None, typer.Option(help="Resume this run.")] = None,
    num_workers: Workers = None,
    trust: Trusting = False,
    as_json: AsJson = False,
) -> None:
    """Train a policy with PPO and its preset, or by another --algo; or --resume."""
    from marl_airhockey.learn.algorithms import make_config
    from marl_airhockey.learn.offline.choice import learned_from
    from marl_airhockey.learn.offline.config import OfflineConfig
    from marl_airhockey.learn.ppo_config import PPOConfig
    from marl_airhockey.learn.train import default_folder

    given = {
        "physics": physics_of(physics) or None,
        "total_steps": steps,
        "hidden": [hidden, hidden] if hidden is not None else None,
        "init": str(init) if init is not None else None,
        "engine": engine,
        "num_env_runners": num_env_runners,
    }
    given = {name: value for name, value in given.items() if value is not None}
    if resume is not None:
        if given or any((scenario, change, option, other, out, data, profile)):
            raise ValueError("--resume goes on as the run was begun: give nothing else")
        _train(None, resume, as_json)
        return
    shared = {
        "profile": profile,
        "options": settings(option),
        "drivers": settings(other),
    }
    changes: dict[str, Any] = {name: v for name, v in shared.items() if v}
    changes |= {"seed": seed, "backend": backend} | settings(change) | given
    config = make_config(algo, scenario, data or [], changes)
    if isinstance(config, PPOConfig) and steps is not None and not as_json:
        _tell_updates(steps, config, changes)
    if isinstance(config, OfflineConfig) and not as_json:
        for line in learned_from(config):
            console.print(line, soft_wrap=True, markup=False)
    _train(config, out or default_folder(config), as_json)


def _tell_updates(steps: int, config: PPOConfig, changes: dict[str, Any]) -> None:
    """Print how many updates a number of steps is, and what is usual."""
    from marl_airhockey.learn.ppo_config import preset

    others = {name: value for name, value in changes.items() if name != "total_steps"}
    usual = preset(config.scenario, others)
    updates = -(-steps // config.rollout)
    console.print(
        f"steps: {updates * config.rollout:,}, {updates} updates of "
        f"{config.rollout:,}; the preset has {usual.total_steps:,}"
    )


def _train(config: AnyConfig | None, folder: Path, as_json: bool) -> None:
    """Train, or resume a run for None, and print the result."""
    finished = config is None and _is_finished(folder)
    row = train_with_progress(config, folder)
    measure = measure_of(row)
    if as_json:
        console.print_json(json.dumps({"run": str(folder), **row}))
        return
    minutes = {
        kind: row.get(f"{kind}_cpu_seconds", 0.0) / 60
        for kind in ("learning", "evaluation", "setup")
    }
    if finished:
        console.print(_finished(folder), soft_wrap=True)
    parts = ", ".join(f"{kind} {value:.2f}" for kind, value in minutes.items())
    console.print(
        f"{folder}: {measure} {row[measure]:.3f} after {row['steps']:,.0f} steps "
        f"and {row['cpu_seconds'] / 60:.2f} CPU-minutes ({parts})",
        soft_wrap=True,
    )
    console.print(f"next: airhockey {_next(folder)}", soft_wrap=True)


def _finished(folder: Path) -> str:
    """Return that a run was finished already, and how to train on."""
    from marl_airhockey.learn.algorithms import load_any_config
    from marl_airhockey.learn.ppo_config import PPOConfig

    words = f"{folder}: this run was finished already; to train on, begin another one"
    config = load_any_config(folder)
    if not isinstance(config, PPOConfig):
        return f"{words} with more --steps"
    return f"{words} with its weights: airhockey train SCENARIO --init {folder}"


def _next(folder: Path) -> str:
    """Return the command that measures a run: a league for a game of several teams."""
    from marl_airhockey.learn.algorithms import load_any_config
    from marl_airhockey.learn.ppo_config import PPOConfig

    config = load_any_config(folder)
    if isinstance(config, PPOConfig) and config.self_play:
        return f"league {config.scenario} {folder} allround striker goalkeeper random"
    return f"evaluate {folder}"


def _is_finished(folder: Path) -> bool:
    """Return True for the folder of a run that has made all of its steps."""
    from marl_airhockey.learn.algorithms import load_any_config
    from marl_airhockey.learn.run import Progress

    state, config = folder / "state.json", load_any_config(folder)
    return state.exists() and Progress.load(state).steps >= config.total_steps


def export(
    run: Annotated[
        Path, typer.Argument(file_okay=False, help="Folder of a training run.")
    ],
    out: Annotated[Path, typer.Option(help="The file to write.")] = Path("policy.npz"),
    checkpoint: Annotated[
        Path | None, typer.Option(help="One of the run's instead of its last policy.")
    ] = None,
    trust: Trusting = False,
) -> None:
    """Freeze a trained policy into one small file, .npz or .onnx, with a card."""
    if not (run / "config.toml").exists():
        raise ValueError(f"{run}: there is no training run; name the folder of one")
    require("torch", "train")
    from marl_airhockey.learn.export import export_policy

    console.print_json(json.dumps(dict(export_policy(run, out, checkpoint).card)))
    which = checkpoint or f"the last policy of {run}"
    console.print(
        f"{out}: {which}, {out.stat().st_size / 1000:.0f} kB; airhockey evaluate {run} "
        f"plays the best one, which --checkpoint {run / 'best.npz'} exports",
        soft_wrap=True,
    )


def demo(
    out: Annotated[
        Path, typer.Option(file_okay=False, help="Folder for what it makes.")
    ] = Path("runs/demo"),
    scenario: Annotated[str, typer.Option(help="What to learn.")] = "juggle",
    steps: Annotated[
        int | None,
        typer.Option(help="Steps of single worlds; the preset's, at most 2 M."),
    ] = None,
) -> None:
    """Train a paddle to juggle, measure it, and show what it learned."""
    require("torch", "train")
    from marl_airhockey.learn.demo import run_demo

    with bar() as progress:
        task = progress.add_task(f"learning to {scenario}", total=None, note="")

        def report(done: int, total: int, row: dict[str, float]) -> None:
            """Show the progress of training."""
            name = measure_of(row)
            note = f"{name} {row[name]:.2f}" if row else ""
            progress.update(task, completed=done, total=total, note=note)

        results, files = run_demo(scenario, out, steps, report)
    console.print(result_table(results))
    for what, path in files.items():
        console.print(f"{what:>16}: {path}", soft_wrap=True)
    console.print(
        "\ntry next:\n"
        f"  airhockey watch {out / 'run'} --scenario {scenario}\n"
        "  airhockey train hit_goal && airhockey evaluate runs/hit_goal-0 -s hit_goal\n"
        "  airhockey list"
    )

"""Command ``airhockey train``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

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
from marl_airhockey.registry import DEFAULT_BACKEND

if TYPE_CHECKING:
    from marl_airhockey.learn.algorithms import AnyConfig
    from marl_airhockey.learn.ppo_config import PPOConfig


def train(
    scenario: Annotated[
        str, typer.Argument(help="Name or file of a scenario; not needed with --data.")
    ] = "",
    seed: Annotated[
        int, typer.Option(help="Seed of the worlds and of the initial network.")
    ] = 0,
    backend: Backend = DEFAULT_BACKEND,
    profile: Annotated[
        str | None,
        typer.Option(
            help="Sensing and actuation: ideal, ur5e, ur5e-calibrated, ur5e-authors, "
            "gantry, or a file of airhockey fit-table; by default ideal."
        ),
    ] = None,
    steps: Annotated[
        int | None,
        typer.Option(
            help="Number of steps, summed over all worlds; with --data, number of "
            "gradient steps. By default as in the preset."
        ),
    ] = None,
    hidden: Annotated[
        int | None,
        typer.Option(
            help="Number of units of each of the two hidden layers; the paper has 256. "
            "By default as in the preset."
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            file_okay=False,
            help="Folder of the run; by default runs/SCENARIO-SEED, and "
            "runs/SCENARIO-ALGO-SEED for algorithms other than ppo.",
        ),
    ] = None,
    engine: Annotated[
        str | None,
        typer.Option(
            help="Implementation of PPO: torch (the usual one), sb3 "
            "(stable-baselines3), rllib (several processes), or device (worlds on a "
            "GPU)."
        ),
    ] = None,
    device: Annotated[
        str | None,
        typer.Option(
            help="Device of torch that learns: cpu, cuda, cuda:NUMBER, or auto for a "
            "GPU if there is one. Worlds are on the CPU. By default cpu."
        ),
    ] = None,
    num_env_runners: Annotated[
        int | None,
        typer.Option(
            help="Number of processes that step the worlds, for --engine rllib; 0 for "
            "the process of the learner."
        ),
    ] = None,
    init: Annotated[
        Path | None,
        typer.Option(
            help="Folder of a run whose weights are the initial weights; it must have "
            "the same engine and network size."
        ),
    ] = None,
    algo: Annotated[
        str,
        typer.Option(
            help="Algorithm: ppo or sac_her; or, to learn from --data, bc, iql, td3_bc "
            "or rebrac."
        ),
    ] = "ppo",
    data: Annotated[
        list[Path] | None,
        typer.Option(
            help="Recording, folder of recordings, or name of a dataset to learn from. "
            "Can be repeated."
        ),
    ] = None,
    change: Annotated[
        list[str] | None,
        typer.Option(
            "--set", help="Setting of the preset, NAME=VALUE. Can be repeated."
        ),
    ] = None,
    option: Options = None,
    other: Drivers = None,
    physics: Physics = None,
    resume: Annotated[
        Path | None,
        typer.Option(
            help="Folder of an interrupted run to resume, with its own settings."
        ),
    ] = None,
    num_workers: Workers = None,
    trust: Trusting = False,
    as_json: AsJson = False,
) -> None:
    """Train a policy, or resume an interrupted run.

    The default is PPO with the preset of the scenario.
    """
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
        "device": device,
        "num_env_runners": num_env_runners,
    }
    given = {name: value for name, value in given.items() if value is not None}
    if resume is not None:
        if given or any((scenario, change, option, other, out, data, profile)):
            raise ValueError(
                "--resume continues a run with its own settings; remove all other "
                "settings"
            )
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
    """Print a number of steps as updates, and the number of steps of the preset."""
    from marl_airhockey.learn.ppo_config import preset

    others = {name: value for name, value in changes.items() if name != "total_steps"}
    usual = preset(config.scenario, others)
    updates = -(-steps // config.rollout)
    console.print(
        f"steps: {updates * config.rollout:,}, {updates} updates of "
        f"{config.rollout:,}; the preset has {usual.total_steps:,}"
    )


def _train(config: AnyConfig | None, folder: Path, as_json: bool) -> None:
    """Train, or resume the run in the folder without a config; print the result."""
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
    """Return a text: the run is complete, and how to continue its training."""
    from marl_airhockey.learn.algorithms import load_any_config
    from marl_airhockey.learn.ppo_config import PPOConfig

    words = f"{folder}: this run is complete; to train further, start another run"
    config = load_any_config(folder)
    if not isinstance(config, PPOConfig):
        return f"{words} with more --steps"
    return f"{words} with its weights: airhockey train SCENARIO --init {folder}"


def _next(folder: Path) -> str:
    """Return the command that evaluates a run: a league for a game of several teams."""
    from marl_airhockey.learn.algorithms import load_any_config
    from marl_airhockey.learn.ppo_config import PPOConfig

    config = load_any_config(folder)
    if isinstance(config, PPOConfig) and config.self_play:
        return f"league {config.scenario} {folder} allround striker goalkeeper random"
    return f"evaluate {folder}"


def _is_finished(folder: Path) -> bool:
    """Return True if the run in a folder has completed all of its steps."""
    from marl_airhockey.learn.algorithms import load_any_config
    from marl_airhockey.learn.run import Progress

    state, config = folder / "state.json", load_any_config(folder)
    return state.exists() and Progress.load(state).steps >= config.total_steps

"""Command ``airhockey watch``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from marl_airhockey.cli import play as cli_play
from marl_airhockey.cli.options import (
    Backend,
    ControlDt,
    Drivers,
    Observe,
    Options,
    Physics,
    Profile,
    Scenario,
    Trusting,
    as_trained_unless_given,
    console,
    environment,
)
from marl_airhockey.cli.real_table import (
    LabOption,
    RigOption,
    name_on_table,
    real_table,
)
from marl_airhockey.data.files import is_recording
from marl_airhockey.registry import DEFAULT_BACKEND, make_driver


def watch(
    driver: Annotated[
        str, typer.Argument(help="A driver's name, a policy's path, or a recording.")
    ],
    scenario: Scenario = None,
    backend: Backend = DEFAULT_BACKEND,
    profile: Profile = None,
    seed: Annotated[int, typer.Option(help="Of the first episode.")] = 0,
    episodes: Annotated[int, typer.Option(help="How many.")] = 1,
    video: Annotated[
        Path | None,
        typer.Option(help="Write a .gif, .webp or .mp4 instead of a window."),
    ] = None,
    option: Options = None,
    other: Drivers = None,
    physics: Physics = None,
    observe: Observe = None,
    control_dt: ControlDt = None,
    viewpoint: Annotated[
        str, typer.Option(help="top, or a viewpoint of the backend: agentview...")
    ] = "top",
    host: cli_play.Host = "127.0.0.1",
    port: cli_play.Port = 0,
    browser: cli_play.Browser = True,
    lab: LabOption = False,
    rig: RigOption = None,
    trust: Trusting = False,
) -> None:
    """Watch a driver play, in a window or as a video; or a recording of play.

    --host, --port and --browser are those of a recording's page.
    """
    from marl_airhockey.rollout.watch import show_episodes

    if is_recording(Path(driver)):
        if video is None:
            cli_play.show(Path(driver), host, port, browser)
        else:
            watch_recording(Path(driver), video)
        return
    if any(map(is_recording, Path(driver).glob("*"))):
        raise ValueError(f"{driver}: holds recordings; name one of its folders")
    keywords = environment(
        backend, profile, option, other, physics, control_dt, observe
    )
    name = name_on_table(driver, backend)
    game, keywords, players = as_trained_unless_given(
        {name: make_driver(name)}, scenario, keywords
    )
    with real_table(keywords, lab, rig) as table:
        show_episodes(
            game, players[name], table, seed, episodes, video, viewpoint=viewpoint
        )
    if video is not None:
        console.print(f"wrote {video} ({video.stat().st_size // 1000} kB)")


def watch_recording(recording: Path, video: Path) -> None:
    """Write a video of a recording and print its size."""
    from marl_airhockey.play.replay import one_episode
    from marl_airhockey.rollout.replay import Replay
    from marl_airhockey.rollout.watch import write_replay

    write_replay(Replay(one_episode(recording)), video)
    console.print(f"wrote {video} ({video.stat().st_size // 1000} kB)")

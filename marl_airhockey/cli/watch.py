"""Command ``airhockey watch``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from marl_airhockey.cli import hosting
from marl_airhockey.cli.environment import EnvironmentOptions, in_environment
from marl_airhockey.cli.options import Scenario, Video, console
from marl_airhockey.data.files import is_recording


@in_environment
def watch(
    name: Annotated[
        str,
        typer.Argument(
            metavar="DRIVER",
            help="Name of a driver, path of a policy, or folder of a recording.",
        ),
    ],
    environment: EnvironmentOptions,
    scenario: Scenario = None,
    seed: Annotated[int, typer.Option(help="Seed of the first episode.")] = 0,
    episodes: Annotated[int, typer.Option(help="Number of episodes.", min=1)] = 1,
    video: Video = None,
    viewpoint: Annotated[
        str,
        typer.Option(
            help="Camera of the images: top; on robosuite also frontview, agentview or "
            "birdview; on a real table also table or rectified."
        ),
    ] = "top",
    host: hosting.Host = "127.0.0.1",
    port: hosting.Port = 0,
    browser: hosting.Browser = True,
) -> None:
    """Show episodes of a driver, or a recording, or write a video of them.

    A driver is shown in a window. A recording is shown on a page in the browser;
    --host, --port and --browser apply to this page only.
    """
    from marl_airhockey.rollouts.watch import show_episodes

    if is_recording(Path(name)):
        if video is None:
            hosting.show(Path(name), host, port, browser)
        else:
            watch_recording(Path(name), video)
        return
    if any(map(is_recording, Path(name).glob("*"))):
        raise ValueError(
            f"{name} is a folder of recordings; give the folder of one of them"
        )
    _, driver, game, keywords = environment.one_driver(name, scenario)
    with environment.table(keywords) as table:
        show_episodes(game, driver, table, seed, episodes, video, viewpoint=viewpoint)
    if video is not None:
        console.print(f"wrote {video} ({video.stat().st_size // 1000} kB)")


def watch_recording(recording: Path, video: Path) -> None:
    """Write a video of a recording and print its size."""
    from marl_airhockey.play.replay import one_episode
    from marl_airhockey.rollouts.replay import Replay
    from marl_airhockey.rollouts.watch import write_replay

    write_replay(Replay(one_episode(recording)), video)
    console.print(f"wrote {video} ({video.stat().st_size // 1000} kB)")

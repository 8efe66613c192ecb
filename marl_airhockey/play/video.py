"""Videos of recordings."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from marl_airhockey.data.columns import memories_of, scenario_of, states_of
from marl_airhockey.play.replay import one_episode
from marl_airhockey.render.picture import Frame, draw
from marl_airhockey.render.renderer import Renderer
from marl_airhockey.render.video import width_of, write_video

RATE = 30.0
"""Most pictures a second"""


def write_recording_video(
    recording: Path, video: Path, width: int | None = None, number: int = 0
) -> None:
    """Write a video of a recorded episode, drawn as `airhockey watch` draws a game.

    Args:
        recording: its file.
        video: the file to write, .gif, .webp or .mp4.
        width: Width of the pictures, px; None for that of the kind of file.
        number: of the episode in the file.

    Raises:
        ValueError: no recording, no such episode, or a video with another
            ending.
    """
    width = width or width_of(video)
    found, episode = one_episode(recording, number)
    scenario = scenario_of(found)
    states, memories = states_of(episode, scenario), memories_of(episode)
    success = episode.columns["success"]
    dt, cycles = found.head["control_dt"], found.head["max_cycles"]
    every = max(round(1.0 / (RATE * dt)), 1)
    pictures = []
    for n in range(every, len(episode) + 1, every):
        state = states.map(lambda x, n=n: x[n])  # type: ignore[misc]
        memory = {name: value[n] for name, value in memories.items()}
        eliminated = scenario.eliminated(memory)
        trails = states.puck[max(n + 1 - Renderer.TRAIL, 1) : n + 1]
        frame = Frame(
            scene=scenario.scene,
            state=state,
            marks=scenario.all_marks(state, memory),
            trails=[[(x, y) for x, y in trail] for trail in np.swapaxes(trails, 0, 1)],
            title=scenario.name.replace("_", " "),
            note=f"{scenario.caption(memory)}   {float(state.time):4.1f} s",
            clock=n / cycles,
            success=bool(success[n - 1].any()),
            eliminated=() if eliminated is None else eliminated.tolist(),
        )
        pictures.append(draw(frame, width))
    write_video(video, pictures, 1 / (every * dt))

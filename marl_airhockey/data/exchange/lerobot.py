"""Export of recordings as LeRobotDataset v3.0.

A frame contains the values before a step, the action, and its result (`next.*`). The
observation after the last step of an episode is a column of the table of episodes,
`final/NAME`, which LeRobot ignores. The video has one image per step: the newest frame
of a real table's camera at the start of the step, or an image of the table from above.

LeRobot computes its `timestamp` from the rate. The times that were measured on a real
table are further features, `TIMES`.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from marl_airhockey.data.exchange.lerobot_writer import (
    LeRobotWriter,
)
from marl_airhockey.data.exchange.seats import (
    agent_at,
    all_rows,
    check_seat,
    cut_off,
    episodes_with_steps,
    observations_of,
    playable,
)
from marl_airhockey.data.files import named_folder, shared_head, whole_folder
from marl_airhockey.data.film import FilmFrames, count_frames, film_gap
from marl_airhockey.make import parallel_env
from marl_airhockey.rollouts.replay import Replay
from marl_airhockey.sim.core.errors import require
from marl_airhockey.sim.core.geometry import products
from marl_airhockey.sim.core.recording import FILM, Columns, Episode, Recording
from marl_airhockey.sim.render.picture import draw
from marl_airhockey.sim.render.renderer import Renderer
from marl_airhockey.types import Array

WIDTH = 224
"""Width of a rendered image, pixels."""
STATE = ("position", "velocity", "angle", "spin")
"""Fields of the true state that form `observation.environment_state`."""
OBSERVATION, ACTION = "observation.state", "action"
TRUE_STATE = "observation.environment_state"
"""Feature of the true state."""
SENT, APPLIED = "sent_action", "applied_action"
"""Features with the command after all limits, and the resulting motion of the paddle,
both as actions."""
TIMES = {
    "captured_time": "device.captured",
    "received_time": "device.received",
    "observed_time": "device.moment",
}
"""Features with times before a step, by column, s, monotonic clock: exposure and
arrival of the newest frame, and time of the observation."""
APPLIED_TIME, APPLIED_AT = "applied_time", "device.applied"
"""Feature and column with the time at which the robot client began to execute the
action, s."""


def export_lerobot(
    files: Sequence[Path],
    name: str,
    root: Path | None = None,
    seat: int | None = 0,
    images: bool = False,
) -> Path:
    """Write recordings as a LeRobot dataset; return its folder.

    Args:
        files: Recordings of the same environment.
        name: Name of the dataset.
        root: Folder of all datasets; None for ``datasets``.
        seat: Index of the seat whose steps are written.
        images: True to render a video, if there is none of a camera, and to leave out
            the true state.

    Raises:
        ValueError: The dataset exists, no seat is given, the rate is not a whole
            number, or recordings have different environments or no steps.
    """
    require("pandas", "data")
    if seat is None:
        raise ValueError("--seat -1: a LeRobot dataset is of one seat; give its index")
    head = shared_head(files)
    rate = 1.0 / head["control_dt"]
    if abs(rate - round(rate)) > 1e-6:
        raise ValueError(
            f"control_dt {head['control_dt']}: LeRobot needs a whole number of frames "
            "per second"
        )
    final = named_folder(root, name)
    films = {path: path / FILM for path in files if (path / FILM).exists()}
    lengths = {path: count_frames(film) for path, film in films.items()}
    with whole_folder(final) as folder:
        form = _form(head, seat)
        writer = LeRobotWriter(folder, round(rate), form.names)
        film: FilmFrames | None = None
        for path, episode in episodes_with_steps(files):
            check_seat(episode, seat)
            gap = film_gap(path, episode, lengths[path]) if path in lengths else ""
            if gap:
                warnings.warn(f"{gap}; left out", RuntimeWarning, stacklevel=2)
                continue
            frames, last = _frames(path, episode, form)
            if images:  # A policy that sees images must not see the true state.
                frames.pop(TRUE_STATE, None)
            if path in films:
                # Frames are read in order, so that a video is decoded once.
                if film is None or film.path != films[path]:
                    film = FilmFrames(films[path])
                shown = _filmed(film, episode)
            else:
                shown = _rendered(path, episode, head) if images else iter(())
            writer.add(frames, last, _task(head), shown)
        if not writer.episodes:
            raise ValueError(f"{files[0]}: the video ends before every episode")
        ours = {**playable(head), "scenario": head["scenario"], "seat": seat}
        writer.close({**ours, "backend": head["backend"]})
    return final


def _task(head: Mapping[str, Any]) -> str:
    return f"air hockey: {head['scenario'].replace('_', ' ')}"


class _Form(NamedTuple):
    """Form of the frames of one seat."""

    seat: int
    names: dict[str, list[str]]
    """Names of the elements of each feature."""
    rotation: Array
    """Rotation (2, 2) from the table frame to the seat's ego frame."""


def _form(head: Mapping[str, Any], seat: int) -> _Form:
    names = {name: ["x", "y"] for name in (ACTION, SENT, APPLIED)}
    with closing(parallel_env(head["scenario"], **playable(head))) as env:
        scene = env.world.scene
        if "goals" not in head:
            agent = agent_at(env.possible_agents, seat)
            names[OBSERVATION] = list(env.observation_labels(agent))
    return _Form(seat, names, scene.table.rotation(scene.seats[seat].side))


def _frames(path: Path, episode: Episode, form: _Form) -> tuple[Columns, Columns]:
    """Return the features (T, ...) of an episode and its last observation."""
    columns, seat, shown = episode.columns, form.seat, {}
    for part, values in observations_of(path, episode).items():
        name = OBSERVATION if part in ("", "observation") else f"observation.{part}"
        shown[name] = values[:, seat].astype(np.float32)
    ended, truncated = cut_off(episode)
    frames = {
        **{name: values[:-1] for name, values in shown.items()},
        **_state(episode),
        ACTION: columns["action"][:, seat].astype(np.float32),
        **_motion(episode, form),
        "next.reward": columns["reward"][:, seat].astype(np.float32),
        "next.success": columns["success"][:, seat].astype(bool),
        "next.terminated": ended,
        "next.truncated": truncated,
        "next.done": ended | truncated,
        **_times(episode),
    }
    return frames, {name: values[-1] for name, values in shown.items()}


def _state(episode: Episode) -> Columns:
    """Return the true state (T, D) before each step, if it was recorded."""
    states = [
        all_rows(episode, f"state.{name}")[:-1]
        for name in STATE
        if f"state.{name}" in episode.columns
    ]
    if not states:
        return {}
    flat = [values.reshape(len(values), -1) for values in states]
    return {TRUE_STATE: np.concatenate(flat, 1, dtype=np.float32)}


def _motion(episode: Episode, form: _Form) -> Columns:
    """Return what was sent and what the paddle did (T, 2), as actions.

    On a real table, the arm reports the velocity of the paddle.
    """
    sources = {SENT: "command", APPLIED: "state.velocity"}
    return {
        name: (
            products(episode.columns[column][:, form.seat], form.rotation)
            / episode.physics["paddle_speed"]
        ).astype(np.float32)
        for name, column in sources.items()
        if column in episode.columns and "paddle_speed" in episode.physics
    }


def _times(episode: Episode) -> Columns:
    """Return the times of a real table (T,), s, as far as they were recorded."""
    columns = episode.columns
    times = {
        name: all_rows(episode, column)[:-1]
        for name, column in TIMES.items()
        if column in columns and column in episode.first
    }
    if APPLIED_AT in columns:
        times[APPLIED_TIME] = columns[APPLIED_AT]
    return {name: values for name, values in times.items() if np.isfinite(values).all()}


def _filmed(film: FilmFrames, episode: Episode) -> Iterator[Array]:
    """Yield the newest frame of a camera before each step, RGB."""
    if "frame" in episode.columns:
        shown = [episode.first["frame"][None], episode.columns["frame"]]
        for number in np.maximum(np.concatenate(shown)[:-1], 0):
            yield film.picture(int(number))[..., ::-1]


def _rendered(path: Path, episode: Episode, head: dict[str, Any]) -> Iterator[Array]:
    """Yield an image of the table before each step, RGB."""
    replay = Replay(Recording(path, head, [episode]))
    renderer = Renderer(replay.world, "rgb_array", "")
    replay.begin()
    for t in range(len(episode)):
        yield table_image(renderer)
        replay.step(t)


def table_image(renderer: Renderer, width: int = WIDTH) -> Array:
    """Return an image (H, W, 3) uint8 RGB of the table, without texts and trails."""
    return draw(replace(renderer.frame(), trails=()), width, bar=0)

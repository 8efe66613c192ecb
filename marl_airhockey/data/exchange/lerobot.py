"""Export of recordings as LeRobotDataset v3.0.

A frame contains the values before a step, the action, and its result (`next.*`). The
observation after the last step of an episode is a column of the table of episodes,
`final/NAME`, which LeRobot ignores. The video of a real table has one image per step:
the newest camera frame at the start of the step.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.data.exchange.lerobot_writer import (
    LeRobotWriter,
)
from marl_airhockey.data.exchange.seats import (
    agent_at,
    check_seat,
    cut_off,
    episodes_with_steps,
    observations_of,
    playable,
)
from marl_airhockey.data.files import named_folder, shared_head, whole_folder
from marl_airhockey.data.film import count_frames, film_gap
from marl_airhockey.make import parallel_env
from marl_airhockey.sim.core.errors import require
from marl_airhockey.sim.core.recording import FILM, Columns, Episode
from marl_airhockey.types import Array

STATE = ("position", "velocity", "angle", "spin")
"""Fields of the true state that form `observation.environment_state`."""
OBSERVATION, ACTION = "observation.state", "action"


def export_lerobot(
    files: Sequence[Path], name: str, root: Path | None = None, seat: int | None = 0
) -> Path:
    """Write recordings as a LeRobot dataset; return its folder.

    Args:
        files: Recordings of the same environment.
        name: Name of the dataset.
        root: Folder of all datasets; None for ``datasets``.
        seat: Index of the seat whose steps are written.

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
        writer = LeRobotWriter(folder, round(rate), _names(head, seat))
        for path, episode in episodes_with_steps(files):
            check_seat(episode, seat)
            gap = film_gap(path, episode, lengths[path]) if path in lengths else ""
            if gap:
                warnings.warn(f"{gap}; left out", RuntimeWarning, stacklevel=2)
                continue
            frames, last = _frames(path, episode, seat)
            writer.add(frames, last, _task(head), *_film(path, episode))
        if not writer.episodes:
            raise ValueError(f"{files[0]}: the video ends before every episode")
        ours = {**playable(head), "scenario": head["scenario"], "seat": seat}
        writer.close({**ours, "backend": head["backend"]})
    return final


def _task(head: Mapping[str, Any]) -> str:
    return f"air hockey: {head['scenario'].replace('_', ' ')}"


def _names(head: Mapping[str, Any], seat: int) -> dict[str, list[str]]:
    """Return the names of the elements of each feature."""
    names = {ACTION: ["x", "y"], "applied_action": ["x", "y"]}
    if "goals" not in head:
        env = parallel_env(head["scenario"], **playable(head))
        labels = env.observation_labels(agent_at(env.possible_agents, seat))
        names[OBSERVATION] = list(labels)
        env.close()
    return names


def _frames(path: Path, episode: Episode, seat: int) -> tuple[Columns, Columns]:
    """Return the features (T, ...) of an episode and its last observation."""
    columns, shown = episode.columns, {}
    for part, values in observations_of(path, episode).items():
        name = OBSERVATION if part in ("", "observation") else f"observation.{part}"
        shown[name] = values[:, seat].astype(np.float32)
    state = [
        np.concatenate([episode.first[f"state.{n}"][None], columns[f"state.{n}"][:-1]])
        for n in STATE
        if f"state.{n}" in columns
    ]
    if state:
        flat = [values.reshape(len(values), -1) for values in state]
        known = {"observation.environment_state": np.concatenate(flat, 1)}
    else:
        known = {}
    ended, truncated = cut_off(episode)
    frames = {
        **{name: values[:-1] for name, values in shown.items()},
        **{name: values.astype(np.float32) for name, values in known.items()},
        ACTION: columns["action"][:, seat].astype(np.float32),
        "next.reward": columns["reward"][:, seat].astype(np.float32),
        "next.success": columns["success"][:, seat].astype(bool),
        "next.terminated": ended,
        "next.truncated": truncated,
        "next.done": ended | truncated,
    }
    if "applied_action" in columns:
        frames["applied_action"] = columns["applied_action"][:, seat].astype(np.float32)
    if "device.moment" in columns:
        frames["measured_time"] = columns["device.moment"]
    return frames, {name: values[-1] for name, values in shown.items()}


def _film(path: Path, episode: Episode) -> tuple[Path, Array] | tuple[()]:
    """Return the video of an episode and the number of its frame for each step (T,)."""
    if "frame" not in episode.columns or not (path / FILM).exists():
        return ()
    shown = np.concatenate([episode.first["frame"][None], episode.columns["frame"]])
    return path / FILM, np.maximum(shown[:-1], 0)

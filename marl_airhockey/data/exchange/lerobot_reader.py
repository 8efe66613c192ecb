"""Import of LeRobotDataset v3.0 as recordings."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.data.exchange.lerobot import ACTION, OBSERVATION
from marl_airhockey.data.exchange.lerobot_writer import (
    CODE,
    DATA,
    EPISODES,
    FINAL,
    INFO,
    OURS,
)
from marl_airhockey.data.exchange.seats import check_shapes
from marl_airhockey.data.exchange.settings import ImportSettings
from marl_airhockey.data.parquet import read_table
from marl_airhockey.data.writer import whole_recording
from marl_airhockey.sim.core.recording import PLAYED, Columns
from marl_airhockey.types import Array

NEEDED = (OBSERVATION, ACTION, "next.reward", "next.done")
"""Features that a dataset must have for learning."""
INDICES = ("episode_index", "frame_index")
OPTIONAL = (
    *("observation.achieved_goal", "observation.desired_goal"),
    *("next.success", "next.terminated", "next.truncated"),
)
"""Optional features. Without `next.success` no step is a success."""


def import_lerobot(settings: ImportSettings) -> Path:
    """Write a LeRobot dataset v3.0 of one seat as a recording; return its path.

    If the observation after the last step of an episode is missing, the observation
    before this step is used.

    Raises:
        ValueError: The dataset has another version, or a feature is missing or differs
            in shape from that of the scenario.
    """
    folder = Path(settings.source)
    info = _json(folder / INFO)
    if info.get("codebase_version") != CODE:
        raise ValueError(
            f"{folder}: version {info.get('codebase_version')!r}; expected {CODE!r}"
        )
    features = info.get("features", {})
    for name in NEEDED:
        if name not in features:
            raise ValueError(f"{folder}: the feature {name!r} is missing")
    known = _json(folder / OURS) if (folder / OURS).exists() else {}
    rate = info.get("fps")
    if not (isinstance(rate, (int, float)) and rate > 0):
        raise ValueError(f"{folder / INFO}: fps {rate!r}; expected a rate above 0")
    known.setdefault("control_dt", 1.0 / rate)
    head = settings.head("lerobot", known)
    parts = _parts(features)
    shapes = [tuple(features[name]["shape"]) for name in (OBSERVATION, ACTION)]
    check_shapes(str(folder), head, None if len(parts) > 1 else shapes[0], shapes[1])
    lengths, last = _episode_rows(folder, parts)
    with whole_recording(settings.out, head) as writer:
        for number, frames in _episodes(folder):
            first, columns = _columns(frames, parts, last.get(number, {}))
            for name, values in columns.items():
                if not np.isfinite(values).all():
                    raise ValueError(
                        f"{folder}: episode {number}: {name} is not finite"
                    )
            writer.begin(first, number)
            writer.add_rows(columns)
            writer.end(PLAYED)
            if lengths.pop(number, None) != len(columns["reward"]):
                raise ValueError(f"{folder}: episode {number}: frames are missing")
        if lengths or not writer.episodes:
            raise ValueError(f"{folder}: episodes are missing: {[*lengths][:5]}")
    return settings.out


def _json(file: Path) -> dict[str, Any]:
    """Return the contents of a JSON file.

    Raises:
        ValueError: The file cannot be read.
    """
    try:
        content = json.loads(file.read_text())
    except (OSError, ValueError) as error:
        raise ValueError(f"{file}: cannot be read: {error}") from error
    if not isinstance(content, dict):
        raise ValueError(f"{file}: expected an object, got {type(content).__name__}")
    return content


def _parts(features: Mapping[str, Any]) -> dict[str, str]:
    """Return the name of the column of observations for each feature."""
    goals = [f"observation.{name}" for name in ("achieved_goal", "desired_goal")]
    if all(name in features for name in goals):
        return {OBSERVATION: "observation.observation", **{n: n for n in goals}}
    return {OBSERVATION: "observation"}


def _episode_rows(
    folder: Path, parts: Mapping[str, str]
) -> tuple[dict[int, int], dict[int, dict[str, Array]]]:
    """Return lengths and last observations, by feature, of all episodes.

    Raises:
        ValueError: There is no table of episodes.
    """
    lengths, found = {}, {}
    names = ["episode_index", "length", *(f"{FINAL}{n}" for n in parts)]
    for file in sorted((folder / EPISODES).rglob("*.parquet")):
        for row in read_table(file, names).to_pylist():
            number = int(row.pop("episode_index"))
            lengths[number] = int(row.pop("length"))
            found[number] = {
                name.removeprefix(FINAL): np.array(value, np.float32)
                for name, value in row.items()
                if value is not None
            }
    if not lengths:
        raise ValueError(f"{folder / EPISODES}: it contains no table of episodes")
    return lengths, found


def _episodes(folder: Path) -> Iterator[tuple[int, Columns]]:
    """Yield the number and the features (T, ...) of each episode.

    Raises:
        ValueError: There are no data, or steps of an episode are missing.
    """
    files = sorted((folder / DATA).rglob("*.parquet"))
    if not files:
        raise ValueError(f"{folder / DATA}: it contains no *.parquet files")
    for file in files:
        table = read_table(file)
        for name in (*NEEDED, *INDICES):
            if name not in table.column_names:
                raise ValueError(f"{file}: the column {name!r} is missing")
        numbers = table["episode_index"].to_numpy()
        columns = {
            name: _numbers(file, name, table[name].to_pylist())
            for name in (*NEEDED, *INDICES, *OPTIONAL)
            if name in table.column_names
        }
        for number in dict.fromkeys(numbers.tolist()):
            rows = numbers == number
            frames = {name: values[rows] for name, values in columns.items()}
            if (frames["frame_index"] != np.arange(rows.sum())).any():
                raise ValueError(f"{file}: episode {number}: frames are missing")
            yield int(number), frames


def _numbers(file: Path, name: str, values: list[Any]) -> Array:
    """Return a column as an array.

    Raises:
        ValueError: A value is not a number, or lists have different lengths.
    """
    try:
        return np.array(values, np.float64)
    except (ValueError, TypeError) as error:
        raise ValueError(f"{file}: column {name!r}: {error}") from error


def _columns(
    frames: Columns, parts: Mapping[str, str], last: Mapping[str, Array]
) -> tuple[Columns, Columns]:
    """Return the values before the first step, and the columns (T, ...) after steps."""
    first, after = {}, {}
    for name, column in parts.items():
        shown = frames[name].astype(np.float32)
        end = last.get(name, shown[-1])
        shown = np.concatenate([shown, end[None]])[:, None]
        first[column], after[column] = shown[0], shown[1:]
    done = frames["next.done"].astype(bool)
    truncated = frames.get("next.truncated", np.zeros(len(done), bool)).astype(bool)
    reward = frames["next.reward"].astype(np.float64)[:, None]
    success = frames.get("next.success", np.zeros(len(done), bool)).astype(bool)
    return first, {
        **after,
        "action": frames[ACTION].astype(np.float64)[:, None],
        "reward": reward,
        "returns": np.cumsum(reward, axis=0),
        "success": success[:, None],
        "terminated": frames.get("next.terminated", done & ~truncated).astype(bool),
        "truncated": truncated,
    }

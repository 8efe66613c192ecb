"""HDF5 trajectories of the paper's authors, with a row for each control step.

A file `trajectory_data{i}.hdf5` has `train_vals` (T, 35): time, trajectory, step,
emergency stop, safety, pose, speed, force, acceleration, target pose, puck. Older files
have no puck (32 columns), or neither puck nor safety (31 columns, or 32 with a further
column). Poses are those of the tool in the robot's base frame. Its x axis points from
the table to the robot and past it. The puck is in the authors' table frame, whose x is
that of the robot plus `OFFSET`. Its third number is 1 where it was not detected. The
images `train_img` are not read.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.data.exchange.measured import (
    Measured,
    measured_head,
    recorded_scenario,
    scenario_for,
    write_measured,
)
from marl_airhockey.data.exchange.seats import (
    agent_at,
    all_rows,
    check_seat,
    episodes_with_steps,
)
from marl_airhockey.data.exchange.settings import ImportSettings
from marl_airhockey.data.files import named_folder, shared_head, whole_folder
from marl_airhockey.data.writer import whole_recording
from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.core.errors import require
from marl_airhockey.sim.core.recording import PLAYED, Columns, Episode
from marl_airhockey.types import Array

FIELDS = {
    "time": 1,
    "trajectory": 1,
    "step": 1,
    "emergency_stop": 1,
    "safe": 1,
    "pose": 6,
    "speed": 6,
    "force": 6,
    "acceleration": 3,
    "target_pose": 6,
    "puck": 3,
}
"""Number of columns of each field of `train_vals`."""
TAIL = "tail"
"""Field of the last ten columns of files with 32 columns and without safety."""
ALL = tuple(FIELDS)
LAYOUTS: dict[int, tuple[str, ...]] = {
    35: ALL,
    32: ALL[:-1],
    31: tuple(name for name in ALL[:-1] if name != "safe"),
}
"""Fields in the order of their columns, by the number of columns."""
OLDEST = (
    "time",
    "trajectory",
    "step",
    "emergency_stop",
    "pose",
    "speed",
    "force",
    TAIL,
)
"""Fields of files with 32 columns and without safety."""
ROBOT = "robot."
"""Prefix of the columns that contain the fields of a file unchanged."""
OFFSET = 1.2
"""Position of the authors' table frame along the x axis of the robot's base, m."""
HEIGHT, TOOL = 0.30, (0.0, np.pi, 0.0)
"""Height, m, and rotation vector, rad, of the tool on the table in exported files."""
FULL = np.array([0.26, 0.12])
"""Displacement of the target pose (2,), m, that corresponds to an action of 1."""
FILE = re.compile(r"trajectory_data(\d+)\.(hdf5|h5)$")
VALUES = "train_vals"


def import_trajectories(settings: ImportSettings) -> Path:
    """Write the authors' trajectories as a recording; return its path.

    `state.*` is in the table frame of this library. The fields of the file are stored
    unchanged as `robot.*`.

    Raises:
        ValueError: There are no files, or a file has other columns.
    """
    require("h5py", "offline")
    scenario, files = scenario_for(settings), trajectory_files(settings.source)
    tables = [(file, _read(file)) for file in files]
    steps = np.concatenate([np.diff(fields["time"][:, 0]) for _, fields in tables])
    control_dt = round(float(np.median(steps)), 3)
    if not control_dt > 0:
        raise ValueError(f"{settings.source}: times must increase")
    head = measured_head(settings, control_dt)
    with whole_recording(settings.out, head) as writer:
        for file, fields in tables:
            puck = fields.get("puck")
            found = Measured(
                time=fields["time"][:, 0],
                puck=_puck(file, puck) if puck is not None else None,
                paddle=-(fields["pose"][:, :2] + (OFFSET, 0.0)),
                paddle_velocity=-fields["speed"][:, :2],
                action=_actions(fields) @ _ego(scenario, 0).T,
            )
            raw = {ROBOT + name: values for name, values in fields.items()}
            stopped = fields["emergency_stop"].any()
            reason = "robot: emergency stop" if stopped else PLAYED
            try:
                write_measured(writer, scenario, found, raw, reason)
            except ValueError as error:
                raise ValueError(f"{file}: {error}") from error
    return settings.out


def trajectory_files(source: str) -> list[Path]:
    """Return a file, or the files of trajectories in a folder, sorted by number.

    Raises:
        ValueError: There are no files.
    """
    path = Path(source)
    files = [path] if path.is_file() else [*path.glob("trajectory_data*")]
    named = [(FILE.search(file.name), file) for file in files]
    numbered = sorted((int(found[1]), file) for found, file in named if found)
    if path.is_file():
        return [path]
    if not numbered:
        raise ValueError(f"{source}: it contains no trajectory_data*.hdf5 files")
    return [file for _, file in numbered]


def _read(file: Path) -> Columns:
    """Return the fields (T, n) of a file, by name.

    Raises:
        ValueError: The file cannot be read, or has other columns.
    """
    import h5py

    try:
        with h5py.File(file) as opened:
            values = np.asarray(opened[VALUES], np.float64)
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{file}: cannot be read: no {VALUES} ({error})") from error
    columns = values.shape[1] if values.ndim == 2 else 0
    if columns not in LAYOUTS or len(values) < 2:
        raise ValueError(
            f"{file}: {VALUES} has the shape {values.shape}; expected at least two "
            f"rows of {' or '.join(map(str, LAYOUTS))} columns"
        )
    if not np.isfinite(values).all():
        row = int(np.flatnonzero(~np.isfinite(values).all(1))[0])
        raise ValueError(f"{file}: row {row} is not finite")
    names = LAYOUTS[columns]
    if columns == 32 and not np.isin(values[:, 4], (0.0, 1.0)).all():
        names = OLDEST  # The column of safety contains a coordinate.
    ends = np.cumsum([FIELDS.get(name, 10) for name in names])[:-1]
    return dict(zip(names, np.split(values, ends, axis=1), strict=True))


def _puck(file: Path, values: Array) -> Array:
    """Return positions of the puck (T, 2), table frame, m; nan if not detected.

    Some files have the puck in the robot's frame, or a flag that is 1 where it *was*
    detected. A puck that was not detected does not move, which distinguishes the flags.
    """
    place, hidden = values[:, :2].copy(), values[:, 2] > 0.5
    moved = np.append(True, (np.diff(place, axis=0) != 0).any(1))
    if moved[1:].any() and hidden[1:][moved[1:]].mean() > 0.5:
        hidden = ~hidden
    shown = place[~hidden]
    if not len(shown):
        raise ValueError(f"{file}: the puck is never detected")
    if np.median(shown[:, 0]) < -1.0:
        place[:, 0] += OFFSET
    place[hidden] = np.nan
    return -place


def _actions(fields: Columns) -> Array:
    """Return actions (T - 1, 2) in the table frame, with the authors' scaling."""
    gap = _target(fields)[:-1, :2] - fields["pose"][:-1, :2]
    return np.asarray(np.clip(-gap / FULL, -1.0, 1.0))


def _target(fields: Columns) -> Array:
    """Return target poses (T, 6); in a tail, the columns that are closest to poses."""
    if TAIL not in fields:
        return fields["target_pose"]
    tail, pose = fields[TAIL], fields["pose"]
    places = [tail[:, at : at + 6] for at in range(5)]
    return min(places, key=lambda each: float(np.abs(each - pose).mean()))


def _ego(scenario: Scenario, seat: int) -> Array:
    """Return the rotation (2, 2) from the table frame to a seat's ego frame."""
    scene = scenario.scene
    return np.asarray(scene.table.rotation(scene.seats[seat].side))


def export_trajectories(
    files: Sequence[Path], name: str, root: Path | None = None, seat: int | None = 0
) -> Path:
    """Write recordings as the authors' trajectories; return their folder.

    Fields that were imported from such files are written unchanged. Otherwise they are
    computed from the true state, with force and acceleration 0.

    Raises:
        ValueError: The folder exists, no seat is given, there is no puck, or recordings
            have different environments or no steps.
    """
    require("h5py", "offline")
    import h5py

    if seat is None:
        raise ValueError("--seat -1: a trajectory is of one paddle; give its seat")
    head, final = shared_head(files), named_folder(root, name)
    with whole_folder(final) as folder:
        scenario = recorded_scenario(files[0], head)
        agent_at([f"paddle_{k}" for k in range(len(scenario.scene.seats))], seat)
        rotation = _ego(scenario, seat)
        for k, (_, episode) in enumerate(episodes_with_steps(files)):
            check_seat(episode, seat)
            fields = _kept_fields(episode) or _fields(k, episode, seat, rotation)
            values = np.concatenate([*fields.values()], axis=1)
            with h5py.File(folder / f"trajectory_data{k}.hdf5", "w") as opened:
                compressed: dict[str, Any] = {"compression": "gzip"}
                opened.create_dataset(VALUES, data=values, **compressed)
    return final


def _kept_fields(episode: Episode) -> Columns:
    """Return the fields (T + 1, n) of the imported file of an episode, if any."""
    names = [n for n in (*FIELDS, TAIL) if ROBOT + n in episode.columns]
    return {name: all_rows(episode, ROBOT + name) for name in names}


def _fields(number: int, episode: Episode, seat: int, rotation: Array) -> Columns:
    """Return the fields (T + 1, n) that are computed from the states of an episode."""
    position = all_rows(episode, "state.position")
    velocity = all_rows(episode, "state.velocity")
    action = np.concatenate([episode.columns["action"][:, seat], np.zeros((1, 2))])
    seats = episode.columns["action"].shape[1]
    rows = len(position)
    one, zero = np.ones((rows, 1)), np.zeros((rows, 1))
    upright = np.tile([HEIGHT, *TOOL], (rows, 1))
    flat = -position[:, seat] - (OFFSET, 0.0)
    target = flat - FULL * (action @ rotation)
    return {
        "time": all_rows(episode, "state.time")[:, None],
        "trajectory": number * one,
        "step": np.arange(rows)[:, None] * one,
        "emergency_stop": zero,
        "safe": one,
        "pose": np.hstack([flat, upright]),
        "speed": np.hstack([-velocity[:, seat], np.zeros((rows, 4))]),
        "force": np.zeros((rows, 6)),
        "acceleration": np.zeros((rows, 3)),
        "target_pose": np.hstack([target, upright]),
        "puck": np.hstack([-position[:, seats], zero]),
    }

"""Read the paper's trajectories, or ours in the same format, only with h5py.

    airhockey data export airhockey/juggle/expert-v0 --to hdf5 --name juggle --out sets
    python scripts/tutorials/with_h5py.py sets/juggle

Poses are in the base frame of the robot, whose x axis points from the table to the
robot.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import h5py
import numpy as np
import typer

POSE, TARGET, PUCK = slice(5, 11), slice(26, 32), slice(32, 35)
"""Columns of `train_vals` in files with 35 columns."""
FULL = np.array([0.26, 0.12])
"""Displacement of an action of 1, m, (2,)."""


def main(
    folder: Annotated[Path, typer.Argument(help="Folder of trajectory_data*.hdf5.")],
) -> None:
    """Print a summary of the files."""
    paddles, actions, pucks = [], [], []
    files = sorted(folder.glob("trajectory_data*.hdf5"))
    for path in files:
        with h5py.File(path) as file:
            values = np.asarray(file["train_vals"])
        paddles.append(values[:-1, POSE][:, :2])
        actions.append((values[:-1, TARGET] - values[:-1, POSE])[:, :2] / FULL)
        pucks.append(values[:-1, PUCK])
    paddle, action, puck = map(np.concatenate, (paddles, actions, pucks))
    print(f"{len(files)} trajectories, {len(paddle)} steps")
    print(f"paddle, base frame: {paddle.min(0).round(3)} .. {paddle.max(0).round(3)} m")
    print(f"actions: {action.min(0).round(3)} .. {action.max(0).round(3)}")
    print(f"puck hidden in {puck[:, 2].mean():.1%} of the steps")


if __name__ == "__main__":
    typer.run(main)

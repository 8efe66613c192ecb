"""Read a LeRobot dataset of this library only with pyarrow and pandas.

    airhockey data export airhockey/reach/expert-v0 --to lerobot --name reach --out sets
    python scripts/tutorials/with_lerobot_files.py sets/reach

With lerobot (Python 3.12, in a separate environment) the same folder is loaded by
`LeRobotDataset("reach", root="sets/reach")`.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer


def main(
    folder: Annotated[Path, typer.Argument(help="Folder of the dataset.")],
) -> None:
    """Print a summary of a dataset."""
    info = json.loads((folder / "meta/info.json").read_text())
    frames = pd.read_parquet(folder / "data")
    episodes = pd.read_parquet(folder / "meta/episodes")
    tasks = pd.read_parquet(folder / "meta/tasks.parquet")
    print(f"{info['total_episodes']} episodes, {len(frames)} frames, {info['fps']} fps")
    for name, feature in info["features"].items():
        print(f"  {name}: {feature['dtype']} {feature['shape']}")
    state = np.stack(frames["observation.state"])
    action = np.stack(frames["action"])
    print(f"observations {state.shape}, actions {action.shape}")
    returns = frames.groupby("episode_index")["next.reward"].sum()
    success = frames.groupby("episode_index")["next.success"].last()
    length = episodes["length"].mean()
    print(f"task: {tasks.index[0]}")
    print(
        f"success {success.mean():.3f}, return {returns.mean():.2f}, "
        f"length {length:.1f}"
    )


if __name__ == "__main__":
    typer.run(main)

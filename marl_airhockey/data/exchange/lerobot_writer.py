"""Writer of the files of a LeRobotDataset v3.0.

The layout is that of lerobot's `datasets` package, version v3.0: tables of frames with
a row group for each episode, tables of episodes and tasks, statistics, and videos.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.sim.core.recording import Columns
from marl_airhockey.sim.render.mp4 import Mp4Writer
from marl_airhockey.types import Array

CODE = "v3.0"
"""Version of the format."""
INFO, STATS, TASKS = "meta/info.json", "meta/stats.json", "meta/tasks.parquet"
EPISODES, DATA, OURS = "meta/episodes", "data", "meta/marl_airhockey.json"
CHUNK = "chunk-{chunk_index:03d}/file-{file_index:03d}"
CAMERA = "observation.images.table"
"""Feature of the table's camera."""
FINAL = "final/"
"""Prefix of the columns of episodes that contain a last observation."""
FILES, DATA_MB, VIDEO_MB = 1000, 100, 200
"""Number of files in a chunk, and sizes above which a new file is started, MB."""
QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
KEYS = ("frame_index", "episode_index", "index", "task_index")
"""Integer features of all datasets."""
SAMPLED = 20
"""Number of images per episode for the statistics of its video."""
Stats = dict[str, list[Any]]


class LeRobotWriter:
    """Writer of a dataset.

    Args:
        folder: Empty folder of the dataset.
        rate: Frame rate, frames/s.
        names: Names of the elements of each feature.
    """

    def __init__(self, folder: Path, rate: int, names: dict[str, list[str]]) -> None:
        self._folder, self._rate, self._names = folder, rate, names
        self._features: dict[str, dict[str, Any]] = {}
        self._tasks: list[str] = []
        self._rows: list[dict[str, Any]] = []
        self._values: list[Columns] = []
        self._frames = self._file = 0
        self._table: Any = None

    @property
    def episodes(self) -> int:
        """Number of episodes that were added."""
        return len(self._rows)

    def add(
        self,
        frames: Columns,
        last: Columns,
        task: str,
        images: Iterable[Array] = (),
    ) -> None:
        """Add an episode.

        Args:
            frames: Features (T, ...) by name.
            last: Observations after the last step, by name.
            task: Description of the task.
            images: Image (H, W, 3) uint8 RGB before each step; none for no video.
        """
        count, number = len(next(iter(frames.values()))), len(self._rows)
        if task not in self._tasks:
            self._tasks.append(task)
        index = np.arange(count)
        frames = {
            **frames,
            "timestamp": (index / self._rate).astype(np.float32),
            "frame_index": index,
            "episode_index": np.full(count, number),
            "index": self._frames + index,
            "task_index": np.full(count, self._tasks.index(task)),
        }
        stats = {name: _stats(values) for name, values in frames.items()}
        row = {
            "episode_index": number,
            "tasks": [task],
            "length": count,
            "data/chunk_index": self._file // FILES,
            "data/file_index": self._file % FILES,
            "dataset_from_index": self._frames,
            "dataset_to_index": self._frames + count,
            "meta/episodes/chunk_index": 0,
            "meta/episodes/file_index": 0,
            **{f"{FINAL}{name}": value.tolist() for name, value in last.items()},
        }
        if video := self._add_video(number, count, images):
            stats[CAMERA] = video
            row |= {
                f"videos/{CAMERA}/chunk_index": number // FILES,
                f"videos/{CAMERA}/file_index": number % FILES,
                f"videos/{CAMERA}/from_timestamp": 0.0,
                f"videos/{CAMERA}/to_timestamp": count / self._rate,
            }
        for name, found in stats.items():
            row |= {f"stats/{name}/{stat}": value for stat, value in found.items()}
        self._write_frames(frames)
        self._rows.append(row)
        self._values.append(frames)
        self._frames += count

    def _write_frames(self, frames: Columns) -> None:
        """Write an episode as a row group; close the file if it is full."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        arrays = {}
        for name, values in frames.items():
            flat = values.reshape(len(values), -1)
            size = flat.shape[1]
            self._features.setdefault(name, self._feature(name, values.dtype, size))
            column = pa.array(np.ascontiguousarray(flat).reshape(-1))
            if size > 1:
                column = pa.FixedSizeListArray.from_arrays(column, size)
            arrays[name] = column
        table = pa.table(arrays)
        if self._table is None:
            path = self._path(DATA, self._file, "parquet")
            self._table = pq.ParquetWriter(path, table.schema, compression="snappy")
            self._open = path
        self._table.write_table(table, row_group_size=len(table))
        if self._open.stat().st_size > DATA_MB * 1e6:
            self._table.close()
            self._table, self._file = None, self._file + 1

    def _feature(self, name: str, dtype: Any, size: int) -> dict[str, Any]:
        """Return the description of a feature."""
        return {"dtype": str(dtype), "shape": [size], "names": self._names.get(name)}

    def _path(self, part: str, number: int, suffix: str) -> Path:
        """Return the path of a file with a number; create its folder."""
        where = CHUNK.format(chunk_index=number // FILES, file_index=number % FILES)
        path = self._folder / part / f"{where}.{suffix}"
        path.parent.mkdir(parents=True, exist_ok=True)
        return path

    def _add_video(self, number: int, count: int, images: Iterable[Array]) -> Stats:
        """Write the video of an episode; return the statistics of its images.

        The result is empty if there are no images.
        """
        writer, some = None, list[Array]()
        for k, image in enumerate(images):
            if writer is None:
                height, width = (2 * (size // 2) for size in image.shape[:2])
                self._features[CAMERA] = _video(height, width, self._rate)
                path = self._path(f"videos/{CAMERA}", number, "mp4")
                writer = Mp4Writer(path, self._rate)
            writer.append(image)
            if k % max(count // SAMPLED, 1) == 0:
                some.append(image[::4, ::4].reshape(-1, 3) / 255.0)
        if writer is None:
            return {}
        writer.close()
        found = _stats(np.concatenate(some))
        # Statistics of images have the channels first and one value for all pixels.
        lists = {n: [[[x]] for x in v] for n, v in found.items() if n != "count"}
        return {**lists, "count": [count]}

    def close(self, ours: dict[str, Any]) -> None:
        """Write tables of episodes and tasks, statistics and `info.json`.

        Args:
            ours: Contents of a further file, from which an import reads the scenario.
        """
        import pandas as pd
        import pyarrow as pa
        import pyarrow.parquet as pq

        if self._table is not None:
            self._table.close()
        episodes = self._path(EPISODES, 0, "parquet")
        pq.write_table(pa.Table.from_pylist(self._rows), episodes)
        index = pd.Index(self._tasks, name="task")
        tasks = pd.DataFrame({"task_index": range(len(self._tasks))}, index=index)
        tasks.to_parquet(self._folder / TASKS)
        names = self._values[0]
        stats = {n: _stats(np.concatenate([v[n] for v in self._values])) for n in names}
        if CAMERA in self._features:
            rows = [
                {k.rpartition("/")[2]: v for k, v in row.items() if _of_camera(k)}
                for row in self._rows
            ]
            stats[CAMERA] = _joined(rows)
        self._write_json(STATS, stats)
        self._write_json(OURS, ours)
        self._write_json(INFO, self._info())

    def _info(self) -> dict[str, Any]:
        video = CAMERA in self._features
        return {
            "codebase_version": CODE,
            "robot_type": "air_hockey_paddle",
            "total_episodes": len(self._rows),
            "total_frames": self._frames,
            "total_tasks": len(self._tasks),
            "chunks_size": FILES,
            "data_files_size_in_mb": DATA_MB,
            "video_files_size_in_mb": VIDEO_MB,
            "fps": self._rate,
            "splits": {"train": f"0:{len(self._rows)}"},
            "data_path": f"{DATA}/{CHUNK}.parquet",
            "video_path": f"videos/{{video_key}}/{CHUNK}.mp4" if video else None,
            "features": self._features,
        }

    def _write_json(self, name: str, content: Any) -> None:
        (self._folder / name).write_text(json.dumps(content, indent=1) + "\n")


def _of_camera(column: str) -> bool:
    return column.startswith(f"stats/{CAMERA}/")


def _stats(values: Array) -> Stats:
    """Return the statistics of the values (T, ...) of a feature."""
    flat = np.asarray(values, np.float64).reshape(len(values), -1)
    found = {
        "min": flat.min(0),
        "max": flat.max(0),
        "mean": flat.mean(0),
        "std": flat.std(0),
        **{name: np.quantile(flat, share, axis=0) for name, share in QUANTILES.items()},
    }
    return {n: v.tolist() for n, v in found.items()} | {"count": [len(flat)]}


def _joined(rows: list[Stats]) -> Stats:
    """Return the statistics of all videos; quantiles are means over episodes."""
    count = np.array([row["count"][0] for row in rows], np.float64)
    share = (count / count.sum())[:, None, None, None]
    each = {n: np.array([row[n] for row in rows]) for n in rows[0] if n != "count"}
    mean = (share * each["mean"]).sum(0)
    spread = (share * (each["std"] ** 2 + (each["mean"] - mean) ** 2)).sum(0)
    found = {n: (share * each[n]).sum(0) for n in QUANTILES}
    found |= {"min": each["min"].min(0), "max": each["max"].max(0)}
    found |= {"mean": mean, "std": np.sqrt(spread)}
    return {n: v.tolist() for n, v in found.items()} | {"count": [int(count.sum())]}


def _video(height: int, width: int, rate: int) -> dict[str, Any]:
    """Return the description of the feature of a video."""
    return {
        "dtype": "video",
        "shape": [height, width, 3],
        "names": ["height", "width", "channels"],
        "info": {
            "video.height": height,
            "video.width": width,
            "video.codec": "h264",
            "video.pix_fmt": "yuv420p",
            "video.is_depth_map": False,
            "video.fps": rate,
            "video.channels": 3,
            "has_audio": False,
        },
    }

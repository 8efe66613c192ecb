"""Export of recordings as Minari datasets, and import of Minari datasets.

A dataset contains the steps of one seat, as offline learners need them. A dataset of
all seats has observations and actions as dictionaries by agent.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import tempfile
import warnings
from collections.abc import Iterator, Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np

from marl_airhockey.data.benchmark.catalogue import PROFILE
from marl_airhockey.data.benchmark.content import references
from marl_airhockey.data.exchange.seats import (
    check_seat,
    check_shapes,
    cut_off,
    episodes_with_steps,
    observations_of,
    playable,
    spaces_of,
)
from marl_airhockey.data.exchange.settings import ImportSettings
from marl_airhockey.data.files import shared_head
from marl_airhockey.data.writer import RecordingWriter, whole_recording
from marl_airhockey.discovery import gymnasium_id
from marl_airhockey.sim.core.errors import require
from marl_airhockey.sim.core.recording import PLAYED, Episode
from marl_airhockey.types import Array

if TYPE_CHECKING:
    from minari.data_collector import EpisodeBuffer

NAME = re.compile(r"^(\w[-\w]*\w/)*[-\w]+-v\d+$")
"""Pattern of a dataset's name, for example airhockey/juggle/expert-v0."""
STATE = ("position", "velocity", "angle", "spin")
"""Fields of the true state in the infos."""
ROOT = "MINARI_DATASETS_PATH"
"""Environment variable with the folder of Minari's datasets."""


def export_minari(
    files: Sequence[Path],
    name: str,
    root: Path | None = None,
    seat: int | None = 0,
) -> Path:
    """Write recordings as a Minari dataset; return its folder.

    The folder exists only when it is complete.

    Args:
        files: Recordings of the same environment.
        name: Name of the dataset, for example airhockey/juggle/expert-v0.
        root: Folder of all datasets; None for Minari's own folder.
        seat: Index of the seat whose steps are written; None for all seats, by agent.

    Raises:
        ValueError: The name is not valid for Minari, the dataset exists, or recordings
            have different environments or no steps.
    """
    require("minari", "offline")
    if not NAME.match(name):
        raise ValueError(
            f"--name {name!r}: expected a name such as airhockey/juggle/test-v0"
        )
    root = root or Path(os.environ.get(ROOT, Path.home() / ".minari" / "datasets"))
    root = root.resolve()  # Minari resolves relative paths in its own folder.
    final = root / name
    if final.exists():
        raise ValueError(f"{final}: this dataset exists; give a new version")
    head = shared_head(files)
    buffers = [
        _buffer(k, path, episode, seat)
        for k, (path, episode) in enumerate(episodes_with_steps(files))
    ]
    root.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=root, prefix=".part-") as part:
        with _at(Path(part)):
            _write(name, buffers, head, seat)
        final.parent.mkdir(parents=True, exist_ok=True)
        shutil.move(str(Path(part) / name), final)
    return final


@contextlib.contextmanager
def _at(root: Path) -> Iterator[None]:
    """Set the folder of Minari's datasets in this context."""
    before = os.environ.get(ROOT)
    os.environ[ROOT] = str(root)
    try:
        yield
    finally:
        if before is None:
            del os.environ[ROOT]
        else:
            os.environ[ROOT] = before


def _write(
    name: str, buffers: list[EpisodeBuffer], head: dict[str, Any], seat: int | None
) -> None:
    import minari

    observed, acted = spaces_of(head, seat)
    players = ", ".join(str(row.get("driver")) for row in head.get("players", []))
    version = metadata.version("marl_airhockey")
    low, high = _references(head)
    with warnings.catch_warnings():
        # Minari warns about missing fields; here, the author's e-mail is missing.
        warnings.simplefilter("ignore")
        minari.create_dataset_from_buffers(
            name,
            buffer=buffers,
            env=_env_spec(head, seat),
            observation_space=observed,
            action_space=acted,
            algorithm_name=players or "unknown",
            author="marl_airhockey",
            code_permalink=f"marl_airhockey=={version}",
            description=_description(head, seat),
            requirements=[f"marl_airhockey=={version}"],
            ref_min_score=low,
            ref_max_score=high,
            data_format="hdf5",
        )


def _references(head: Mapping[str, Any]) -> tuple[float | None, float | None]:
    """Return the mean returns of random actions and of the expert, if known."""
    usual = not head["options"] and head["profile"] == PROFILE
    return references().get(head["scenario"], (None, None)) if usual else (None, None)


def _description(head: Mapping[str, Any], seat: int | None) -> str:
    whose = "all seats, by agent" if seat is None else f"seat {seat}"
    return (
        f"Air hockey, {head['scenario']}, {whose}: recorded on {head.get('backend')} "
        f"in the {head.get('profile')} profile, {1.0 / head['control_dt']:.0f} steps "
        f"per second. Infos contain the true state, applied actions and success."
    )


def _env_spec(head: Mapping[str, Any], seat: int | None) -> Any:
    """Return the Gymnasium spec of a scenario of one seat; None for games."""
    if seat is None or len(head.get("players", [])) != 1:
        return None
    try:
        spec = gymnasium.spec(gymnasium_id(head["scenario"]))
    except ValueError:  # Scenarios of users have no id.
        return None
    return gymnasium.make(spec, **playable(head)).unwrapped.spec


def _buffer(
    number: int, path: Path, episode: Episode, seat: int | None
) -> EpisodeBuffer:
    """Return an episode in the form of Minari."""
    from minari.data_collector import EpisodeBuffer

    columns = episode.columns
    shown, acts = observations_of(path, episode), columns["action"]
    rewards = columns["reward"]
    ended, truncated = cut_off(episode)
    if seat is None:
        by_agent = [f"paddle_{k}" for k in range(acts.shape[1])]
        observations: Any = {a: _of(shown, k) for k, a in enumerate(by_agent)}
        actions: Any = {a: _single(acts[:, k]) for k, a in enumerate(by_agent)}
        reward = rewards.sum(1)
    else:
        check_seat(episode, seat)
        observations, actions = _of(shown, seat), _single(acts[:, seat])
        reward = rewards[:, seat]
    return EpisodeBuffer(
        id=number,
        seed=int(episode.seed or 0),
        observations=observations,
        actions=actions,
        rewards=[float(x) for x in reward],
        terminations=ended.tolist(),
        truncations=truncated.tolist(),
        infos=_infos(episode, seat),
    )


def _of(shown: dict[str, Array], seat: int) -> Any:
    parts = {name: _single(value[:, seat]) for name, value in shown.items()}
    return parts.get("", parts)


def _single(values: Array) -> Array:
    return np.ascontiguousarray(values, np.float32)


def _infos(episode: Episode, seat: int | None) -> dict[str, Any]:
    """Return the infos (T + 1, ...), which start with those of the reset."""
    found: dict[str, Any] = {"state": {}}
    for name in STATE:
        column = f"state.{name}"
        if column in episode.columns:
            parts = episode.first[column][None], episode.columns[column]
            found["state"][name] = np.concatenate(parts)
    for name in ("applied_action", "success", "reward"):
        if name in episode.columns:
            values = episode.columns[name]
            values = values if seat is None else values[:, seat]
            blank = np.zeros_like(values[:1])
            found[name] = np.concatenate([blank, values])
    return found


def import_minari(settings: ImportSettings) -> Path:
    """Write a Minari dataset of one seat as a recording; return its path.

    Raises:
        ValueError: The dataset does not exist, or its spaces differ from those of the
            scenario.
    """
    require("minari", "offline")
    import minari

    name, root = settings.source, settings.root
    with _at(root) if root else contextlib.nullcontext():
        try:
            dataset = minari.load_dataset(name)
        except FileNotFoundError as error:
            raise ValueError(f"{name}: this Minari dataset does not exist") from error
        except (OSError, ValueError, KeyError) as error:
            raise ValueError(f"{name}: Minari cannot read it: {error}") from error
        if "paddle_0" in getattr(dataset.observation_space, "spaces", {}):
            raise ValueError(
                f"{name}: it has several agents; export one agent with --seat"
            )
        spec = dataset.env_spec
        head = settings.head("minari", dict(spec.kwargs) if spec is not None else {})
        shapes = dataset.observation_space.shape, dataset.action_space.shape
        check_shapes(name, head, *shapes)
        with whole_recording(settings.out, head) as writer:
            for episode in dataset.iterate_episodes():
                _import_episode(writer, episode)
    return settings.out


def _import_episode(writer: RecordingWriter, episode: Any) -> None:
    """Write an episode of a dataset of one seat."""
    shown = {"observation": episode.observations}
    if isinstance(episode.observations, dict):
        shown = {f"observation.{k}": v for k, v in episode.observations.items()}
    seen: dict[str, Array] = {
        n: np.asarray(v, np.float32)[:, None] for n, v in shown.items()
    }
    reward: Array = np.asarray(episode.rewards, np.float64)[:, None]
    infos = episode.infos or {}
    success = np.asarray(infos.get("success", np.zeros(len(reward) + 1)), bool)
    for values in (*seen.values(), reward):
        if not np.isfinite(values).all():
            raise ValueError(f"episode {episode.id}: some numbers are not finite")
    writer.begin({n: v[0] for n, v in seen.items()}, int(episode.id))
    writer.add_rows(
        {
            **{n: v[1:] for n, v in seen.items()},
            "action": np.asarray(episode.actions, np.float64)[:, None],
            "reward": reward,
            "returns": np.cumsum(reward, axis=0),
            "success": success[1:, None],
            "terminated": np.asarray(episode.terminations, bool),
            "truncated": np.asarray(episode.truncations, bool),
        }
    )
    writer.end(PLAYED)

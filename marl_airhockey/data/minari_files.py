"""Minari: recordings as its datasets, and its datasets as recordings.

A dataset holds the steps of one seat, as offline learners want them; that of a whole
game has a dict of agents for observations and actions.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import tempfile
import warnings
from collections.abc import Iterator, Sequence
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from gymnasium import spaces

from marl_airhockey.core.errors import require
from marl_airhockey.core.recording import PLAYED, RecordedEpisode
from marl_airhockey.data.files import shared_head
from marl_airhockey.data.reader import episodes_of
from marl_airhockey.data.writer import RecordingWriter, whole_recording
from marl_airhockey.make import parallel_env
from marl_airhockey.registry import gymnasium_id
from marl_airhockey.types import Array

if TYPE_CHECKING:
    from minari.data_collector import EpisodeBuffer

NAME = re.compile(r"^([-\w]+/)*[-\w]+-v\d+$")
"""Form of a dataset's name, as airhockey/juggle/expert-v0"""
GOALS = ("observation", "achieved_goal", "desired_goal")
"""Parts of observations of goals="dict" """
STATE = ("position", "velocity", "angle", "spin")
"""Fields of the true state that are kept in the infos"""
ROOT = "MINARI_DATASETS_PATH"
"""Environment variable by which Minari finds its datasets"""


def export_minari(
    files: Sequence[Path], name: str, root: Path | None = None, seat: int | None = 0
) -> Path:
    """Write recordings as a Minari dataset; return its folder.

    It is there when it is whole, and not before.

    Args:
        files: recordings of one kind.
        name: of the dataset, as airhockey/juggle/expert-v0.
        root: folder of all datasets; None for Minari's own.
        seat: whose steps are taken; None for all, by agent.

    Raises:
        ValueError: a name that Minari does not take, a dataset that is there already,
            recordings that differ, or without steps.
    """
    require("minari", "offline")
    if not NAME.match(name):
        raise ValueError(f"--name {name!r}: expected it as in airhockey/juggle/test-v0")
    root = root or Path(os.environ.get(ROOT, Path.home() / ".minari" / "datasets"))
    final = root / name
    if final.exists():
        raise ValueError(f"{final}: there is such a dataset; take a new version")
    head = shared_head(files)
    buffers = [_buffer(k, episode, seat) for k, episode in enumerate(_episodes(files))]
    if not buffers:
        raise ValueError(f"{files[0]}: there are no steps in it")
    root.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=root, prefix=".part-") as part:
        with _at(Path(part)):
            _write(name, buffers, head, seat)
        final.parent.mkdir(parents=True, exist_ok=True)
        shutil.move(str(Path(part) / name), final)
    return final


def _episodes(files: Sequence[Path]) -> Iterator[RecordedEpisode]:
    for path in files:
        for episode in episodes_of(path):
            if len(episode):
                yield episode


@contextlib.contextmanager
def _at(root: Path) -> Iterator[None]:
    """Let Minari find its datasets in a folder."""
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

    observed, acted = _spaces(head, seat)
    players = ", ".join(str(row.get("driver")) for row in head.get("players", []))
    version = metadata.version("marl_airhockey")
    with warnings.catch_warnings():
        # It warns of each field that is left out: here, who to write to.
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
            data_format="hdf5",
        )


def _description(head: dict[str, Any], seat: int | None) -> str:
    whose = "all seats, by agent" if seat is None else f"seat {seat}"
    return (
        f"Air hockey, {head['scenario']}, {whose}: recorded on {head.get('backend')} "
        f"in the {head.get('profile')} profile, {1.0 / head['control_dt']:.0f} steps a "
        f"second. Infos hold the true state, applied actions and success."
    )


def _keywords(head: dict[str, Any]) -> dict[str, Any]:
    """Return keywords of an environment in which the recordings could be played."""
    names = ("options", "profile", "observe", "control_dt", "goals")
    return {name: head[name] for name in names if head.get(name)}


def _env_spec(head: dict[str, Any], seat: int | None) -> Any:
    """Return the gymnasium spec of a single-seat scenario; None for games."""
    if seat is None or len(head.get("players", [])) != 1:
        return None
    try:
        spec = gymnasium.spec(gymnasium_id(head["scenario"]))
    except ValueError:  # A scenario of somebody's own.
        return None
    return gymnasium.make(spec, **_keywords(head)).unwrapped.spec


def _spaces(head: dict[str, Any], seat: int | None) -> tuple[spaces.Space[Any], ...]:
    """Return the spaces of observations and of actions."""
    env = parallel_env(head["scenario"], **_keywords(head))
    agents = list(env.possible_agents)
    seen = {agent: env.observation_space(agent) for agent in agents}
    done = {agent: env.action_space(agent) for agent in agents}
    env.close()
    if seat is None:
        return spaces.Dict(seen), spaces.Dict(done)
    if seat >= len(agents):
        raise ValueError(f"--seat {seat}: {head['scenario']} has {len(agents)}")
    return seen[agents[seat]], done[agents[seat]]


def _buffer(number: int, episode: RecordedEpisode, seat: int | None) -> EpisodeBuffer:
    """Return an episode as Minari takes it."""
    from minari.data_collector import EpisodeBuffer

    columns = episode.columns
    agents = range(columns["action"].shape[1])
    if seat is not None and seat >= len(agents):
        raise ValueError(f"--seat {seat}: the recording has {len(agents)}")
    shown, acts, rewards = _observations(episode), columns["action"], columns["reward"]
    ends = columns["terminated"].astype(bool)
    cuts = columns["truncated"].astype(bool)
    # One that was cut off ends where it was cut.
    cuts[-1] |= not ends[-1]
    if seat is None:
        by_agent = [f"paddle_{k}" for k in agents]
        observations: Any = {a: _of(shown, k) for k, a in enumerate(by_agent)}
        actions: Any = {a: _single(acts[:, k]) for k, a in enumerate(by_agent)}
        reward = rewards.sum(1)
    else:
        observations, actions = _of(shown, seat), _single(acts[:, seat])
        reward = rewards[:, seat]
    return EpisodeBuffer(
        id=number,
        seed=int(episode.seed or 0),
        observations=observations,
        actions=actions,
        rewards=[float(x) for x in reward],
        terminations=ends.tolist(),
        truncations=cuts.tolist(),
        infos=_infos(episode, seat),
    )


def _observations(episode: RecordedEpisode) -> dict[str, Array]:
    """Return (T + 1, seats, D) by part; of flat observations the only name is ""."""
    names = [n for n in episode.first if n.split(".")[0] == "observation"]
    if not names:
        raise ValueError("there are no observations in it")
    return {
        name.partition(".")[2]: np.concatenate(
            [episode.first[name][None], episode.columns[name]]
        )
        for name in names
    }


def _of(shown: dict[str, Array], seat: int) -> Any:
    parts = {name: _single(value[:, seat]) for name, value in shown.items()}
    return parts.get("", parts)


def _single(values: Array) -> Array:
    return np.ascontiguousarray(values, np.float32)


def _infos(episode: RecordedEpisode, seat: int | None) -> dict[str, Any]:
    """Return the infos (T + 1, ...), those of the reset first."""
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


def import_minari(
    name: str, scenario: str, folder: Path, control_dt: float, root: Path | None = None
) -> Path:
    """Write a Minari dataset of one seat as a recording; return its path.

    Args:
        name: of the dataset.
        scenario: that it is of.
        folder: of the recording.
        control_dt: s.
        root: folder of all datasets; None for Minari's own.

    Raises:
        ValueError: no such dataset, or spaces that are not those of the scenario.
    """
    require("minari", "offline")
    import minari

    with _at(root) if root else contextlib.nullcontext():
        try:
            dataset = minari.load_dataset(name)
        except (FileNotFoundError, ValueError) as error:
            raise ValueError(f"{name}: there is no such Minari dataset") from error
        head = _imported_head(dataset, name, scenario, control_dt)
        path = folder / name.replace("/", "-")
        with whole_recording(path, head) as writer:
            for episode in dataset.iterate_episodes():
                _import_episode(writer, episode)
    return path


def _imported_head(
    dataset: Any, name: str, scenario: str, control_dt: float
) -> dict[str, Any]:
    """Return the head of a recording of a dataset that fits a scenario."""
    spec = dataset.env_spec
    known = dict(spec.kwargs) if spec is not None else {}
    head = {
        "scenario": scenario,
        "options": known.get("options", {}),
        "profile": known.get("profile", "ideal"),
        "observe": known.get("observe", "velocity"),
        "control_dt": known.get("control_dt", control_dt),
        "backend": "minari",
        "players": [{"driver": f"minari/{name}", "person": None}],
    }
    wanted, acts = _spaces(head, 0)
    for what, own, other in (
        ("observations", wanted, dataset.observation_space),
        ("actions", acts, dataset.action_space),
    ):
        if own.shape != other.shape:
            raise ValueError(
                f"{name}: its {what} have the shape {other.shape}, those of {scenario} "
                f"{own.shape}; is it of another scenario, or of other options?"
            )
    return head


def _import_episode(writer: RecordingWriter, episode: Any) -> None:
    """Write an episode of a dataset of one seat."""
    seen = np.asarray(episode.observations, np.float32)[:, None]
    reward = np.asarray(episode.rewards, np.float64)[:, None]
    infos = episode.infos or {}
    success = np.asarray(infos.get("success", np.zeros(len(seen))), bool)[1:, None]
    if not (np.isfinite(seen).all() and np.isfinite(reward).all()):
        raise ValueError(f"episode {episode.id}: numbers are missing in it")
    writer.begin({"observation": seen[0]}, int(episode.id))
    writer.add_rows(
        {
            "observation": seen[1:],
            "action": np.asarray(episode.actions, np.float64)[:, None],
            "reward": reward,
            "returns": np.cumsum(reward, axis=0),
            "success": success,
            "terminated": np.asarray(episode.terminations, bool),
            "truncated": np.asarray(episode.truncations, bool),
        }
    )
    writer.end(PLAYED)

"""Plot of what recordings hold: returns, lengths, places, speeds, gaps, players."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from marl_airhockey.core.recording import RecordedEpisode
from marl_airhockey.core.scene import Scene
from marl_airhockey.data.files import shared_head
from marl_airhockey.data.reader import episodes_of, read_head
from marl_airhockey.evaluation.charts import DPI, INK, INKS, save, tidy
from marl_airhockey.registry import make_scenario
from marl_airhockey.types import Array

DRAWN = (
    *("state.position", "state.velocity", "state.time", "returns"),
    "sensed.visible",
)
"""Columns that are plotted"""
BINS = 40


class Content:
    """Contents of recordings that are plotted.

    Args:
        scene: Scene in which they were made.
        control_dt: Time of a step, s.
    """

    def __init__(self, scene: Scene, control_dt: float) -> None:
        self._scene, self._dt = scene, control_dt
        self.returns: list[float] = []
        self.seconds: list[float] = []
        self.gaps: list[float] = []
        """Times for which a puck was unseen, s"""
        self.players: Counter[str] = Counter()
        self._place: list[Array] = []
        self._speed: list[Array] = []

    def add(self, episode: RecordedEpisode, who: str) -> None:
        """Add an episode."""
        columns = episode.columns
        self.returns.append(float(columns["returns"][-1, 0]))
        self.seconds.append(len(episode) * self._dt)
        self.players[who] += 1
        self._place.append(columns["state.position"])
        self._speed.append(np.linalg.norm(columns["state.velocity"], axis=-1))
        if "sensed.visible" in columns:
            for k in range(self._scene.bodies.pucks):
                hidden = (~columns["sensed.visible"][:, k]).astype(np.int8)
                edges = np.diff(np.concatenate([[0], hidden, [0]]))
                begins, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
                self.gaps += ((ends - begins) * self._dt).tolist()

    @property
    def steps(self) -> int:
        """Number of steps."""
        return sum(len(place) for place in self._place)

    def places(self, where: slice) -> Array:
        """Return the positions (n, 2) of some bodies in all steps, m."""
        parts = [place[:, where].reshape(-1, 2) for place in self._place]
        return np.concatenate(parts)

    def speeds(self, where: slice) -> Array:
        """Return the speeds (n,) of some bodies in all steps, m/s."""
        return np.concatenate([speed[:, where].ravel() for speed in self._speed])


def plot_content(paths: Sequence[Path], out: Path) -> None:
    """Write a PNG of what recordings of one scenario hold.

    Raises:
        ValueError: Recordings that differ, or without steps; named.
    """
    head = shared_head(paths)
    scene = make_scenario(head["scenario"], **head.get("options", {})).scene
    found = Content(scene, head["control_dt"])
    for path in paths:
        rows = read_head(path).get("players", [])
        who = " / ".join(str(row["person"] or row["driver"]) for row in rows)
        for episode in episodes_of(path, DRAWN):
            if len(episode):
                found.add(episode, who)
    if not found.steps:
        raise ValueError(f"{paths[0]}: there are no steps in it")
    figure, axes = plt.subplots(3, 2, figsize=(9, 9), dpi=DPI, layout="constrained")
    episodes = len(found.seconds)
    figure.suptitle(f"{head['scenario']}: {episodes} episodes, {found.steps} steps")
    bodies = {"paddle": scene.bodies.paddle}
    if scene.bodies.pucks:
        bodies["puck"] = scene.bodies.puck
    _histogram(axes[0, 0], {"": found.returns}, "return of the first seat")
    _histogram(axes[0, 1], {"": found.seconds}, "length of an episode, s")
    for axis, (name, where) in zip(axes[1], bodies.items(), strict=False):
        half = scene.table.size / 2
        edges = [np.linspace(-h, h, n) for h, n in zip(half, (60, 31), strict=True)]
        axis.hist2d(*found.places(where).T, bins=edges, cmap="Blues", norm="symlog")
        axis.set(aspect="equal", xlabel="x, m", ylabel="y, m", title=f"{name}: places")
    axes[1, 1].set_visible("puck" in bodies)
    speeds = {name: found.speeds(where) for name, where in bodies.items()}
    _histogram(axes[2, 0], speeds, "speed, m/s")
    last = axes[2, 1]
    if found.gaps:
        _histogram(last, {"": found.gaps}, "time for which a puck was unseen, s")
    else:
        last.set_axis_off()
    names = "\n".join(f"{who}: {n}" for who, n in found.players.most_common(12))
    last.set_title(f"episodes by player\n{names}", fontsize="small")
    save(figure, out)


def _histogram(axes: Axes, values: Mapping[str, Any], label: str) -> None:
    """Plot histograms over each other."""
    for (name, numbers), colour in zip(values.items(), (INK, "#d04010"), strict=False):
        axes.hist(numbers, bins=BINS, color=colour, alpha=0.6, label=name)
    axes.set(xlabel=label, ylabel="episodes" if len(values) == 1 else "steps")
    tidy(axes, "best" if len(values) > 1 else None)
    axes.grid(color=INKS[0], alpha=0.2)

"""Plot of returns, lengths, positions, speeds, gaps and players in recordings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from marl_airhockey.data.files import shared_head
from marl_airhockey.data.reader import episodes_of, read_head
from marl_airhockey.registry import make_scenario
from marl_airhockey.sim.core.recording import Episode
from marl_airhockey.sim.render.charts import DPI, INK, INKS, save, tidy
from marl_airhockey.types import Array

DRAWN = (
    *("state.position", "state.velocity", "state.time", "returns"),
    "sensed.visible",
)
"""Columns that are plotted."""
BINS = 40


def plot_content(paths: Sequence[Path], out: Path) -> None:
    """Write a PNG with the content of recordings of one scenario.

    Raises:
        ValueError: The recordings have different environments, or no steps.
    """
    head = shared_head(paths)
    scene = make_scenario(head["scenario"], **head.get("options", {})).scene
    episodes, players = list[Episode](), Counter[str]()
    for path in paths:
        rows = read_head(path).get("players", [])
        who = " / ".join(str(row["person"] or row["driver"]) for row in rows)
        found = [episode for episode in episodes_of(path, DRAWN) if len(episode)]
        players[who] += len(found)
        episodes += found
    if not episodes:
        raise ValueError(f"{paths[0]}: it contains no steps")
    figure, axes = plt.subplots(3, 2, figsize=(9, 9), dpi=DPI, layout="constrained")
    steps, dt = sum(map(len, episodes)), head["control_dt"]
    figure.suptitle(f"{head['scenario']}: {len(episodes)} episodes, {steps} steps")
    bodies = {"paddle": scene.bodies.paddle}
    if scene.bodies.pucks:
        bodies["puck"] = scene.bodies.puck
    returns = [float(episode.columns["returns"][-1, 0]) for episode in episodes]
    _histogram(axes[0, 0], {"": returns}, "return of the first seat")
    seconds = [len(episode) * dt for episode in episodes]
    _histogram(axes[0, 1], {"": seconds}, "length of an episode, s")
    for axis, (name, where) in zip(axes[1], bodies.items(), strict=False):
        half = scene.table.size / 2
        edges = [np.linspace(-h, h, n) for h, n in zip(half, (60, 31), strict=True)]
        positions = _vectors(episodes, "state.position", where)
        axis.hist2d(*positions.T, bins=edges, cmap="Blues", norm="symlog")
        axis.set(
            aspect="equal", xlabel="x, m", ylabel="y, m", title=f"{name}: positions"
        )
    axes[1, 1].set_visible("puck" in bodies)
    speeds = {
        name: np.linalg.norm(_vectors(episodes, "state.velocity", where), axis=-1)
        for name, where in bodies.items()
    }
    _histogram(axes[2, 0], speeds, "speed, m/s")
    last, gaps = axes[2, 1], [gap * dt for e in episodes for gap in _gaps(e)]
    if gaps:
        _histogram(last, {"": gaps}, "time for which a puck was not detected, s")
    else:
        last.set_axis_off()
    names = "\n".join(f"{who}: {n}" for who, n in players.most_common(12))
    last.set_title(f"episodes by player\n{names}", fontsize="small")
    save(figure, out)


def _vectors(episodes: Sequence[Episode], name: str, where: slice) -> Array:
    """Return a column of some bodies in all steps, (n, 2)."""
    return np.concatenate([e.columns[name][:, where].reshape(-1, 2) for e in episodes])


def _gaps(episode: Episode) -> Iterator[int]:
    """Yield the lengths, in steps, of the gaps in which a puck was not detected."""
    visible = episode.columns.get("sensed.visible", np.ones((len(episode), 0), bool))
    for puck in visible.T:
        edges = np.diff(np.concatenate([[0], ~puck, [0]]).astype(np.int8))
        yield from np.flatnonzero(edges == -1) - np.flatnonzero(edges == 1)


def _histogram(axes: Axes, values: Mapping[str, Any], label: str) -> None:
    """Plot several histograms in one panel."""
    for (name, numbers), colour in zip(values.items(), (INK, "#d04010"), strict=False):
        axes.hist(numbers, bins=BINS, color=colour, alpha=0.6, label=name)
    axes.set(xlabel=label, ylabel="episodes" if len(values) == 1 else "steps")
    tidy(axes, "best" if len(values) > 1 else None)
    axes.grid(color=INKS[0], alpha=0.2)

"""Plot of returns, lengths, positions, speeds, gaps and players in recordings."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from marl_airhockey.data.files import shared_head
from marl_airhockey.data.plots import PADDLE, PUCK, plot_table
from marl_airhockey.data.reader import episodes_of, read_head
from marl_airhockey.registry import make_scenario
from marl_airhockey.sim.core.recording import Episode
from marl_airhockey.sim.render.charts import SOFT, panels, save
from marl_airhockey.types import Array

DRAWN = (
    *("state.position", "state.velocity", "state.time", "returns"),
    "sensed.visible",
)
"""Columns that are plotted."""
BINS, MOST = 40, 8
"""Largest number of bins of a histogram, and of players in the plot."""


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
    bodies = {"paddle": scene.bodies.paddle}
    if scene.bodies.pucks:
        bodies["puck"] = scene.bodies.puck
    steps, dt = sum(map(len, episodes)), head["control_dt"]
    rows, last = 2 + len(bodies), 0.4 + 0.22 * min(len(players), MOST)
    heights = [1.9] * (rows - 1) + [last]
    figure, axes = panels(rows, 2, (9, 1.25 * sum(heights) + 1), heights=heights)
    returns = [float(episode.columns["returns"][-1, 0]) for episode in episodes]
    _histogram(axes[0, 0], {"episodes": returns}, "return of the first seat")
    seconds = [len(episode) * dt for episode in episodes]
    _histogram(axes[0, 1], {"episodes": seconds}, "length of an episode, s")
    for place, (name, where) in zip(axes[1], bodies.items(), strict=False):
        half = scene.table.size / 2
        edges = [np.linspace(-h, h, n) for h, n in zip(half, (60, 31), strict=True)]
        positions = _vectors(episodes, "state.position", where)
        *_, image = place.hist2d(*positions.T, bins=edges, cmap="Blues", norm="symlog")
        figure.colorbar(image, ax=place, shrink=0.6, label="steps")
        place.grid(visible=False)
        plot_table(place, scene.table, scene)
        place.set(title=f"positions of the {name}", xlabel="x and y, m", ylabel="")
    speeds = {
        name: np.linalg.norm(_vectors(episodes, "state.velocity", where), axis=-1)
        for name, where in bodies.items()
    }
    _histogram(axes[rows - 2, 2 - len(bodies)], speeds, "speed, m/s")
    if "puck" in bodies:
        gaps = [gap * dt for e in episodes for gap in _gaps(e)]
        _histogram(axes[2, 1], {"gaps": gaps}, "time without detection of a puck, s")
    axes[-1, 1].remove()
    axes[-1, 0].set_subplotspec(axes[-1, 0].get_gridspec()[-1, :])
    _bars(axes[-1, 0], players)
    save(
        figure, out, f"{head['scenario']}: n = {len(episodes)} episodes, {steps} steps"
    )


def _bars(axes: Axes, players: Counter[str]) -> None:
    """Plot the numbers of episodes of the players with the most episodes."""
    most = players.most_common(MOST)[::-1]
    names = [textwrap.shorten(who, 40, placeholder="...") for who, _ in most]
    axes.barh(range(len(most)), [n for _, n in most], color=PADDLE.colour, height=0.5)
    axes.set_ylim(-0.6, len(most) - 0.4)
    axes.set_yticks(range(len(most)), names, fontsize="small")
    axes.set_xlabel(
        f"episodes, by the players of all seats ({len(most)} of {len(players)})"
    )


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
    looks = {"puck": PUCK, "paddle": PADDLE}
    every = np.concatenate([*values.values()])
    unit = "steps" if set(values) & set(looks) else next(iter(values))
    axes.set(xlabel=label, ylabel=unit)
    if not len(every):
        axes.set(xticks=[], yticks=[])
        axes.text(0.5, 0.5, "none", transform=axes.transAxes, ha="center", color=SOFT)
        return
    bins = min(BINS, 2 * int(np.ceil(np.sqrt(len(every)))) + 1)
    edges = np.histogram_bin_edges(every, bins).tolist()
    for name, numbers in values.items():
        look, shown = looks.get(name, PADDLE), name if name in looks else ""
        style: dict[str, Any] = {"color": look.colour, "linestyle": look.line}
        axes.hist(numbers, edges, color=look.colour, alpha=0.35, label=shown)
        axes.hist(numbers, edges, histtype="step", **style)

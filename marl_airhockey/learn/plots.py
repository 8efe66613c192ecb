"""Plots of training."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

INK, SAMPLED = "#0072B2", "#86b8d8"
FLOOR_INKS = ("#8a8f98", "#b06a00", "#00805c")


def learning_curve(
    rows: Sequence[Mapping[str, str]],
    floors: Mapping[str, float],
    title: str,
    path: Path,
) -> None:
    """Success against CPU-seconds of training, with others' success as lines.

    Args:
        rows: of ``evaluations.csv``.
        floors: success of other drivers, by name.
        title: of the plot.
        path: of the PNG.
    """
    figure, axes = plt.subplots(figsize=(7.2, 4.2), dpi=130, layout="constrained")
    cpu = [0.0, *(float(row["cpu_seconds"]) for row in rows)]
    for name, label, ink in (
        ("success", "learned, mean action", INK),
        ("success_sampled", "learned, sampled", SAMPLED),
    ):
        share = [0.0, *(float(row[name]) for row in rows)]
        axes.plot(cpu, share, color=ink, marker="o", markersize=4, label=label)
    for (name, level), ink in zip(floors.items(), FLOOR_INKS, strict=False):
        axes.axhline(level, color=ink, linestyle="--", linewidth=1.2, label=name)
    axes.set(
        xlabel="CPU-seconds of training",
        ylabel="success",
        ylim=(-0.03, 1.03),
        xlim=(0, None),
        title=title.replace("_", " "),
    )
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.25)
    axes.legend(frameon=False, loc="center right")
    figure.savefig(path)
    plt.close(figure)

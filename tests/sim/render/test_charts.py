"""Charts: one look for all plots."""

from itertools import combinations
from pathlib import Path

import matplotlib.pyplot as plt

import marl_airhockey
from marl_airhockey.sim.render.charts import panels, point, save, series

PACKAGE = Path(marl_airhockey.__file__).parent


def test_series_differ_also_without_colour():
    looks = [series(k) for k in range(36)]
    assert len(set(looks)) == 36
    for a, b in combinations(looks[:6], 2):
        assert a.marker != b.marker
        assert a.line != b.line


def test_only_charts_create_figures():
    files = [*PACKAGE.rglob("*.py"), *(PACKAGE.parent / "scripts").rglob("*.py")]
    found = [path.name for path in files if "matplotlib.pyplot" in path.read_text()]
    assert found == ["charts.py"]


def test_saved_figure_has_title_and_one_legend(tmp_path):
    figure, grid = panels(1, 2)
    for axes in grid[0]:
        for k in range(2):
            point(axes, k, 0.5, (0.4, 0.6), series(k), f"method {k}")
    save(figure, tmp_path / "new" / "points.png", "n = 3 seeds")
    assert (tmp_path / "new" / "points.png").stat().st_size
    assert figure.get_suptitle() == "n = 3 seeds"
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert names == ["method 0", "method 1"]
    assert not plt.fignum_exists(figure.number)

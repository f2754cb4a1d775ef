import sys

import numpy as np
import pytest

from hoof_env.errors import HoofEnvError
from hoof_env.leg.linkage import BODIES, POINTS
from hoof_env.paper import figures
from hoof_env.paper.figure_force import draw_forces, draw_vectors
from hoof_env.paper.figure_mechanism import draw_mechanism
from hoof_env.paper.figure_motion import draw_angles, draw_paths
from hoof_env.paper.figure_style import points_at

Figure = pytest.importorskip("matplotlib.figure").Figure


@pytest.fixture
def drawn(reproduction):
    def draw(function):
        figure = Figure(layout="constrained")
        function(figure, reproduction)
        return figure

    return draw


def test_all_figures_are_written_as_png_and_svg(reproduction, tmp_path):
    paths = figures.draw_all(reproduction, tmp_path)
    assert sorted(paths) == sorted(tmp_path.iterdir())
    assert {path.name for path in paths} == {
        f"figure{n}.{s}" for n in (1, 3, 4, 5, 6) for s in ("png", "svg")
    }
    for path in paths:
        start = path.read_bytes()[:200]
        assert start.startswith(b"\x89PNG") or b"<?xml" in start


def test_figure_1_names_every_point_and_numbers_every_link(drawn):
    whole = drawn(draw_mechanism).axes[0]
    texts = [text.get_text() for text in whole.texts]
    assert {str(n) for n in range(1, len(BODIES) + 1)} <= set(texts)
    assert {text.split(" = ")[0] for text in texts} >= set(POINTS)
    assert sum("(toe)" in text for text in texts) == sum("(heel)" in text for text in texts) == 1


def test_a_drawn_leg_stands_where_the_simulation_had_its_hoof(reproduction):
    geometry = reproduction.geometry
    trace = reproduction.traces["run", "elastic", "exact"]
    for row in trace[:: len(trace) // 7]:
        at = points_at(geometry, row)
        np.testing.assert_allclose(at[geometry.toe], (row["toe_x"], -row["toe_penetration"]), atol=1e-12)
        np.testing.assert_allclose(at[geometry.heel], (row["heel_x"], -row["heel_penetration"]), atol=1e-12)


def test_figures_4_and_5_mark_the_published_numbers(drawn, reproduction):
    published = reproduction.published

    def marks(ax):
        return {
            (round(float(x), 4), float(y))
            for line in ax.lines
            if line.get_marker() == "D"
            for x, y in line.get_xydata()
        }

    walk, run = drawn(draw_angles).axes[2:]
    assert {(0.267, -6.83), (0.569, 20.9)} <= marks(walk)
    assert marks(run) == {(0.208, 6.2), (0.478, 71.08)}
    for ax, gait in zip(drawn(draw_forces).axes, ("walk", "run"), strict=True):
        expected = {published.row(f"{gait}.peak_{c}").value for c in ("elastic", "inelastic")}
        assert {y for _, y in marks(ax)} == expected


def test_every_axis_with_numbers_has_a_unit(drawn):
    for function in (draw_mechanism, draw_paths, draw_angles, draw_forces, draw_vectors):
        for ax in drawn(function).axes:
            labels = ax.get_xlabel() + ax.get_ylabel()
            bare = not ax.axison or not (
                len(ax.get_xticklabels()) and any(t.get_text() for t in ax.get_xticklabels())
            )
            assert bare or "[" in labels, (function.__name__, labels)


def test_without_matplotlib_the_way_out_is_named(monkeypatch, reproduction, tmp_path):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(HoofEnvError, match=r'pip install "hoof-env\[plot\]".*--no-figures'):
        figures.draw_all(reproduction, tmp_path)

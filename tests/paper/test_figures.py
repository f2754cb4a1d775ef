import dataclasses
from itertools import combinations

import numpy as np
import pytest

from hoof_env.paper.drawing import PRINT, shade
from hoof_env.paper.figures import DRAWINGS, draw_angles, draw_forces, draw_paths, draw_vectors
from hoof_env.paper.measure import measure_stance
from hoof_env.paper.mechanism import draw_mechanism
from hoof_env.paper.reproduce import run_cycle, write_reproduction
from hoof_env.paper.rows import EXACT, NOT_DETERMINABLE
from tests.linkage import BODIES, POINTS

Figure = pytest.importorskip("matplotlib.figure").Figure


@pytest.fixture
def draw(reproduction):
    """Draws a figure in the style of print, of the session's reproduction unless told another."""
    from matplotlib import style

    def draw(function, which=reproduction, **settings):
        figure = Figure()
        with style.context(["default", PRINT]):
            function(figure, which, **settings)
            figure.draw_without_rendering()
        return figure

    return draw


def marks(ax):
    """Published values on some axes, as {(x, y)}."""
    return {
        (round(float(x), 4), round(float(y), 4))
        for line in ax.lines
        if line.get_marker() == "D"
        for x, y in line.get_xydata()
    }


def half_bars(ax):
    """Half lengths of the bars on some axes, by the middle of the bar."""
    bars = {}
    for container in ax.containers:
        for segment in (s for lines in container.lines[2] for s in lines.get_segments()):
            (x0, y0), (x1, y1) = segment
            bars[round((x0 + x1) / 2, 4), round((y0 + y1) / 2, 4)] = max(x1 - x0, y1 - y0) / 2
    return bars


def spans(ax):
    """Intervals that are shaded over the whole height of some axes, in order, of one point alone or of both,
    not the ground."""
    from matplotlib.patches import Rectangle

    upright = [p for p in ax.patches if isinstance(p, Rectangle) and p.get_height() == 1 and p.get_y() == 0]
    return sorted((p.get_x(), p.get_x() + p.get_width()) for p in upright)


def value(reproduction, row):
    return reproduction.published.row(row).value


def test_every_figure_is_written_twice_and_again_without_a_difference(reproduction, drawn, tmp_path):
    import matplotlib
    from PIL import Image

    own = {"lines.linewidth": 7, "savefig.bbox": "tight", "axes.grid": True}  # a user's, without effect
    with matplotlib.rc_context(own):
        paths = write_reproduction(reproduction, tmp_path)
    assert sorted(paths) == sorted(tmp_path.iterdir())
    folders = drawn, tmp_path
    texts = {"reproduction.json", "reproduction.md"}
    assert {path.name for path in drawn.iterdir()} | texts == {path.name for path in paths}
    names = {f"figure{n}.{s}" for n in (1, 3, 4, 5, 6) for s in ("png", "svg")}
    assert {path.name for path in drawn.iterdir()} == names
    for name in names:
        assert (folders[0] / name).read_bytes() == (folders[1] / name).read_bytes(), name
        if name.endswith("png"):
            with Image.open(folders[0] / name) as picture:
                assert picture.mode == "P", name  # with a palette
                assert picture.width >= 175 / 25.4 * 200, name  # two columns at 200 dots an inch
        else:
            text = (folders[0] / name).read_text(encoding="utf-8")
            assert f">Identified leg, not published (preset {reproduction.geometry.name}" in text, name


def test_figure_1_names_every_point_and_numbers_every_link(draw):
    texts = [text.get_text() for ax in draw(draw_mechanism).axes for text in ax.texts]
    assert {str(n) for n in range(1, len(BODIES) + 1)} <= set(texts)
    assert {text.split(" = ")[0] for text in texts} >= set(POINTS)
    assert sum("(toe)" in text for text in texts) == sum("(heel)" in text for text in texts) == 1


def test_figure_3_marks_the_paths_at_the_published_contact_times(draw, reproduction):
    axes = draw(draw_paths).axes
    for gait, pair in (("walk", axes[::2]), ("run", axes[1::2])):
        trace = reproduction.traces[gait, "elastic", EXACT]
        stance = measure_stance(trace)
        expected = set()
        for row, points in (("contact_start", stance.first_points), ("contact_end", stance.last_points)):
            at = trace[np.argmin(np.abs(trace["time"] - value(reproduction, f"{gait}.{row}")))]
            expected |= {
                (round(float(at[f"{name}_x"]), 4), round(float(-at[f"{name}_penetration"]), 4))
                for name in points
            }
        for ax in pair:
            np.testing.assert_allclose(sorted(marks(ax)), sorted(expected), atol=2e-4)


def test_figure_4_marks_published_angles_with_their_bars(draw):
    walk, run = (ax for ax in draw(draw_angles).axes if marks(ax))
    assert {(0.267, -6.83), (0.569, 20.9)} <= marks(walk)
    assert -0.23 in {y for _, y in marks(walk)}
    assert marks(run) == {(0.208, 6.2), (0.478, 71.08)}
    bars = {round(y, 2): half for (_, y), half in half_bars(walk).items()}
    assert bars == pytest.approx({-6.83: 1, -0.23: 3, 20.9: 1})


def test_figure_5_marks_published_forces_and_contact_times_with_their_bars(draw, reproduction):
    axes = [ax for ax in draw(draw_forces).axes if marks(ax)]
    for gait, (forces, means) in (("walk", axes[:2]), ("run", axes[2:])):
        peaks = [value(reproduction, f"{gait}.peak_{c}") for c in ("elastic", "inelastic")]
        times = [value(reproduction, f"{gait}.contact_{c}") for c in ("start", "end")]
        assert {y for _, y in marks(forces)} == {*peaks, 0}
        assert {x for x, y in marks(forces) if y == 0} == set(times)
        expected = [value(reproduction, f"{gait}.mean_{c}") for c in ("elastic", "inelastic")]
        assert [y for _, y in sorted(marks(means))] == expected
        bars = half_bars(forces) | half_bars(means)
        lost = {value(reproduction, name) for name in NOT_DETERMINABLE}
        for (_, y), half in bars.items():
            assert half == pytest.approx(0.005 if not y else 0.0 if y in lost else 0.02 * y)
        assert len(bars) == 6


@pytest.mark.parametrize("function", [draw_angles, draw_forces])
def test_shaded_sub_phases_are_the_measured_contacts(draw, reproduction, function):
    shaded = [ax for ax in draw(function).axes if spans(ax)]
    for gait, ax in zip(("walk", "run"), shaded, strict=True):
        stance = measure_stance(reproduction.traces[gait, "elastic", EXACT])
        edges = sorted(t for name in ("toe", "heel") for i in getattr(stance, name) for t in i)
        np.testing.assert_allclose(spans(ax), np.transpose([edges[:-1], edges[1:]]))


@pytest.mark.parametrize(
    ("toe", "heel", "bearing"),
    [
        ((0.3, 0.6), (0.25, 0.5), ["heel alone", "toe and heel", "toe alone"]),
        ((0.2, 0.5), (0.25, 0.45), ["toe alone", "toe and heel", "toe alone"]),
        ((0.4, 0.5), (0.2, 0.3), ["heel alone", "toe alone"]),  # between them in the air
        (None, (0.2, 0.5), ["heel alone"]),
    ],
)
def test_sub_phases_are_named_by_the_points_that_bear(cycle, toe, heel, bearing):
    ax = Figure().subplots()
    shade(ax, measure_stance(cycle(toe=toe, heel=heel)))
    names = [p.get_label() for p in sorted(ax.patches, key=lambda patch: patch.get_x())]
    assert [name.split(":")[0] for name in names] == bearing


def test_figure_6_draws_the_simulated_forces_where_they_act(draw, reproduction):
    from matplotlib.quiver import Quiver

    quivers = [c for ax in draw(draw_vectors).axes for c in ax.collections if isinstance(c, Quiver)]
    for gait, arrows in zip(("walk", "run"), quivers, strict=True):
        trace = reproduction.traces[gait, "elastic", EXACT]
        for (x, _), across, up in zip(arrows.get_offsets(), arrows.U, arrows.V, strict=True):
            match = (trace["cop_x"] == x) & (trace["friction"] == across) & (trace["normal"] == up)
            assert match.any()
        assert arrows.V.max() > 0.98 * trace["normal"].max()


@pytest.fixture(scope="module", params=[0.0, 0.02, -0.08])
def at_height(request, reproduction):
    """The reproduction with the hip higher than the geometry's by so many metres."""
    height = reproduction.geometry.hip_height + request.param
    traces = {
        (gait, condition, EXACT): run_cycle(
            gait, EXACT, restitution=cr, hip_height=height, preset=reproduction.geometry.name
        )
        for gait in ("walk", "run")
        for condition, cr in (("elastic", 1.0), ("inelastic", 0.0))
    }
    return dataclasses.replace(reproduction, traces=traces)


@pytest.mark.parametrize("function", DRAWINGS.values())
def test_no_two_texts_overlap_and_all_are_inside(draw, at_height, function):
    figure = draw(function, at_height)
    shown = [(text.get_text(), text.get_window_extent().padded(-1)) for text in texts_of(figure)]
    for name, box in shown:
        assert (figure.bbox.min <= box.min).all(), name
        assert (box.max <= figure.bbox.max).all(), name
    assert not [(a, b) for (a, one), (b, two) in combinations(shown, 2) if one.overlaps(two)]


def texts_of(figure):
    """All texts that are drawn."""
    texts = [*figure.texts, *(text for legend in figure.legends for text in legend.get_texts())]
    for ax in figure.axes:
        texts += ax.texts
        for axis, place in ((ax.xaxis, 0), (ax.yaxis, 1)):
            low, high = axis.get_view_interval()
            numbers = [t for t in axis.get_ticklabels() if low <= t.get_position()[place] <= high]
            texts += [axis.label, *numbers] if ax.axison else []
    return [text for text in texts if text.get_text().strip() and text.get_visible()]


@pytest.mark.parametrize("function", DRAWINGS.values())
def test_every_axis_with_numbers_has_a_unit(draw, function):
    def numbered(axis):
        labels = [t.get_text() for t in axis.get_ticklabels() if t.get_visible()]
        return any(
            label.replace("\N{MINUS SIGN}", "-").replace(".", "").lstrip("-").isdigit() for label in labels
        )

    axes = [ax for ax in draw(function).axes if ax.axison]
    for ax in axes:
        assert not numbered(ax.xaxis) or "[" in ax.get_xlabel()
        beside = [other for other in axes if np.isclose(other.get_position().y0, ax.get_position().y0)]
        assert not numbered(ax.yaxis) or any("[" in other.get_ylabel() for other in beside)

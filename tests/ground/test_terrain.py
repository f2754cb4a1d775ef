"""Terrain: the table of the kernel is the piecewise linear ground that was asked for; bad input is named."""

import json
import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hoof_env.errors import ParameterError
from hoof_env.ground import terrain as lanes
from hoof_env.ground.terrain import LONG_WAY, Terrain
from hoof_env.simd import Matrix, Number, loop, read, write
from hoof_env.simd.compile import kernel


@st.composite
def terrains(draw):
    count = draw(st.integers(1, 12))

    def row(low, high):
        return st.lists(st.floats(low, high), min_size=count, max_size=count).map(tuple)

    start, spacing = draw(st.floats(-20, 20)), draw(st.floats(0.01, 5))
    return Terrain(draw(row(-2, 2)), draw(row(0.1, 10)), draw(row(0, 3)), start, spacing)


@kernel
def surface(x: Matrix, cells: Matrix, origin: Number, per_metre: Number, out: Matrix):
    count = x.shape[0]
    for n in loop(count):
        found = lanes.surface(read(x.first, n, 1, 1), cells, origin, per_metre)
        for k, value in enumerate(found):
            write(value, out.first, k * count + n, 1)


def at(terrain, x):
    """Height, normal x and y, and both factors, shape (5, n)."""
    x = np.atleast_1d(np.asarray(x, np.float64))
    out = np.empty((5, x.size))
    surface(x, *terrain.to_grid(), out)
    return out


@given(terrains(), st.lists(st.floats(-100, 100), min_size=1, max_size=20))
@settings(deadline=None, max_examples=200)
def test_it_is_linear_between_the_knots_and_level_beyond(terrain, x):
    height, nx, ny, stiffness, friction = at(terrain, x)
    for found, knots in ((height, "height"), (stiffness, "stiffness"), (friction, "friction")):
        assert found == pytest.approx(np.interp(x, terrain.x, getattr(terrain, knots)), rel=1e-9, abs=1e-9)
    np.testing.assert_array_equal(terrain.height_at(np.array(x)), np.interp(x, terrain.x, terrain.height))
    assert Terrain.from_dict(json.loads(json.dumps(terrain.to_dict()))) == terrain
    assert nx**2 + ny**2 == pytest.approx(np.ones(len(x)))
    assert (ny > 0).all()


def outcome(heights, bound):
    """The checked row, or the words of the refusal."""
    try:
        return lanes._row("heights", heights, -bound, bound, None)
    except ParameterError as error:
        return str(error)


@given(
    st.lists(st.floats(-1e4, 1e4) | st.floats(), min_size=1, max_size=6),
    st.sampled_from([tuple, list]),
    st.sampled_from([1e4, math.inf]),
)
@example([0.0, math.inf], list, math.inf)
@example([0.0, math.nan], tuple, math.inf)
@example([0.0, -1.1e4], tuple, 1e4)
def test_a_row_that_is_checked_at_once_is_taken_or_refused_as_one_by_one(heights, kind, bound):
    one_by_one = np.array(heights, dtype=object)
    assert outcome(kind(heights), bound) == outcome(one_by_one, bound)


@given(terrains())
@settings(deadline=None, max_examples=200)
def test_nothing_jumps_at_a_knot(terrain):
    near = 1e-9
    before, after = at(terrain, terrain.x - near), at(terrain, terrain.x + near)
    assert before[[0, 3, 4]] == pytest.approx(after[[0, 3, 4]], abs=2 * near * 10 / terrain.spacing + 1e-12)


@given(terrains(), st.floats(-30, 30))
@settings(deadline=None, max_examples=200)
def test_the_normal_stands_on_the_slope(terrain, x):
    step = terrain.spacing * 1e-4
    place = (x - terrain.start) / terrain.spacing
    if abs(place - round(place)) < 2e-4:
        return
    behind, here, ahead = at(terrain, [x - step, x, x + step]).T
    assert here[1] * 2 * step + here[2] * (ahead[0] - behind[0]) == pytest.approx(0, abs=1e-12)


def test_flat_ground_follows_the_laws_exactly():
    assert Terrain.flat() == Terrain()
    for x in (-1e6, -0.3, 0.0, 1e6):
        assert at(Terrain(), x)[:, 0].tolist() == [0, 0, 1, 1, 1]


@pytest.mark.parametrize("angle", [-0.3, 0.1, 0.5])
def test_slopes_and_ramps(angle):
    for x in (-200.0, 0.0, 3.0):
        height, nx, ny = at(Terrain.slope(angle), x)[:3, 0]
        assert height == pytest.approx(x * math.tan(angle), abs=1e-12)
        assert (nx, ny) == pytest.approx((-math.sin(angle), math.cos(angle)))
    assert at(Terrain.slope(angle), 2 * LONG_WAY)[2] == 1
    ramp = Terrain.ramp(angle, start=1.0, length=2.0)
    heights = ramp.height_at(np.array([0.0, 1.0, 2.0, 3.0, 9.0]))
    assert heights == pytest.approx(np.tan(angle) * np.array([0, 0, 1, 2, 2]))


def test_patches():
    soft_then_ice = Terrain.patches([(2.0, 3.0, 1.0, 0.1), (0.5, 1.5, 0.2, 1.5)], spacing=0.05)
    x = [0.0, 0.45, 0.5, 1.0, 1.5, 1.55, 1.8, 2.0, 2.99, 3.05, 9.0]
    _, _, _, stiffness, friction = at(soft_then_ice, x)
    assert stiffness == pytest.approx([1, 1, 0.2, 0.2, 0.2, 1, 1, 1, 1, 1, 1])
    assert friction == pytest.approx([1, 1, 1.5, 1.5, 1.5, 1, 1, 0.1, 0.1, 1, 1])
    assert set(soft_then_ice.height) == {0}
    assert Terrain.patches([]) == Terrain.flat()


def test_lines_through_uneven_points():
    hill = Terrain.through([0, 0.3, 1.0], [0, 0.1, 0.0], friction=[1, 0.5, 0.5], spacing=0.05)
    x = np.linspace(-1, 2, 301)
    assert hill.height_at(x) == pytest.approx(np.interp(x, [0, 0.3, 1.0], [0, 0.1, 0.0]), abs=1e-12)
    assert at(hill, 0.15)[4] == pytest.approx([0.75])


def test_what_is_not_a_number_stays_so():
    for terrain in (Terrain(), Terrain.ramp(0.2)):
        assert np.isnan(at(terrain, math.nan)[[0, 3, 4]]).all()

"""Ranges of lengths: inside them a leg assembles, beyond them it does not."""

import pytest

from hoof_env import cli
from hoof_env.errors import GeometryError, ParameterError
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.ranges import length_ranges


@pytest.mark.parametrize("preset", ["identified", "jansen", "klann", "fourbar"])
def test_a_leg_assembles_inside_and_not_beyond(preset):
    leg = load_geometry(preset)
    ranges = length_ranges(leg)
    assert list(ranges) == list(leg.lengths)
    for name, (length, low, high) in ranges.items():
        assert 1e-3 <= low < length == leg.lengths[name] < high <= 1e3
        for end, beyond in ((low, low - 0.01 * (length - low)), (high, high + 0.01 * (high - length))):
            leg.replace(lengths={name: end})
            with pytest.raises(GeometryError if beyond >= 1e-3 else ParameterError):
                leg.replace(lengths={name: beyond})


def test_a_four_bar_turns_by_grashofs_rule():
    """The crank turns fully while the shortest and the longest link are no longer than the others."""
    leg = load_geometry("fourbar")
    crank, coupler, rocker = (leg.lengths[name] for name in ("OP", "PC", "BC"))
    (place,) = leg.pivot.values() if isinstance(leg.pivot, dict) else (leg.pivot,)
    frame = float(sum(x**2 for x in place)) ** 0.5
    _, low, high = length_ranges(leg)["PC"]
    assert low == pytest.approx(frame + crank - rocker, rel=1e-3)
    assert high == pytest.approx(frame + rocker - crank, rel=1e-3)
    assert length_ranges(leg)["OP"].high == pytest.approx(
        min(rocker + coupler - frame, frame + rocker - coupler), rel=1e-3
    )


def test_the_command_prints_all(capsys):
    assert cli.main(["lengths", "--preset", "fourbar"]) == 0
    shown = capsys.readouterr().out
    for word in ("PC ", "% ", "hip_height 1.69", "walk: the hoof reaches 2.0", "Choose a hip_height"):
        assert word in shown
    assert cli.main(["lengths", "--preset", "mule"]) == 2
    with pytest.raises(ParameterError, match="geometry: expected Geometry, got 'fourbar'"):
        length_ranges("fourbar")

"""Falls of a horse under disturbances: more with their strength, none without, in the same episodes."""

import pytest

from agents import falls
from hoof_env.tasks.disturbances import ROUGH_PUSH, ROUGH_SLOPE, ROUGHNESS, rough_ground
from hoof_env.tasks.parameters import make_terrain


def test_falls_grow_with_the_strength():
    found = [falls.falls_of("reference", strength, 24) for strength in (0.0, 2.0)]
    assert found[0] == (0.0, 1.0)
    assert found[1][0] > 0.5
    assert found[1][0] + found[1][1] <= 1.0
    assert falls.falls_of("reference", 2.0, 24) == found[1]


@pytest.mark.parametrize("strength", [0.5, 1.0, 2.0])
def test_strengths_are_in_units(strength):
    """Slopes and bumps of the ground, and pushes over the mass, are those that the constants say."""
    settings = rough_ground(strength, 100.0)
    terrain = make_terrain(settings["terrain"])
    smooth = make_terrain({**settings["terrain"], "roughness": 0.0})
    bumps = [a - b for a, b in zip(terrain.height, smooth.height, strict=True)]
    assert 0.9 * ROUGHNESS * strength < max(map(abs, bumps)) <= ROUGHNESS * strength + 1e-12
    steps = [abs(b - a) / smooth.spacing for a, b in zip(smooth.height, smooth.height[1:], strict=False)]
    # The last piece of a hill is rounded to whole knots.
    assert 0.9 * ROUGH_SLOPE * strength < sorted(steps)[-20] <= 1.2 * ROUGH_SLOPE * strength
    low, high = settings["push_impulse"]
    assert settings["strength"] * high / 100.0 == pytest.approx(ROUGH_PUSH * strength)
    assert low == -high

"""Invalid grounds, terrains and contacts, with the text of each error: settings (`GROUNDS`), presets
(`PRESETS`), further calls (`CALLS`)."""

import json
import math

import numpy as np
import pytest

from hoof_env.errors import DataFileError, ParameterError
from hoof_env.ground.contact import Ground, load_ground
from hoof_env.ground.laws import damping
from hoof_env.ground.stiffness import contact_rates
from hoof_env.ground.terrain import Terrain
from tests.ground.test_preset import with_ground

GROUNDS = [
    ({"stiffness": 0.0}, "stiffness: expected .*got 0.0"),
    ({"exponent": 1.4}, "exponent: expected a multiple of 1/8, .*got 1.4"),
    ({"exponent": 0.5}, r"exponent: expected .*\[1, 3\], got 0.5"),
    ({"normal_law": "hertz"}, "normal_law: expected .*got 'hertz'"),
    ({"restitution": -0.1}, "restitution: expected .*got -0.1"),
    ({"restitution": 0.0, "normal_law": "flores"}, "damping grows without bound"),
    ({"approach_floor": 0.0}, "approach_floor: expected .*got 0.0"),
    ({"approach": "guessed"}, "approach: expected .*interpolated, sampled, got 'guessed'"),
    ({"friction_law": "coulomb"}, "friction_law: expected .*ambrosio, tanh, threlfall, got 'coulomb'"),
    ({"friction": math.nan}, "friction: expected .*got nan"),
    ({"friction_slow": 0.02}, "friction_fast: expected .*friction_slow = 0.02"),
    ({"reference_mass": 0.0}, "reference_mass: expected .*got 0.0"),
]
"""Settings and words."""


@pytest.mark.parametrize(("given", "words"), GROUNDS, ids=str)
def test_grounds(given, words):
    with pytest.raises(ParameterError, match=words):
        Ground(**given)


PRESETS = [
    (1.375, "ground: expected .*got 1.375"),
    ({"n": 1.375}, "only the entries stiffness, exponent, got .*'n'"),
    ({"friction": 0.4}, "only the entries .*got .*'friction'"),
    ({"exponent": 0.5}, r"ground: exponent: expected .*\[1, 3\], got 0.5"),
    ({"exponent": "1.5"}, "ground: exponent: expected .*got '1.5'"),
    ({"exponent": None}, "ground: exponent: expected .*got None"),
    ({"stiffness": math.nan}, "ground: stiffness: expected .*got nan"),
    ({"stiffness": -2e4}, "ground: stiffness: expected .*got -20000.0"),
]
"""Grounds of a preset, and words."""


@pytest.mark.parametrize(("ground", "words"), PRESETS, ids=str)
def test_presets(ground, words, tmp_path):
    """Each error names the file."""
    path = tmp_path / "leg.json"
    path.write_text(json.dumps(with_ground(ground)), encoding="utf-8")
    with pytest.raises(DataFileError, match=words) as caught:
        load_ground(path)
    assert "leg.json" in str(caught.value)


CALLS = [
    (lambda: load_ground("identified", exponent=9), "exponent: expected .*got 9"),
    # damping of a law
    (lambda: damping("hertz", 1.0, 2e4, 80.0), r"normal_law: expected .*exact, .*, got 'hertz'"),
    (
        lambda: damping("hu-guo", 1.5, 2e4, 80.0),
        r"restitution: expected .*\[0, 1\], got 1.5",
    ),
    (
        lambda: damping("lankarani-nikravesh", np.nan, 2e4, 80.0),
        r"restitution: expected .*\[0, 1\], got nan",
    ),
    *(
        (
            lambda law=law: damping(law, 0, 2e4, 80.0),
            rf"restitution: expected .*\[0.01, 1\] for '{law}'",
        )
        for law in ("flores", "gonthier", "hu-guo")
    ),
    # rates of a contact
    (lambda: contact_rates(Ground(), 0.0, 1.0), "mass: expected .*got 0.0"),
    (lambda: contact_rates(Ground(), 1.0, -1.0), "load: expected .*got -1.0"),
    (lambda: contact_rates(Ground(), 1.0, 1.0, sliding_mass=math.nan), "sliding_mass: expected .*got nan"),
    (
        lambda: contact_rates(Ground(), 1.0, 1.0).longest_steps("leapfrog"),
        "scheme: expected .*got 'leapfrog'",
    ),
    (lambda: contact_rates(Ground(), 1.0, 1.0).longest_steps("rk4", 0.0), "tolerance: expected .*got 0.0"),
    # terrains
    (lambda: Terrain(()), r"terrain.height: expected a row .*got \(\)"),
    (lambda: Terrain(3.0), "terrain.height: expected a row .*got 3.0"),
    (lambda: Terrain("012"), r"terrain.height\[0\]: expected .*got '0'"),
    (lambda: Terrain((0, math.nan)), r"terrain.height\[1\]: expected .*got nan"),
    (lambda: Terrain((0, 1), (1, 1, 1)), r"terrain.stiffness: expected 2 numbers, got \(1, 1, 1\)"),
    (lambda: Terrain((0, 1), stiffness=0), "terrain.stiffness: expected .*got 0"),
    (lambda: Terrain((0, 1), friction=(1, -1)), r"terrain.friction\[1\]: expected .*got -1"),
    (lambda: Terrain((0, 1), spacing=0), "terrain.spacing: expected .*got 0"),
    (lambda: Terrain((0, 1), start=math.inf), "terrain.start: expected .*got inf"),
    (lambda: Terrain.slope(1.6), "angle: expected .*got 1.6"),
    (lambda: Terrain.ramp(0.1, length=-1), "length: expected .*got -1"),
    (lambda: Terrain.through([0, 0], [1, 1]), r"x: expected .*increasing .*got \[0, 0\]"),
    (lambda: Terrain.through([0, 1], [1]), r"height: expected 2 numbers, got \[1\]"),
    (lambda: Terrain.through([0, 1e6], [1, 1]), "terrain.spacing: expected .*knots.*got"),
    (lambda: Terrain.patches([(1, 0, 1, 1)]), r"patches\[0\]: expected \(x0, x1, .*got \(1, 0, 1, 1\)"),
    (lambda: Terrain.patches([(0, 1, 1)]), r"patches\[0\]: expected \(x0, x1, .*got \(0, 1, 1\)"),
    (lambda: Terrain.patches(None), "patches: expected a row of patches, got None"),
    (lambda: Terrain.patches([(0, 1, 1, 1)], spacing="fine"), "terrain.spacing: .*got 'fine'"),
    (lambda: Terrain.patches([1]), r"patches\[0\]: expected a row .*got 1"),
    (lambda: Terrain.patches([(0, 2, 1, 1), (1, 3, 1, 1)]), "patches: expected patches apart.*got"),
    (lambda: Terrain.patches([(0, 2, 1, 1)], spacing=0), "terrain.spacing: expected .*got 0"),
    (lambda: Terrain.from_dict({"heights": [0]}), "only the entries height, .*got .*heights"),
    (lambda: Terrain.from_dict([]), r"terrain: expected .*got \[\]"),
]
"""Calls and words."""


@pytest.mark.parametrize(("call", "words"), CALLS, ids=[words for _, words in CALLS])
def test_calls(call, words):
    with pytest.raises(ParameterError, match=words):
        call()

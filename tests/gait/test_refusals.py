"""Gaits, their files and filters of commands that cannot be, by the words of each error."""

import json

import numpy as np
import pytest

from hoof_env.errors import DataFileError, ParameterError
from hoof_env.gait import (
    FASTEST_CRANK,
    LIMITS,
    PARAMETERS,
    FilterSettings,
    GaitParameters,
    HarmonicGait,
    gait_names,
    load_gait,
)
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import load_geometry
from hoof_env.paper_solver.solver import ConstrainedLeg
from tests.legs import FIRST_FIT

GAIT = dict(zip(PARAMETERS, (1.0, 0.5, 0.0, 0.0), strict=True))
HARMONIC = HarmonicGait(5.0, 0.4, 0.1, -0.2, (0.1, 0.05))
BOUNDS = {**LIMITS, PARAMETERS[0]: (0.0, FASTEST_CRANK)}

CALLS = [
    (
        lambda: GaitParameters.from_array([1.0, 0.5, 0.0]),
        r"expected 4 values .*crank_speed.*, got shape \(3,\)",
    ),
    *(
        (lambda name=name, value=value: GaitParameters(**{**GAIT, name: value}),
         f"{name}: expected .*got {value!r}")
        for name, (low, high) in BOUNDS.items()
        for value in (low - 1e-6, high + 1e-6, np.nan, np.inf, "fast", None, True)
    ),
    (lambda: load_gait("trot", FIRST_FIT), "gait: expected .*run, walk, got 'trot'"),
    (lambda: load_gait("carrying_walk", FIRST_FIT), "gait: expected .*run, walk, got 'carrying_walk'"),
    (
        lambda: ConstrainedLeg(load_geometry(), Ground()).reset(HARMONIC),
        "gait: expected a swing .*1 harmonic, got",
    ),
    *(
        (lambda given=given: FilterSettings(**given), words)
        for given, words in (
            ({"gain": 0.0}, "filters.gain: expected .*got 0.0"),
            ({"swing_rate": -1.0}, "filters.swing_rate: expected .*got -1.0"),
            ({"crank_rate": 20.0, "crank_acc": 399.0},
             r"gain \* crank_rate <= crank_acc .*got 20 \* 20 > 399"),
            ({"swing_rate": 5.0, "swing_acc": 80.0},
             r"gain \* swing_rate <= swing_acc .*got 20 \* 5 > 80"),
        )
    ),
]  # fmt: skip
"""Calls and words."""


@pytest.mark.parametrize(("call", "words"), CALLS, ids=[words for _, words in CALLS])
def test_calls(call, words):
    with pytest.raises(ParameterError, match=words):
        call()


NONE = "expected .*'gaits' .*gait, got"
FILES = [
    (load_gait, None, DataFileError, f"{NONE} None"),
    (load_gait, {}, DataFileError, f"{NONE} {{}}"),
    (gait_names, None, DataFileError, f"{NONE} None"),
    (gait_names, {}, DataFileError, f"{NONE} {{}}"),
    (load_gait, {"walk": 3}, DataFileError, "gait 'walk': expected crank_speed, .*got 3"),
    (load_gait, {"walk": {"crank_speed": 6.0}}, DataFileError, "gait 'walk': expected crank_speed, .*got"),
    (load_gait, {"walk": {**GAIT, "crank_speed": 9999}}, ParameterError, "crank_speed: expected .*got 9999"),
]
"""Function, gaits of a preset, class and words of the error."""


@pytest.mark.parametrize(("function", "gaits", "error", "words"), FILES)
def test_files(function, gaits, error, words, tmp_path):
    """The file is named."""
    path = tmp_path / "bad.json"
    path.write_text(json.dumps({"gaits": gaits}))
    with pytest.raises(error, match=words) as caught:
        function(*(["walk"] if function is load_gait else []), path)
    assert "bad.json" in str(caught.value)

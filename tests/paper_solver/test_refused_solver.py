"""Refusals of the paper's solver, with the text of each error; gaits and legs are in their own tables."""

import numpy as np
import pytest

from hoof_env.errors import ParameterError
from hoof_env.gait import load_gait
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import load_geometry
from hoof_env.paper_solver.solver import ConstrainedLeg, new_trace

LEG = load_geometry()
RUN = load_gait("run")
NO_NUMBERS = "command: expected .*got"

MADE = [
    *(({"geometry": value}, "geometry: expected Geometry, got") for value in (None, "klann", np.zeros(2))),
    *(
        ({"ground": value}, "ground: expected Ground, got")
        for value in (None, 0.4, {"stiffness": 2e4}, Ground)
    ),
    *(
        ({"filters": value}, "filters: expected FilterSettings, got")
        for value in ({}, [], 0, 20.0, np.zeros(2))
    ),
    *(({"sim_dt": value}, "sim_dt: expected .*number") for value in (0, True, "1e-3", np.nan, [1e-3])),
    *(({"alpha": value}, "alpha: expected .*number") for value in (-1, np.inf, np.array(True))),
    ({"integrator": "leapfrog"}, "integrator: expected .*got 'leapfrog'"),
]
"""Arguments and words."""


@pytest.mark.parametrize(("given", "words"), MADE, ids=str)
def test_solvers(given, words):
    with pytest.raises(ParameterError, match=words):
        ConstrainedLeg(**{"geometry": LEG, "ground": Ground()} | given)


CALLS = [
    *(
        (lambda leg, gait=gait: leg.reset(gait), "gait: expected GaitParameters, got")
        for gait in ("run", None, [1.0] * 4)
    ),
    *(
        (lambda leg, given=given: leg.reset(RUN, **given), words)
        for given, words in (
            ({"theta": np.nan}, "theta: expected .*number"),
            ({"x": "1"}, "x: expected .*number"),
            ({"height": 3.0}, "a fixed trunk rests at 1.6975 m, got 3.0 and 0.0"),
            ({"height": np.zeros(2)}, "height: expected .*number"),
            ({"speed": 1.0}, "a fixed trunk rests at 1.6975 m, got None and 1.0"),
            ({"speed": np.zeros(2)}, "speed: expected .*number"),
            ({"speed": np.nan}, "speed: expected .*number"),
        )
    ),
    *(
        (lambda leg, command=command: leg.advance(command, new_trace(2)), words)
        for command, words in (
            (np.zeros(3), "command: expected 4 values"),
            (["1", "2", "3", "4"], NO_NUMBERS),
            ([True] * 4, NO_NUMBERS),
            ([1j] * 4, NO_NUMBERS),
            ([np.nan] * 4, NO_NUMBERS),
            (None, NO_NUMBERS),
            ("run", NO_NUMBERS),
            (10**400, NO_NUMBERS),
        )
    ),
    *(
        (lambda leg, trace=trace: leg.advance(RUN.to_array(), trace), "trace: expected")
        for trace in (None, [], np.zeros(2))
    ),
]
"""Calls of a solver after a reset, and words."""


@pytest.mark.parametrize(("call", "words"), CALLS)
def test_calls(call, words):
    """The state stays as it was."""
    leg = ConstrainedLeg(LEG, Ground())
    leg.reset(RUN)
    before = leg.state.copy()
    with pytest.raises(ParameterError, match=words):
        call(leg)
    assert leg.state.q.tolist() == before.q.tolist()
    assert leg.state.body == before.body
    assert leg.state.motion == before.motion

"""Calls of the engine that are cut into parts, of which nothing is seen outside; columns from there."""

from typing import Annotated

import numpy as np
import pytest

from hoof_env import Limb, ParameterError, Trunk, TrunkEngine, load_gait, load_geometry
from hoof_env.dynamics import engine as engine_module
from hoof_env.dynamics import layout
from hoof_env.dynamics.layout import PLAIN, Quantity, StrideSums, stride_peaks, stride_sums
from hoof_env.simd.layout import Row


def run(steps, part=None, monkeypatch=None, mass=100.0, **options):
    if part:
        monkeypatch.setattr(engine_module, "PART", part)
        monkeypatch.setattr(engine_module, "MIN_PART", part)
    leg = load_geometry("identified")
    engine = TrunkEngine(
        [Limb(leg)], Trunk("rail", mass=mass, height=leg.hip_height), strides=True, **options
    )
    engine.reset(load_gait("walk", "identified"))
    return engine, engine.advance(steps=steps)


@pytest.mark.parametrize("num_envs", [1, 9])
def test_parts_of_a_call_are_one_call(monkeypatch, num_envs):
    whole, _ = run(997, num_envs=num_envs)
    parts, _ = run(997, 100, monkeypatch, num_envs=num_envs)
    for name, values in whole.state.items():
        assert np.array_equal(values, parts.state[name]), name
    for name, values in whole.strides.items():
        assert values == pytest.approx(parts.strides[name], rel=1e-12), name
    for name, values in whole.account.items():
        assert values == pytest.approx(parts.account[name], rel=1e-9), name
    assert np.array_equal(whole.results, parts.results)


def test_an_interrupt_is_heard_between_two_parts(monkeypatch):
    engine, _ = run(10, 100, monkeypatch)
    once, calls = engine._go_substeps, []

    def interrupted(substeps, account):
        calls.append(substeps)
        if len(calls) == 3:
            raise KeyboardInterrupt
        once(substeps, account)

    monkeypatch.setattr(engine, "_go_substeps", interrupted)
    with pytest.raises(KeyboardInterrupt):
        engine.advance(steps=10**9)
    assert len(calls) == 3
    assert max(calls) <= 100


@pytest.mark.parametrize("value", [1e7, -1e6, 1e300])
def test_no_number_of_a_column_is_taken_for_an_address(value):
    """Each row in turn; a wrong one once ended the process."""
    engine, _ = run(5)
    good = engine.column(0)
    refused = []
    for row in range(len(good)):
        column = good.copy()
        column[row] = value
        try:
            engine.set_column(0, column)
            engine.advance(steps=3)
        except ParameterError:
            refused.append(row)
        engine.set_column(0, good)
    assert bool(refused) == (value == 1e300)  # places and angles beyond `MAX_STATE`
    assert np.array_equal(engine.column(0), good)


class MoreSums(StrideSums):
    """Sums with a peak behind the last field, which one leg does not have."""

    later: Annotated[Row, Quantity("N", "of x", is_peak=True)]


@pytest.mark.parametrize("features", [PLAIN, PLAIN._replace(has_limits=True)])
def test_each_row_of_the_sums_says_whether_it_is_a_peak(features, monkeypatch):
    assert len(stride_peaks(features)) == len(stride_sums(features)) == features.of(StrideSums).size
    found = dict(zip(stride_sums(features), stride_peaks(features), strict=True))
    assert [name for name in found if found[name]] == ["highest_grf"]
    monkeypatch.setattr(layout, "StrideSums", MoreSums)
    assert stride_sums(features)[-1] == "later"
    assert stride_peaks(features)[-1]

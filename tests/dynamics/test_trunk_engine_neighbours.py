"""What happens to one environment is no business of its neighbours, alone or side by side."""

from dataclasses import replace

import numpy as np
import pytest

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Limb, Motor, Prescribed, Result, Trunk
from hoof_env.errors import ParameterError
from hoof_env.gait.gait import GaitParameters, load_gait
from hoof_env.leg.geometry import load_geometry

LEG, WALK = load_geometry("first_fit"), load_gait("walk", "first_fit")
HANGING = Trunk("suspended", height=LEG.hip_height)


@pytest.mark.parametrize("n", [3, 8, 9])
def test_a_reset_leaves_results_and_sums_of_the_others(n):
    engine = TrunkEngine(Limb(LEG), HANGING, num_envs=n, strides=True)
    y, vy = np.full(n, 1.7), np.zeros(n)
    y[1], vy[1] = 0.05, -100.0
    engine.reset(WALK, 0.0, y=y, vy=vy)
    assert list(engine.advance(steps=2)[:3]) == [Result.OK, Result.FALLEN, Result.OK]
    before = engine.strides
    engine.reset(WALK, 0.0, envs=[0])
    assert list(engine.results[:3]) == [Result.OK, Result.FALLEN, Result.OK]
    for name, values in engine.strides.items():
        np.testing.assert_array_equal(values[:, 1:], before[name][:, 1:], err_msg=name)


@pytest.mark.parametrize("n", [1, 8])
def test_a_start_that_fails_is_whole(n):
    """It fails again at once, from the momentum that its speed means."""
    engine = TrunkEngine(Limb(LEG), HANGING, num_envs=n)
    engine.reset(WALK, 0.0, y=-0.01, vx=1.0)
    assert set(engine.results) == {Result.FALLEN}
    assert engine.state["momentum_x"] == pytest.approx(engine.tally().momentum.real)
    np.testing.assert_array_equal(engine.report["vx"], np.ones(n))
    assert set(engine.advance(steps=1)) == {Result.FALLEN}


@pytest.mark.parametrize("calls", [1, 60, 600])
def test_no_crank_passes_a_dead_point_unnoticed(calls):
    rocker = LEG.replace(lengths={"CF": 0.8 * LEG.lengths["CF"]}, full_turn=False)
    engine = TrunkEngine(Limb(rocker, drive=Prescribed()), Trunk("fixed", height=60.0, drag=0.0))
    engine.reset(GaitParameters(8.0, 0.3, 0.0, 0.0), 2.0)
    results = [int(engine.advance(steps=600 // calls)[0]) for _ in range(calls)]
    assert Result.DEAD_POINT in results
    assert np.isfinite(engine.account["crank_work"]).all()
    assert engine.state["theta"][0, 0] < 6.0


@pytest.mark.parametrize("n", [3, 8])
def test_a_failure_leaves_the_sums_of_the_others(n):
    engines = [TrunkEngine(Limb(LEG), HANGING, num_envs=n, strides=True) for _ in range(2)]
    for engine, is_poisoned in zip(engines, (False, True), strict=True):
        engine.reset(WALK, np.linspace(0, 3, n)[None])
        engine.advance(WALK.to_array(), 300)
        state = engine.get_state()
        if is_poisoned:
            state["limbs"][0, 1, 1] = 1e200
        engine.set_state(state)
        assert engine.advance(steps=200)[1] == (Result.NOT_FINITE if is_poisoned else Result.OK)
    sums = [engine.strides for engine in engines]
    assert sums[0]["highest"][0, 0] > 0
    for name in sums[0]:
        np.testing.assert_array_equal(sums[0][name][:, 0], sums[1][name][:, 0], err_msg=name)


def test_what_environments_share_cannot_be_varied():
    engine = TrunkEngine(Limb(LEG, drive=Motor()), HANGING, num_envs=2)
    for change, message in (
        ({"trunk": "x"}, "trunk: expected Trunk"),
        ({"ground": 3}, "ground: expected Ground"),
        ({"trunk": replace(HANGING, kind="rail")}, "trunk.kind: expected 'suspended'"),
        ({"trunk": replace(HANGING, height=3.0)}, "trunk.height: expected"),
        ({"drive": Prescribed()}, "drive: expected a Motor"),
    ):
        with pytest.raises(ParameterError, match=message):
            engine.vary(0, **change)
    for env in (-1, 2, 1.5):
        with pytest.raises(ParameterError, match="env: expected"):
            engine.vary(env)
        with pytest.raises(ParameterError, match="env: expected"):
            engine.column(env)
    with pytest.raises(ParameterError, match="column: expected shape"):
        engine.set_column(0, np.zeros(3))


def test_a_state_cannot_point_outside_the_tables():
    engine = TrunkEngine(Limb(LEG), HANGING)
    engine.reset(WALK, 0.3)
    state = engine.get_state()
    state["limb_settings"][:, 4] = 1e12
    engine.set_state(state)
    assert engine.advance(steps=10)[0] == Result.OK

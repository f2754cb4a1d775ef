"""Stances, peaks and work of a run are what its record says, counted by the environments' earlier account."""

import numpy as np
import pytest

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Limb, Prescribed, Trunk
from hoof_env.errors import ParameterError
from hoof_env.gait.gait import load_gait
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import load_geometry

LEG, RUN = load_geometry("first_fit"), load_gait("run", "first_fit")
LIMB = Limb(LEG, drive=Prescribed())
TRUNKS = {
    "suspended": Trunk(height=LEG.hip_height),
    "fixed": Trunk(kind="fixed", height=LEG.hip_height - 0.05),
}


def stances(load, force, theta, threshold):
    """Peaks of all stances: split where the load ends or after a revolution."""
    peaks, opened = [], None
    for n, f, angle in zip(load, force, theta, strict=True):
        if n <= threshold:
            opened = None
        elif opened is None or angle - opened >= 2 * np.pi:
            opened = angle
            peaks.append(f)
        else:
            peaks[-1] = max(peaks[-1], f)
    return peaks


@pytest.mark.parametrize("kind", TRUNKS)
@pytest.mark.parametrize("legs", [1, 2])
def test_strides_are_those_of_the_record(kind, legs):
    engine = TrunkEngine([LIMB] * legs, TRUNKS[kind], Ground(), strides=True)
    engine.reset(RUN, 0.3 + np.arange(legs))
    sums, rows = [], []
    for _ in range(120):
        for _ in range(20):
            engine.advance(steps=1)
            rows.append(engine.report | engine.state)
    engine.reset(RUN, 0.3 + np.arange(legs))
    for _ in range(120):
        engine.advance(steps=20)
        sums.append(engine.strides)
    record = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    total = {name: np.sum([s[name] for s in sums], axis=0) for name in sums[0]}
    for leg in range(legs):
        toe, heel = record["toe_normal"][:, leg, 0], record["heel_normal"][:, leg, 0]
        rub = record["toe_friction"][:, leg, 0] + record["heel_friction"][:, leg, 0]
        load, force = toe + heel, np.hypot(toe + heel, rub)
        peaks = stances(load, force, record["theta"][:, leg, 0], 0.05 * engine.weight / legs)
        assert len(peaks) > 2
        assert total["stances"][leg, 0] == len(peaks)
        assert total["peak_increase"][leg, 0] == pytest.approx(sum(peaks), rel=1e-12)
        assert max(s["highest"][leg, 0] for s in sums) == pytest.approx(force.max(), rel=1e-12)
        power = np.maximum(record["crank_power"][:, leg, 0], 0) + np.maximum(
            record["hip_power"][:, leg, 0], 0
        )
        assert total["positive_work"][leg, 0] == pytest.approx(1e-3 * power.sum(), rel=1e-12)
        assert total["load_impulse"][leg, 0] == pytest.approx(1e-3 * load.sum(), rel=1e-12)
        assert total["loaded_time"][leg, 0] == pytest.approx(1e-3 * (load > 0).sum())
        slid = toe * record["toe_slide"][:, leg, 0] + heel * record["heel_slide"][:, leg, 0]
        travel = -1e-3 * (slid[load > 0] / load[load > 0]).sum()
        assert total["travel"][leg, 0] == pytest.approx(travel, rel=1e-10)


def test_a_stance_goes_on_from_a_state_that_was_put_back():
    engine = TrunkEngine(LIMB, TRUNKS["suspended"], Ground(), strides=True)
    engine.reset(RUN, 0.3)
    while not engine.strides["stance_open"][0, 0]:
        engine.advance(steps=5)
    engine.advance(steps=20)
    state, before = engine.get_state(), engine.strides["stance_peak"]
    engine.advance(steps=20)
    after = engine.strides
    engine.reset(RUN, 2.0)
    engine.set_state(state)
    assert engine.strides["stance_peak"] == before > 0
    engine.advance(steps=20)
    for name, value in engine.strides.items():
        np.testing.assert_array_equal(value, after[name], err_msg=name)


def test_strides_change_nothing_else():
    engines = [TrunkEngine(LIMB, TRUNKS["suspended"], Ground(), strides=on) for on in (False, True)]
    for engine in engines:
        engine.reset(RUN, 0.3)
        engine.advance(steps=400)
    for name, value in engines[0].state.items():
        np.testing.assert_array_equal(value, engines[1].state[name], err_msg=name)


@pytest.mark.parametrize("name", ["strides", "reactions"])
def test_a_flag_is_a_truth(name):
    with pytest.raises(ParameterError, match=f"{name}: expected True or False, got 'no'"):
        TrunkEngine(LIMB, TRUNKS["suspended"], Ground(), **{name: "no"})

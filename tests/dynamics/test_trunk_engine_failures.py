"""Dead points, reports after a failure, records of a run."""

import numpy as np
import pytest

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Limb, Motor, Prescribed, Result, Trunk
from hoof_env.errors import ParameterError
from hoof_env.gait.gait import GaitParameters, load_gait
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.profile import functions

LEG = load_geometry("first_fit")
WALK = load_gait("walk", "first_fit")
ROCKER = LEG.replace(lengths={"CF": 0.8 * LEG.lengths["CF"]}, full_turn=False)
END = np.radians(144.5)  # where the engine knows no more: the crank's dead point is some 1 deg on
FAR = 60.0  # above the ground [m]


def engine(drive, n=1, kind="fixed", geometry=ROCKER, extra=()):
    limbs = [Limb(geometry, (0.0, 0.0), drive), *extra]
    return TrunkEngine(limbs, Trunk(kind, mass=80.0, height=FAR, drag=0.0), num_envs=n)


def same(one, other, env=...):
    return all(np.array_equal(one[name][..., env], other[name][..., env]) for name in one)


@pytest.mark.parametrize("kind", ["fixed", "free"])
@pytest.mark.parametrize("drive", [Prescribed(), Motor()])
@pytest.mark.parametrize("n", [2, 9])
def test_a_crank_driven_past_its_end(kind, drive, n):
    e = engine(drive, n, kind)
    gait = GaitParameters(2.0, 0.3, 0.0, 0.0)
    e.reset(gait, np.r_[2.0, np.full(n - 1, -1.0)][None])
    results, before, report = [], None, None
    while not results or not results[-1].any():
        before, report = e.state, e.report
        results.append(e.advance(steps=10))
        assert len(results) < 100
    assert results[-1].tolist() == [Result.DEAD_POINT] + [Result.OK] * (n - 1)
    assert "a crank was driven to an angle at which its linkage does not close" in e.messages()[0]
    assert END - 0.1 < e.state["theta"][0, 0] < END + 0.01
    assert same(e.state, before, 0)
    assert same(e.report, report, 0)  # of the last good state
    assert not same(e.state, before, 1)
    e.reset(gait, 0.0, envs=[0])
    assert not e.advance(steps=10).any()


def test_a_crank_that_rocks_keeps_its_energy_account():
    e = engine(Motor(), kind="free", extra=[Limb(LEG, (0.3, 0.0), Prescribed())])
    e.reset(GaitParameters(3.0, 0.3, 0.2, -0.1), [-1.5, 1.0])
    first = e.tally()
    assert not e.advance(steps=1000).any()
    last, total = e.tally(), e.account
    work = total["crank_work"][0] + total["swing_work"][0]
    change = last.kinetic[0] + last.potential[0] - first.kinetic[0] - first.potential[0]
    assert change == pytest.approx(work, abs=1e-4 * abs(last.kinetic[0]))
    theta, r = e.state["theta"][0], e.report
    toe = functions(ROCKER, theta)[0][0, 0] + 1j * functions(ROCKER, theta)[0][0, 1]
    turn = np.exp(1j * (e.state["pitch"][0] + ROCKER.travel * r["phi"][0, 0]))
    assert r["toe_x"][0, 0] + 1j * r["toe_y"][0, 0] == pytest.approx(
        r["x"][0] + 1j * r["y"][0] + turn * toe, abs=1e-10
    )


def test_no_start_where_the_links_have_no_place():
    e = engine(Motor(), 2)
    with pytest.raises(ParameterError, match="theta: the links of leg 0 have no place at some of"):
        e.reset(WALK, np.array([[0.0, np.pi]]))


@pytest.mark.parametrize("value", [{"theta": 1e10}, {"x": -1e10}, {"y": 1e300}, {"pitch": 1e300}])
def test_what_is_too_far_to_be_told_is_refused(value):
    e = engine(Motor(), kind="free", geometry=LEG)
    with pytest.raises(ParameterError, match=rf"{next(iter(value))}: expected numbers within \+-1e\+09"):
        e.reset(WALK, **value)


@pytest.mark.parametrize("n", [3, 9])
def test_a_report_is_of_the_state_that_is_kept(n):
    e = engine(Motor(), n, "free", LEG)
    e.reset(WALK, np.linspace(0, 1, n)[None])
    e.advance(steps=20)
    state, before = e.get_state(), e.report
    state["limbs"][0, 1, 1] = 1e200  # the crank's rate, whose square is no number
    e.set_state(state)
    assert e.advance(steps=5).tolist() == [0, Result.NOT_FINITE] + [0] * (n - 2)
    assert same({"x": e.report["x"], "toe_y": e.report["toe_y"]}, before, 1)
    assert e.messages()[0] == "ok"
    alone = engine(Motor(), n, "free", LEG)
    alone.reset(WALK, np.linspace(0, 1, n)[None])
    alone.advance(steps=20)
    alone.advance(steps=5)
    assert same(e.report, alone.report, 0)
    assert same(e.state, alone.state, 0)
    assert same(e.account, alone.account, 0)


def test_a_state_that_is_put_back_is_reported_and_kept_to_the_bit():
    one, other = engine(Motor(), 2, "free", LEG), engine(Motor(), 2, "free", LEG)
    one.reset(WALK, 0.5, envs=[1])  # the other one is nowhere
    one.advance(steps=30)
    state = one.get_state()
    other.set_state(state)
    assert same(one.report, other.report, 1)
    np.testing.assert_array_equal(other.get_state()["limbs"], state["limbs"])
    state["limbs"][0, 10, 1] += 1.0  # what a hoof point remembers, which an evaluation would overwrite
    other.set_state(state)
    np.testing.assert_array_equal(other.get_state()["limbs"], state["limbs"])


def test_the_record_of_a_run():
    one, other = (engine(Motor(), 2, "free", LEG) for _ in range(2))
    for e in (one, other):
        e.reset(WALK, np.array([[0.0, 1.0]]))
    command = [5.0, 0.3, 0.1, 0.0]
    record = one.run(command, 25, every=10)
    assert record["time"][:, 0] == pytest.approx([0.0, 0.01, 0.02, 0.025])
    assert record["theta"].shape == (4, 1, 2)
    assert set(record) == {*one.state, *one.report, "result"}
    assert not record["result"].any()
    other.advance(command, 20)
    np.testing.assert_array_equal(record["toe_x"][2], other.report["toe_x"])
    np.testing.assert_array_equal(record["theta"][2], other.state["theta"])
    assert (record["theta"][0, 0] == [0.0, 1.0]).all()


def test_a_run_that_fails_ends_its_record():
    e = engine(Prescribed(), 2)
    e.reset(GaitParameters(2.0, 0.3, 0.0, 0.0), np.array([[2.0, -1.0]]))
    record = e.run(steps=1000, every=20)
    assert record["result"].tolist() == [Result.DEAD_POINT, Result.OK]
    assert 2 < len(record["time"]) < 20
    assert np.isfinite(record["theta"]).all()
    with pytest.raises(ParameterError, match="every: expected a whole number, 1 or more, got 0"):
        e.run(steps=10, every=0)

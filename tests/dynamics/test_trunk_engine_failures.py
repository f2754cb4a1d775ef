"""Ends of runs that fail: NaN, dead points, falls; neighbours are not affected."""

import numpy as np
import pytest

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Limb, Motor, Prescribed, Result, Trunk
from hoof_env.errors import ParameterError
from hoof_env.gait import GaitParameters
from hoof_env.ground.contact import Ground
from hoof_env.ground.terrain import Terrain
from hoof_env.leg.profile import functions
from tests.dynamics.scenes import LEG, RUN, WALK, drives_less_losses, energy, same
from tests.dynamics.tally import tally_of

ROCKER = LEG.replace(lengths={"CF": 0.8 * LEG.lengths["CF"]}, full_turn=False)
END = np.radians(144.5)  # where the engine knows no more: the crank's dead point is some 1 deg on
HANGING = Trunk("suspended", height=LEG.hip_height)
LIMBS = (Limb(LEG, (0.4, 0.0), Motor()), Limb(LEG, (-0.4, 0.0), Prescribed()))
FREE = Trunk("free", mass=100.0, height=1.6)


def aloft(drive, n=1, kind="fixed", geometry=ROCKER, extra=()):
    trunk = Trunk(kind, mass=80.0, height=60.0, drag=0.0)
    return TrunkEngine([Limb(geometry, (0.0, 0.0), drive), *extra], trunk, num_envs=n)


@pytest.mark.parametrize("n", [1, 3, 9])
@pytest.mark.parametrize("row", ["crank_angle_rate", "swing_sin_rate"])
@pytest.mark.parametrize(
    ("limbs", "trunk"), [((Limb(LEG),), HANGING), (LIMBS, FREE)], ids=["leg", "two legs"]
)
def test_a_value_that_is_no_longer_finite_fails_its_environment_alone(limbs, trunk, n, row):
    well, ill = (TrunkEngine(limbs, trunk, num_envs=n, strides=True) for _ in range(2))
    for engine in (well, ill):
        engine.reset(WALK, np.linspace(0, 3, n)[None].repeat(len(limbs), 0))
        engine.advance(WALK.to_array(), 300)
        state = engine.get_state()
        if engine is ill:
            state["limbs"][0, list(engine.state)[7:].index(row), 0] = 1e300
        engine.set_state(state)
    report = well.report
    well.advance(steps=100)
    assert ill.advance(steps=100).tolist() == [Result.NOT_FINITE] + [Result.OK] * (n - 1)
    assert "finite" in ill.messages()[0]
    assert ill.messages()[1:] == ["ok"] * (n - 1)
    now = ill.get_state()
    assert all((now[name][..., 0] == state[name][..., 0]).all() for name in ("trunk", "limbs", "account"))
    for name in ("x", "toe_y"):
        assert (ill.report[name][..., 0] == report[name][..., 0]).all()  # of the state that is kept
    for part in ("state", "report", "account", "strides"):
        assert same(getattr(ill, part), getattr(well, part), slice(1, None))
    ill.reset(WALK, envs=[0])
    assert not ill.advance(steps=3).any()


@pytest.mark.parametrize("kind", ["fixed", "free"])
@pytest.mark.parametrize("drive", [Prescribed(), Motor()])
@pytest.mark.parametrize("n", [2, 9])
def test_a_crank_driven_past_its_end(kind, drive, n):
    e = aloft(drive, n, kind)
    gait = GaitParameters(2.0, 0.3, 0.0, 0.0)
    e.reset(gait, np.r_[2.0, np.full(n - 1, -1.0)][None])
    results, before, report = [], None, None
    while not results or not results[-1].any():
        before, report = e.state, e.report
        results.append(e.advance(steps=10))
        assert len(results) < 100
    assert results[-1].tolist() == [Result.DEAD_POINT] + [Result.OK] * (n - 1)
    assert "a crank was driven to an angle at which its linkage does not close" in e.messages()[0]
    assert END - 0.1 < e.state["crank_angle"][0, 0] < END + 0.01
    assert same(e.state, before, 0)
    assert same(e.report, report, 0)  # of the last good state
    assert not same(e.state, before, 1)
    e.reset(gait, 0.0, envs=[0])
    assert not e.advance(steps=10).any()


@pytest.mark.parametrize("calls", [1, 60, 600])
def test_no_crank_passes_a_dead_point_unnoticed(calls):
    engine = aloft(Prescribed())
    engine.reset(GaitParameters(8.0, 0.3, 0.0, 0.0), 2.0)
    results = [int(engine.advance(steps=600 // calls)[0]) for _ in range(calls)]
    assert Result.DEAD_POINT in results
    assert np.isfinite(engine.account["crank_work"]).all()
    assert engine.state["crank_angle"][0, 0] < 6.0


def test_a_crank_that_rocks_keeps_its_energy_account():
    e = aloft(Motor(), kind="free", extra=[Limb(LEG, (0.3, 0.0), Prescribed())])
    e.reset(GaitParameters(3.0, 0.3, 0.2, -0.1), [-1.5, 1.0])
    before = energy(e)
    assert not e.advance(steps=1000).any()
    assert energy(e) - before == pytest.approx(drives_less_losses(e), abs=1e-4 * tally_of(e).kinetic[0])
    r, toe = (
        {name: row[..., 0] for name, row in e.report.items()},
        functions(ROCKER, e.state["crank_angle"][0])[0][0],
    )
    turn = np.exp(1j * (e.state["pitch"][0] + ROCKER.travel * r["swing_angle"][0]))
    expected = complex(r["x"], r["y"]) + turn * complex(toe[0], toe[1])
    assert complex(r["toe_x"][0], r["toe_y"][0]) == pytest.approx(expected, abs=1e-10)


@pytest.mark.parametrize("level", [0.0, -0.4])
def test_a_trunk_that_falls_through_soft_ground(level):
    e = TrunkEngine(LIMBS, FREE, Ground(stiffness=10.0), Terrain((level,)), num_envs=2)
    e.reset([RUN, WALK], y=[1.0, 40.0])
    kept, results = None, []
    for _ in range(100):
        kept = e.get_state()
        results.append(e.advance(steps=10)[0])
        if results[-1]:
            break
    assert results[-1] == Result.FALLEN
    assert set(results[:-1]) == {Result.OK}
    assert "fell through the ground" in e.messages()[0]
    now = e.get_state()
    assert (now["trunk"][:, 0] == kept["trunk"][:, 0]).all()
    assert (now["limbs"][..., 0] == kept["limbs"][..., 0]).all()
    assert now["trunk"][0, 1] > kept["trunk"][0, 1]  # the other one goes on
    assert level < e.report["y"][0] + 0.2
    assert now["trunk"][2, 0] > level - 0.5


@pytest.mark.parametrize("n", [1, 8])
def test_a_start_that_fails_is_whole(n):
    """It fails again at once, from the momentum that its speed means."""
    engine = TrunkEngine(Limb(LEG), HANGING, num_envs=n)
    engine.reset(WALK, 0.0, y=-0.01, vx=1.0)
    assert set(engine.results) == {Result.FALLEN}
    assert engine.state["momentum_x"] == pytest.approx(tally_of(engine).momentum.real)
    np.testing.assert_array_equal(engine.report["vx"], np.ones(n))
    assert set(engine.advance(steps=1)) == {Result.FALLEN}


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
    assert same(engine.strides, before, slice(1, None))


def test_a_state_that_is_put_back_is_reported_and_kept_to_the_bit():
    one, other = (TrunkEngine(Limb(LEG), FREE, num_envs=2) for _ in range(2))
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
    one, other = (TrunkEngine(Limb(LEG), FREE, num_envs=2) for _ in range(2))
    for e in (one, other):
        e.reset(WALK, np.array([[0.0, 1.0]]))
    command = [5.0, 0.3, 0.1, 0.0]
    record = one.run(command, 25, every=10)
    assert record["time"][:, 0] == pytest.approx([0.0, 0.01, 0.02, 0.025])
    assert record["crank_angle"].shape == (4, 1, 2)
    assert set(record) == {*one.state, *one.report, "result"}
    assert not record["result"].any()
    other.advance(command, 20)
    np.testing.assert_array_equal(record["toe_x"][2], other.report["toe_x"])
    np.testing.assert_array_equal(record["crank_angle"][2], other.state["crank_angle"])
    assert (record["crank_angle"][0, 0] == [0.0, 1.0]).all()


def test_a_run_that_fails_ends_its_record():
    e = aloft(Prescribed(), 2)
    e.reset(GaitParameters(2.0, 0.3, 0.0, 0.0), np.array([[2.0, -1.0]]))
    record = e.run(steps=1000, every=20)
    assert record["result"].tolist() == [Result.DEAD_POINT, Result.OK]
    assert 2 < len(record["time"]) < 20
    assert np.isfinite(record["crank_angle"]).all()
    with pytest.raises(ParameterError, match=r"every: expected .*1 .*got 0"):
        e.run(steps=10, every=0)


def test_a_state_cannot_point_outside_the_tables():
    engine = TrunkEngine(Limb(LEG), HANGING)
    engine.reset(WALK, 0.3)
    state = engine.get_state()
    state["limb_settings"][:, 4] = 1e12
    engine.set_state(state)
    assert engine.advance(steps=10)[0] == Result.OK


def test_one_gait_and_one_command_are_for_all_legs():
    one, each = (TrunkEngine(LIMBS, FREE, num_envs=3) for _ in range(2))
    one.reset(RUN, 0.5)
    each.reset([RUN, RUN], [[0.5] * 3] * 2, crank_angle_rate=RUN.crank_speed, envs=[True] * 3)
    one.advance(WALK.to_array(), 30)
    each.advance(np.tile(WALK.to_array()[:, None], (2, 1, 3)), 30)
    assert same(one.state, each.state)

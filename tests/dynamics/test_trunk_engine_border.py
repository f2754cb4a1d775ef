"""The engine of several legs refuses what it cannot mean, and says how a run ended that went wrong."""

import warnings

import numpy as np
import pytest

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Limb, Motor, Prescribed, Result, Trunk
from hoof_env.dynamics.step_length import StepWarning
from hoof_env.dynamics.stepping import SCHEMES
from hoof_env.errors import NotStartedError, ParameterError
from hoof_env.gait.gait import GaitParameters, load_gait
from hoof_env.ground.contact import Ground
from hoof_env.ground.terrain import Terrain
from hoof_env.leg.geometry import load_geometry

LEG = load_geometry("first_fit")
RUN, WALK = load_gait("run", "first_fit"), load_gait("walk", "first_fit")
STILL = GaitParameters(0.0, 0.0, 0.0, 0.0)
LIMBS = (Limb(LEG, (0.4, 0.0), Motor()), Limb(LEG, (-0.4, 0.0), Prescribed()))
FREE = Trunk("free", mass=100.0, height=1.6)
THETA, LOWEST = np.array([4.02, 4.18, 4.1, 4.14]), 1.389  # soles level, and how far they are below O [m]


def engine(trunk=FREE, n=3, ground=None):
    e = TrunkEngine(LIMBS, trunk, ground, num_envs=n)
    e.reset([RUN, WALK])
    return e


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"limbs": ()}, r"limbs: expected Limb, one or more, got \(\)"),
        ({"limbs": LEG}, "limbs: expected Limb, one or more, got Geometry"),
        ({"limbs": [LIMBS[0], None]}, "limbs: expected Limb, one or more, got .*None"),
        ({"limbs": LIMBS[:1] * 33}, "limbs: expected at most 32, got 33"),
        ({"limbs": 3}, "limbs: expected Limb, one or more, got 3"),
        ({"trunk": "free"}, "trunk: expected Trunk, got 'free'"),
        ({"trunk": None}, "trunk: expected Trunk, got None"),
        ({"contact_law": 3}, "contact_law: expected a plain function of 4 arguments, got 3"),
        ({"contact_law": lambda d: d}, "contact_law: expected a function of 4 arguments, got one of"),
        ({"ground": 2e4}, "ground: expected Ground, got 20000"),
        ({"terrain": 0.1}, "terrain: expected Terrain, got 0.1"),
        ({"filters": {"gain": 3}}, "filters: expected FilterSettings, got {'gain': 3}"),
        ({"integrator": "rk5"}, "integrator: expected one of .*midpoint.*, got 'rk5'"),
        ({"integrator": 4}, "integrator: expected one of .*midpoint.*, got 4"),
        ({"sim_dt": 0.0}, "sim_dt: expected a finite number in .*, got 0.0"),
        ({"sim_dt": np.nan}, "sim_dt: expected a finite number in .*, got nan"),
        ({"sim_dt": 0.011}, r"sim_dt: expected a finite number in \[1e-07, 0.01\], got 0.011"),
        ({"sim_dt": "1 ms"}, "sim_dt: expected a finite number in .*, got '1 ms'"),
        ({"substeps": 0}, "substeps: expected a whole number, 1 or more, got 0"),
        ({"substeps": 2.0}, "substeps: expected a whole number, 1 or more, got 2.0"),
        ({"substeps": True}, "substeps: expected a whole number, 1 or more, got True"),
        ({"num_envs": 0}, "num_envs: expected a whole number, 1 or more, got 0"),
        ({"num_envs": "4"}, "num_envs: expected a whole number, 1 or more, got '4'"),
    ],
)
def test_an_engine_that_cannot_be(changes, message):
    with pytest.raises(ParameterError, match=message):
        TrunkEngine(**({"limbs": LIMBS, "trunk": FREE} | changes))


@pytest.mark.parametrize(
    ("kind", "changes", "message"),
    [
        ("free", {"gaits": None}, "gaits: expected GaitParameters, one or more, got None"),
        ("free", {"gaits": [RUN]}, "gaits: expected one or 2, got 1"),
        ("free", {"gaits": [RUN] * 3}, "gaits: expected one or 2, got 3"),
        ("free", {"gaits": [RUN, "walk"]}, "gaits: expected GaitParameters, one or more, got .*'walk'"),
        ("free", {"gaits": RUN.to_array()}, "gaits: expected shape .2, 4, 3., got .4,."),
        ("free", {"theta": np.nan}, "theta: expected finite numbers, got nan"),
        ("free", {"theta": [0.0, np.inf]}, "theta: expected finite numbers, got .*inf"),
        ("free", {"theta": None}, "theta: expected finite numbers, got None"),
        ("free", {"theta": "front"}, "theta: expected finite numbers, got 'front'"),
        ("free", {"theta": [0.0] * 3}, r"theta: expected numbers that fit shape \(2, 3\), got \[0.0"),
        ("free", {"theta": np.zeros((2, 2))}, r"theta: expected numbers that fit shape \(2, 3\)"),
        ("free", {"theta_rate": [9.0, WALK.crank_speed + 1]}, "theta_rate: leg 1 is prescribed to turn at"),
        ("free", {"theta_rate": [np.nan, 1.0]}, "theta_rate: expected finite numbers"),
        ("free", {"x": np.inf}, "x: expected finite numbers, got inf"),
        ("free", {"x": [0.0, 1.0]}, r"x: expected numbers that fit shape \(3,\), got \[0.0, 1.0\]"),
        ("free", {"y": np.nan}, "y: expected finite numbers, got nan"),
        ("free", {"pitch": "up"}, "pitch: expected finite numbers, got 'up'"),
        ("free", {"vx": -np.inf}, "vx: expected finite numbers, got -inf"),
        ("free", {"vy": [[0.0]] * 2}, r"vy: expected numbers that fit shape \(3,\)"),
        ("free", {"pitch_rate": np.nan}, "pitch_rate: expected finite numbers, got nan"),
        ("suspended", {"pitch": 0.1}, "pitch: expected 0 of a suspended trunk, got"),
        ("suspended", {"pitch_rate": 0.1}, "pitch_rate: expected 0 of a suspended trunk, got"),
        ("rail", {"vy": 0.1}, "vy: expected 0 of a rail trunk, got"),
        ("rail", {"y": 1.5}, "y: a rail trunk is at 1.6 m, got"),
        ("fixed", {"vx": 0.1}, "vx: expected 0 of a fixed trunk, got"),
        ("fixed", {"y": 1.7}, "y: a fixed trunk is at 1.6 m, got"),
        ("free", {"vx": 1e200}, r"vx: expected numbers within \+-1e\+09, got 1e\+200"),
        ("free", {"theta_rate": [1e200, 1.0]}, r"theta_rate: expected numbers within \+-1e\+09"),
        ("free", {"envs": 1}, r"envs: expected indices below 3 or a mask of shape \(3,\), got 1"),
        ("free", {"envs": [0, 3]}, r"envs: expected indices below 3 or a mask of shape \(3,\), got \[0, 3\]"),
        ("free", {"envs": [-1]}, r"envs: expected indices below 3 or a mask of shape \(3,\), got \[-1\]"),
        ("free", {"envs": [True, False]}, "envs: expected indices below 3"),
        ("free", {"envs": [0.0]}, "envs: expected indices below 3"),
        ("free", {"envs": "all"}, "envs: expected indices below 3"),
    ],
)
def test_a_start_that_cannot_be(kind, changes, message):
    e = engine(Trunk(kind, mass=100.0, height=1.6))
    before = e.get_state()
    with pytest.raises(ParameterError, match=message):
        e.reset(**({"gaits": [RUN, WALK]} | changes))
    after = e.get_state()
    assert all((after[name] == before[name]).all() for name in ("trunk", "limbs", "command", "account"))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([1.0, 2.0],), r"command: expected shape \(4,\), \(2, 4\) or \(2, 4, 3\), got \(2,\)"),
        ((np.zeros((3, 4)),), r"command: expected shape .*, got \(3, 4\)"),
        ((np.zeros((2, 4, 1)),), r"command: expected shape .*, got \(2, 4, 1\)"),
        (([1.0, np.nan, 0.0, 0.0],), "command: expected finite numbers, got .*nan"),
        (("trot",), "command: expected finite numbers, got 'trot'"),
        ((None, -1), "steps: expected a whole number, 0 or more, got -1"),
        ((None, 2**62), r"steps: expected at most 1e\+12, got 4611686018427387904"),
        ((None, 1.0), "steps: expected a whole number, 0 or more, got 1.0"),
    ],
)
def test_an_advance_that_cannot_be(arguments, message):
    e = engine()
    before = e.get_state()
    with pytest.raises(ParameterError, match=message):
        e.advance(*arguments)
    assert (e.get_state()["command"] == before["command"]).all()


def test_before_a_reset_it_is_nowhere():
    e = TrunkEngine(LIMBS, FREE, num_envs=2)
    for move in (e.advance, e.run, lambda: e.advance(steps=0)):
        with pytest.raises(NotStartedError, match=r"before reset\(\): expected reset\(\) first"):
            move()
    assert e.messages() == ["this environment was never reset"] * 2
    e.reset([RUN, WALK], envs=[])
    assert np.isnan(e.state["theta"]).all()
    e.reset([RUN, WALK], envs=[1])
    assert e.advance(steps=10).tolist() == [Result.NOT_FINITE, Result.OK]
    assert e.messages()[1] == "ok"


def test_one_gait_and_one_command_are_for_all_legs():
    one, each = engine(), engine()
    one.reset(RUN, 0.5)
    each.reset([RUN, RUN], [[0.5] * 3] * 2, theta_rate=RUN.crank_speed, envs=[True] * 3)
    one.advance(WALK.to_array(), 30)
    each.advance(np.tile(WALK.to_array()[:, None], (2, 1, 3)), 30)
    assert (one.get_state()["limbs"] == each.get_state()["limbs"]).all()


@pytest.mark.parametrize("n", [1, 9])
@pytest.mark.parametrize("row", ["theta_rate", "swing_sin_rate"])
def test_what_is_no_number_any_more_is_a_result(n, row):
    e = engine(n=n)
    state = e.get_state()
    state["limbs"][0, list(e.state)[7:].index(row), 0] = 1e300
    e.set_state(state)
    assert e.advance(steps=3).tolist() == [Result.NOT_FINITE] + [Result.OK] * (n - 1)
    assert "finite" in e.messages()[0]
    for name in ("trunk", "limbs", "account"):
        assert (e.get_state()[name][..., 0] == state[name][..., 0]).all()
    e.reset([RUN, WALK], envs=[0])
    assert not e.advance(steps=3).any()


@pytest.mark.parametrize("level", [0.0, -0.4])
def test_a_trunk_that_falls_through_soft_ground(level):
    ground, terrain = Ground(stiffness=10.0), Terrain((level,))
    e = TrunkEngine(LIMBS, FREE, ground, terrain, num_envs=2)
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


# -- stiff ground ----------------------------------------------------------------------------------------


def stiff(scheme, substeps=None):
    """A horse of 500 kg comes down from 5 cm at a walk on 1 MN/m^1.5; height, pitch and cranks on the way."""
    ground = Ground(stiffness=1e6, restitution=0.5, approach_floor=0.1, friction_fast=0.05)
    trunk = Trunk("free", mass=500.0 - 4 * LEG.mass, height=LOWEST + 0.05, drag=0.0, pitch_inertia=100.0)
    limbs = [Limb(LEG, (x, 0.0), Motor()) for x in (-1.5, -1.4, -0.1, 0.0)]
    e = TrunkEngine(limbs, trunk, ground, integrator=scheme, substeps=substeps)
    e.reset(WALK, THETA)
    way, most = [], 0.0
    for _ in range(30):
        assert not e.advance(steps=10).any()
        way.append([e.report["y"][0], e.state["pitch"][0], *e.state["theta"][:, 0]])
        most = max(most, e.report["toe_normal"].max())
    assert most > e.weight / 4
    return e, np.array(way)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_stiff_ground_gets_the_substeps_that_it_needs(scheme):
    with warnings.catch_warnings():
        warnings.simplefilter("error", StepWarning)
        chosen, way = stiff(scheme)
        _, fine = stiff(scheme, 8 * chosen.substeps)
    needed = f"expected at most .* s, that is substeps={chosen.substeps} of sim_dt = 0.001 s"
    with pytest.warns(StepWarning, match=f"steps of 0.001 s are too long .*: {needed}"):
        _, coarse = stiff(scheme, 1)
    error, too_long = np.abs(way - fine), np.abs(coarse - fine)
    assert error.max() < 1e-3
    assert too_long.max() > 4 * error.max()


def test_soft_ground_needs_no_more_than_the_step():
    assert engine().substeps == 1

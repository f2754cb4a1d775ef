"""What engines and their parts refuse, by the words of each error: the engine of several legs, the paper's
solver, trunks, springs, limits. A new part adds its rows to `PARTS`."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import HoofSpring, Limb, Limits, Motor, Prescribed, Result, Trunk
from hoof_env.errors import NotStartedError, ParameterError
from hoof_env.gait import HarmonicGait
from hoof_env.ground.contact import Ground
from hoof_env.paper_solver.solver import ConstrainedLeg, new_trace
from tests.dynamics.scenes import HIPS, LEG, LOWEST, NATURAL, RUN, WALK, horse

LIMBS = (Limb(LEG, (0.4, 0.0), Motor()), Limb(LEG, (-0.4, 0.0), Prescribed()))
FREE = Trunk("free", mass=100.0, height=1.6)


def engine(trunk=FREE, n=3, limbs=LIMBS):
    e = TrunkEngine(limbs, trunk, num_envs=n)
    e.reset(WALK)
    return e


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"limbs": ()}, r"limbs: expected Limb, .*got \(\)"),
        ({"limbs": LEG}, "limbs: expected Limb, .*got Geometry"),
        ({"limbs": [LIMBS[0], None]}, "limbs: expected Limb, .*got .*None"),
        ({"limbs": LIMBS[:1] * 33}, "limbs: expected .*32, got 33"),
        ({"limbs": 3}, "limbs: expected Limb, .*got 3"),
        ({"trunk": "free"}, "trunk: expected Trunk, got 'free'"),
        ({"trunk": None}, "trunk: expected Trunk, got None"),
        ({"contact_law": 3}, "contact_law: expected .*4 arguments, got 3"),
        ({"contact_law": lambda d: d}, "contact_law: expected .*4 arguments, got one of"),
        ({"ground": 2e4}, "ground: expected Ground, got 20000"),
        ({"terrain": 0.1}, "terrain: expected Terrain, got 0.1"),
        ({"filters": {"gain": 3}}, "filters: expected FilterSettings, got {'gain': 3}"),
        ({"integrator": "rk5"}, "integrator: expected .*midpoint.*, got 'rk5'"),
        ({"integrator": 4}, "integrator: expected .*midpoint.*, got 4"),
        ({"sim_dt": 0.0}, "sim_dt: expected .*, got 0.0"),
        ({"sim_dt": np.nan}, "sim_dt: expected .*, got nan"),
        ({"sim_dt": 0.011}, r"sim_dt: expected .*\[1e-07, 0.01\], got 0.011"),
        ({"sim_dt": "1 ms"}, "sim_dt: expected .*, got '1 ms'"),
        ({"substeps": 0}, "substeps: expected .*1 .*got 0"),
        ({"substeps": 2.0}, "substeps: expected .*1 .*got 2.0"),
        ({"substeps": True}, "substeps: expected .*1 .*got True"),
        ({"num_envs": 0}, "num_envs: expected .*1 .*got 0"),
        ({"num_envs": "4"}, "num_envs: expected .*1 .*got '4'"),
    ],
)
def test_an_engine_that_cannot_be(changes, message):
    with pytest.raises(ParameterError, match=message):
        TrunkEngine(**({"limbs": LIMBS, "trunk": FREE} | changes))


@pytest.mark.parametrize(
    ("kind", "changes", "message"),
    [
        ("free", {"gaits": None}, "gaits: expected GaitParameters, .*got None"),
        ("free", {"gaits": [RUN]}, "gaits: expected .*2, got 1"),
        ("free", {"gaits": [RUN] * 3}, "gaits: expected .*2, got 3"),
        ("free", {"gaits": [RUN, "walk"]}, "gaits: expected GaitParameters, .*got .*'walk'"),
        ("free", {"gaits": RUN.to_array()}, "gaits: expected shape .2, 4, 3., got .4,."),
        ("free", {"crank_angle": np.nan}, "crank_angle: expected .*got nan"),
        ("free", {"crank_angle": [0.0, np.inf]}, "crank_angle: expected .*got .*inf"),
        ("free", {"crank_angle": None}, "crank_angle: expected .*got None"),
        ("free", {"crank_angle": "front"}, "crank_angle: expected .*got 'front'"),
        (
            "free",
            {"crank_angle": [0.0] * 3},
            r"crank_angle: expected .*fit shape \(2, 3\), got \[0.0",
        ),
        ("free", {"crank_angle": np.zeros((2, 2))}, r"crank_angle: expected .*fit shape \(2, 3\)"),
        (
            "free",
            {"crank_angle_rate": [9.0, WALK.crank_speed + 1]},
            "crank_angle_rate: leg 1 is prescribed to turn at",
        ),
        ("free", {"crank_angle_rate": [np.nan, 1.0]}, "crank_angle_rate: expected finite numbers"),
        ("free", {"x": np.inf}, "x: expected .*got inf"),
        ("free", {"x": [0.0, 1.0]}, r"x: expected .*fit shape \(3,\), got \[0.0, 1.0\]"),
        ("free", {"y": np.nan}, "y: expected .*got nan"),
        ("free", {"pitch": "up"}, "pitch: expected .*got 'up'"),
        ("free", {"vx": -np.inf}, "vx: expected .*got -inf"),
        ("free", {"vy": [[0.0]] * 2}, r"vy: expected .*fit shape \(3,\)"),
        ("free", {"pitch_rate": np.nan}, "pitch_rate: expected .*got nan"),
        ("suspended", {"pitch": 0.1}, "pitch: expected 0 .*suspended trunk, got"),
        ("suspended", {"pitch_rate": 0.1}, "pitch_rate: expected 0 .*suspended trunk, got"),
        ("rail", {"vy": 0.1}, "vy: expected 0 .*rail trunk, got"),
        ("rail", {"y": 1.5}, "y: a rail trunk is at 1.6 m, got"),
        ("fixed", {"vx": 0.1}, "vx: expected 0 .*fixed trunk, got"),
        ("fixed", {"y": 1.7}, "y: a fixed trunk is at 1.6 m, got"),
        ("free", {"vx": 1e200}, r"vx: expected .*\+-1e\+09, got 1e\+200"),
        ("free", {"crank_angle_rate": [1e200, 1.0]}, r"crank_angle_rate: expected .*\+-1e\+09"),
        ("free", {"crank_angle": 1e10}, r"crank_angle: expected .*\+-1e\+09"),
        ("free", {"x": -1e10}, r"x: expected .*\+-1e\+09"),
        ("free", {"y": 1e300}, r"y: expected .*\+-1e\+09"),
        ("free", {"pitch": 1e300}, r"pitch: expected .*\+-1e\+09"),
        ("free", {"envs": 1}, r"envs: expected indices below 3 .*mask of shape \(3,\), got 1"),
        ("free", {"envs": [0, 3]}, r"envs: expected indices below 3 .*mask of shape \(3,\), got \[0, 3\]"),
        ("free", {"envs": [-1]}, r"envs: expected indices below 3 .*mask of shape \(3,\), got \[-1\]"),
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


def with_a_branch(penetration, rate, inverse_speed, ground):
    return ground.stiffness * penetration if rate > 0.0 else 0.0


def test_a_contact_law_that_lanes_cannot_run_is_refused_with_its_operation():
    e = TrunkEngine(Limb(LEG), FREE, num_envs=9, contact_law=with_a_branch)
    with pytest.raises(ParameterError, match=r"contact_law: the contact law .*`if`, .* in with_a_branch \("):
        e.reset(WALK)


def test_no_start_where_the_links_have_no_place():
    rocker = LEG.replace(lengths={"CF": 0.8 * LEG.lengths["CF"]}, full_turn=False)
    e = TrunkEngine(Limb(rocker), Trunk("fixed"), num_envs=2)
    with pytest.raises(
        ParameterError, match="crank_angle: the links of leg 0 cannot be assembled at some of"
    ):
        e.reset(WALK, np.array([[0.0, np.pi]]))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([1.0, 2.0],), r"command: expected shape \(4,\), \(2, 4\) or \(2, 4, 3\), got \(2,\)"),
        ((np.zeros((3, 4)),), r"command: expected shape .*, got \(3, 4\)"),
        ((np.zeros((2, 4, 1)),), r"command: expected shape .*, got \(2, 4, 1\)"),
        (([1.0, np.nan, 0.0, 0.0],), "command: expected .*got .*nan"),
        (("trot",), "command: expected .*got 'trot'"),
        ((None, -1), "steps: expected .*0 .*got -1"),
        ((None, 2**62), r"steps: expected .*1e\+12, got 4611686018427387904"),
        ((None, 1.0), "steps: expected .*0 .*got 1.0"),
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
    assert np.isnan(e.state["crank_angle"]).all()
    e.reset([RUN, WALK], envs=[1])
    assert e.advance(steps=10).tolist() == [Result.NOT_FINITE, Result.OK]
    assert e.messages()[1] == "ok"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"trunk": "x"}, "trunk: expected Trunk"),
        ({"ground": 3}, "ground: expected Ground"),
        ({"trunk": replace(FREE, kind="rail")}, "trunk.kind: expected 'free'"),
        ({"drive": Motor()}, "drive: expected a Prescribed"),
    ],
)
def test_what_environments_share_cannot_be_varied(change, message):
    with pytest.raises(ParameterError, match=message):
        engine().vary(0, **change)


@pytest.mark.parametrize("env", [-1, 3, 1.5])
def test_an_environment_that_is_not_there(env):
    for call in (engine().vary, engine().column):
        with pytest.raises(ParameterError, match="env: expected"):
            call(env)


def test_a_column_of_another_engine():
    with pytest.raises(ParameterError, match="column: expected shape"):
        engine().set_column(0, np.zeros(3))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda s: s.pop("limbs"), "state: .* limbs is missing"),
        (lambda s: s.update(limbs=s["limbs"][:, :-1]), r"state\['limbs'\]: expected shape \(2, 16, 3\)"),
        (lambda s: s.update(trunk=None), r"state\['trunk'\]: expected shape .*, got \(\)"),
        (lambda s: s["limbs"].__setitem__((1, 0, 2), np.nan), r"state\['limbs'\]: expected finite"),
        (lambda s: s["trunk"].__setitem__((1, 0), np.inf), r"state\['trunk'\]: expected finite"),
        (
            lambda s: s.update(layout=engine(Trunk("rail")).get_state()["layout"]),
            "trunk.kind: expected 'free', got 'rail'",
        ),
        (lambda s: s.update(layout=engine(n=4).get_state()["layout"]), "num_envs: expected 3, got 4"),
        (
            lambda s: s.update(layout=engine(limbs=LIMBS[:1]).get_state()["layout"]),
            "state: .*engine; .*",
        ),
        (lambda s: s["layout"].update(substeps=4), "another engine; substeps: expected 1, got 4$"),
        (lambda s: s["layout"].pop("ground.friction"), "ground.friction: expected 0.4, got None"),
        (lambda s: s["layout"].update(more=1), "more: expected None, got 1"),
        (lambda s: s.update(layout=7), "state: expected .*a mapping as layout is missing"),
        (
            lambda s: s["limbs"].__setitem__((1, 0, 2), 1e10),
            r"crank angles: expected .*\+-1e\+09",
        ),
        (lambda s: s["trunk"].__setitem__((1, 0), 1e300), "places and pitch: expected numbers within"),
        (lambda s: s["trunk"].__setitem__((5, 0), -1e10), "places and pitch: expected numbers within"),
    ],
)
def test_a_state_of_another_engine_is_refused(change, message):
    e = engine()
    before, state = e.get_state(), e.get_state()
    change(state)
    with pytest.raises(ParameterError, match=message):
        e.set_state(state)
    e.advance(steps=0)
    np.testing.assert_equal(e.get_state(), before)


# Parts, animals, and the paper's solver

SPRING = HoofSpring(4e4, 600.0)
ANIMAL = Trunk("free", mass=320.0, height=LOWEST, drag=0.0, pitch_inertia=80.0)


def animal(limits, **settings):
    """Four legs on springs."""
    limbs = [Limb(LEG, hip, Motor(), SPRING) for hip in HIPS]
    return TrunkEngine(limbs, ANIMAL, NATURAL, limits=limits, strides=True, **settings)


def constrained(**settings):
    return ConstrainedLeg(LEG, Ground(), **settings)


def commanded(command):
    leg = constrained()
    leg.reset(WALK)
    leg.advance(command, new_trace(1))


def of(make, settings):
    """A call of something with settings."""
    return lambda: make(**settings)


CONSTRAINED_STARTS = (
    ("theta", math.nan, "theta"),
    ("x", math.inf, "x"),
    ("height", 3.0, "height"),
    ("speed", 1.0, "speed"),
)
PARTS = [
    (lambda: HoofSpring(4e4, 0.0), r"hoof_spring.damping: expected .*got 0.0"),
    (lambda: HoofSpring(-1.0, 3.0), r"hoof_spring.stiffness: expected .*got -1.0"),
    (lambda: HoofSpring(4e4, 300.0, 1e4, np.nan), r"tangential_damping: expected .*got nan"),
    (lambda: Limits(pitch=(0.2, -0.2)), r"limits.pitch: expected .*got"),
    (lambda: Limits(clearance="low"), r"limits.clearance: expected .*got 'low'"),
    (lambda: Limb(LEG, spring=4e4), r"limb.spring: expected a HoofSpring or None, got 40000.0"),
    (lambda: horse(length=1.4), r"limbs\[0\].hip: expected .*trunk, 0.7 m .*got -0.75"),
    (lambda: TrunkEngine([Limb(LEG), Limb(LEG, spring=SPRING)], ANIMAL), r"limbs\[1\].spring: expected"),
    (lambda: TrunkEngine(Limb(LEG), ANIMAL, harmonics=4), r"harmonics: expected .*got 4"),
    (lambda: HarmonicGait(5.0, 0.1, 0.1, 0.1, (0.1,)), r"higher: expected the sine and .*got \(0.1,\)"),
    (lambda: HarmonicGait(5.0, 0.1, 0.1, 0.1, (0.1, 0.9)), r"higher\[1\]: expected .*got 0.9"),
    (lambda: horse().reset(HarmonicGait(5.0, 0.1, 0.1, 0.1), 0.0), r"gait: expected a swing"),
    (lambda: horse().vary(0, limbs=[Limb(LEG.scaled(1.1), hip) for hip in HIPS]), r"made without limits"),
    (lambda: animal(Limits()).vary(0, limbs=[Limb(LEG)]), r"limbs: expected 4, got 1"),
    (
        lambda: animal(Limits()).vary(0, limbs=[Limb(LEG, hip) for hip in HIPS]),
        r"limbs\[0\].spring: expected a HoofSpring",
    ),
    (
        lambda: animal(Limits()).vary(
            0, limbs=[Limb(LEG.replace(lengths={"FG": 0.6}), hip, spring=SPRING) for hip in HIPS]
        ),
        r"limbs\[0\].geometry: expected one similar .*engine's .*other lengths, masses, inertias",
    ),
    (lambda: animal(Limits()).set_state(horse().get_state()), r"state: .*engine; .*spring"),
    (lambda: animal(Limits()).command(np.zeros(6)), r"command: expected shape \(4,\), .*got \(6,\)"),
    (
        lambda: animal(Limits(), contact_law=lambda d, v, s, ground: d),
        r"contact_law: expected none together with springs",
    ),
    *(
        (of(Trunk, settings), words)
        for settings, words in (
            ({"kind": "loose"}, "trunk: expected .*fixed, floating, free, rail, suspended, got 'loose'"),
            ({"mass": 0.0}, "trunk_mass: expected"),
            ({"share": 1.1}, r"trunk_share: expected .*\[0, 1\], got 1.1"),
            ({"stiffness": -1.0}, "trunk_stiffness: expected"),
            ({"damping": math.nan}, "trunk_damping: expected"),
            ({"drag": -1.0}, "trunk_drag: expected"),
            ({"height": 0.0}, "trunk_height: expected"),
            ({"pitch_inertia": 0.0}, "trunk_pitch_inertia: expected"),
        )
    ),
    *(
        (of(constrained, {name: value}), name)
        for name, value in (
            ("alpha", -1.0), ("beta", -1.0), ("beta", math.nan), ("integrator", "leapfrog"),
            ("integrator", None), ("sim_dt", 0.0), ("sim_dt", 1.0), ("height", 0.0), ("height", math.inf),
        )
    ),
    *(
        (lambda name=name, value=value: constrained().reset(WALK, **{name: value}), words)
        for name, value, words in CONSTRAINED_STARTS
    ),
    (lambda: commanded(np.zeros(3)), "command: expected 4 values"),
    *(
        (
            lambda name=name: TrunkEngine(Limb(LEG), Trunk("suspended"), **{name: "no"}),
            f"{name}: expected True or False, got 'no'",
        )
        for name in ("strides", "reactions")
    ),
    (lambda: engine().reactions(), "reactions=True"),
]  # fmt: skip
"""Calls and words."""


@pytest.mark.parametrize(("call", "words"), PARTS, ids=[words for _, words in PARTS])
def test_parts(call, words):
    with pytest.raises(ParameterError, match=words):
        call()

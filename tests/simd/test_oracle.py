"""The same source by machine code and on NumPy: every kind of engine, and a control step of every id.

NumPy's machine shares with machine code nothing but the source, and it fails where a row is read that was
never written. So what LLVM makes of the text, and how memory, branches and loops are written, is all checked.
The full matrix is slow: `pytest -m slow tests/simd/test_oracle.py`.
"""

import copy
from contextlib import nullcontext
from itertools import product

import gymnasium as gym
import numpy as np
import pytest

import hoof_env
from hoof_env import (
    Ground,
    HarmonicGait,
    HoofSpring,
    Limb,
    Limits,
    Motor,
    Prescribed,
    Terrain,
    Trunk,
    TrunkEngine,
    load_gait,
    load_geometry,
)
from hoof_env.simd import maximum, on_numpy, where
from hoof_env.simd.math import root_power

LEG = load_geometry("identified")
WALK = load_gait("walk", "identified")
KINDS = ("fixed", "rail", "suspended", "free")
SCHEMES = ("semi_implicit_euler", "midpoint", "rk3", "rk4")
HIPS = {1: (0.0,), 2: (0.6, -0.6), 4: (0.6, 0.6, -0.6, -0.6)}
DRIVES = {"prescribed": Prescribed(), "motor": Motor()}


def turf(penetration, rate, inverse_approach_speed, ground):
    """A law of contact from outside the package, with a branch for each lane."""
    spring = ground.stiffness * root_power(penetration, 12) * (1.0 + penetration / 0.05)
    damping = ground.chi * where(rate < 0.0, 2.0 * rate, rate) * inverse_approach_speed
    return spring * maximum(1.0 + np.tanh(damping), 0.0)


def new_engine(kind="suspended", scheme="midpoint", legs=1, count=1, drive="motor", harmonics=1, **more):
    """An engine with its environments at different crank angles, not started."""
    spring, varies = more.pop("spring", None), more.pop("varies", False)
    hoof = more.pop("ground", {})
    engine = TrunkEngine(
        [Limb(LEG, hip=(x, 0.0), drive=DRIVES[drive], spring=spring) for x in HIPS[legs]],
        Trunk(kind, mass=60.0 * legs, pitch_inertia=40.0 * legs, height=LEG.hip_height - 0.02),
        Ground(**{"exponent": 1.5 if spring else 1.375, **hoof}),
        integrator=scheme,
        num_envs=count,
        harmonics=harmonics,
        strides=True,
        **more,
    )
    if varies:
        engine.vary(0, ground=Ground(exponent=1.375, friction=0.7, stiffness=2e5), drive=Motor(50.0))
        if more.get("limits"):
            small = [Limb(LEG.scaled(0.9), hip=(0.9 * x, 0.0), drive=DRIVES[drive]) for x in HIPS[legs]]
            engine.vary(0, Trunk(kind, mass=50.0 * legs, height=0.9 * LEG.hip_height), limbs=small)
    return engine


def start(engine):
    higher = {1: (), 2: (0.05, -0.03), 3: (0.05, -0.03, 0.02, 0.01)}[engine.features.harmonics]
    gait = HarmonicGait(*WALK.to_array(), higher=higher) if higher else WALK
    count = engine.num_envs
    engine.reset(gait, np.add.outer(np.arange(len(engine.limbs)) * 1.7, 0.35 + 0.7 * np.arange(count)))


def memory_of(engine):
    """All numbers of the environments, without idle columns."""
    m = engine._memory
    return np.vstack([m.data, m.reactions.reshape(-1, m.data.shape[1])])[:, : engine.num_envs]


def assert_same_bits(one, other):
    """Of all numbers; NaN may have any sign or payload, which depends on the processor."""
    differ = one.view(np.int64) != other.view(np.int64)
    differ &= ~(np.isnan(one) & np.isnan(other))
    assert not differ.any(), f"{differ.sum()} numbers differ, first in row {np.argwhere(differ)[0][0]}"


def compare(before, substeps, **settings):
    """Run an engine by machine code for a while, then by both from the same state."""
    engine = new_engine(**settings)
    start(engine)
    with on_numpy():
        same = new_engine(**settings)
        start(same)
    assert_same_bits(memory_of(engine), memory_of(same))
    engine.advance(steps=before)
    engine.command(
        0.9 * WALK.to_array() if engine.features.harmonics == 1 else np.zeros(engine.features.gait_size)
    )
    other = copy.deepcopy(engine)
    moved = memory_of(engine).copy()
    steps = max(substeps // engine.substeps, 1)
    results = engine.advance(steps=steps)
    with on_numpy():
        assert other.advance(steps=steps).tolist() == results.tolist()
    assert_same_bits(memory_of(engine), memory_of(other))
    assert (memory_of(engine) != moved).any()
    return engine


def pairs(count):
    """Kinds, schemes, legs, drives and numbers of environments: of each two every pair comes up."""
    found = []
    for k, (kind, scheme) in enumerate(product(KINDS, SCHEMES)):
        legs, drive = ((1, 4)[k % 2], tuple(DRIVES)[(k // 2 + k // 4) % 2])
        found.append((kind, scheme, legs, drive, count[(k + k // 4) % len(count)]))
    return found


@pytest.mark.parametrize(("kind", "scheme", "legs", "drive", "count"), pairs((1, 8, 9)))
def test_engines_of_every_kind(kind, scheme, legs, drive, count):
    compare(60, 8, kind=kind, scheme=scheme, legs=legs, drive=drive, count=count)


SPRING = HoofSpring(24000.0, 400.0)
LIMITS = Limits(pitch=(-0.4, 0.4), height=(1.0, 2.5), clearance=0.01)
FEATURES = {
    "springs": {"spring": SPRING},
    "two harmonics": {"harmonics": 2},
    "three harmonics": {"harmonics": 3},
    "limits": {"limits": LIMITS},
    "limits and other sizes": {"limits": LIMITS, "varies": True},
    "springs, harmonics, limits": {"spring": SPRING, "harmonics": 3, "limits": LIMITS},
    "hills": {"terrain": Terrain.through([0.0, 1.0, 2.0, 4.0], [0.0, 0.03, -0.02, 0.0], 1.5)},
    "springs on hills": {"terrain": Terrain.slope(0.05), "spring": SPRING},
    "reactions": {"reactions": True},
    "reactions, limits": {"reactions": True, "limits": LIMITS},
    "own law": {"contact_law": turf},
    "own law on hills": {"contact_law": turf, "terrain": Terrain.slope(0.05)},
    "other settings in some": {"varies": True},
    "Threlfall's friction": {"ground": {"friction_law": "threlfall", "exponent": 2.25}},
    "tanh friction": {"ground": {"friction_law": "tanh", "exponent": 1.0}},
    "dashpot": {"ground": {"normal_law": "kelvin-voigt", "exponent": 1.0, "restitution": 0.5}},
    "sampled approach": {"ground": {"approach": "sampled"}},
}


@pytest.mark.parametrize("name", FEATURES)
def test_features_of_engines(name):
    k = [*FEATURES].index(name)
    legs, count = ((1, 9), (4, 1))[k % 2]
    compare(80, 8, legs=legs, count=count, kind=("suspended", "free")[k % 2], **FEATURES[name])


def test_two_legs_run_in_lanes_even_alone():
    compare(60, 6, legs=2, kind="free")


def test_hooves_touch_and_leave_the_ground_meanwhile():
    """Otherwise the tests above would say little of contact."""
    engine = compare(60, 8, kind="suspended", legs=1, count=9)
    depth = engine.state["toe_penetration"]
    assert (depth > 0).any()
    assert (depth < 0).any()


def test_an_environment_that_fails_is_put_back_alike():
    """A trunk that falls without a state to go back to, among trunks that go on."""
    made = []
    for _ in range(2):
        engine = new_engine(kind="free", legs=4, count=9, limits=LIMITS)
        start(engine)
        engine._memory.trunk[:, 3] *= 1e200  # as what no scheme could follow
        made.append(engine)
    by_code, now = made
    with on_numpy():
        found = now.advance(steps=2)
    assert by_code.advance(steps=2).tolist() == found.tolist()
    assert found[3] != 0
    assert (found[:3] == 0).all()
    assert_same_bits(memory_of(by_code), memory_of(now))


def test_pushes_observations_and_states():
    made = []
    for _ in range(2):
        engine = new_engine(kind="free", legs=4, count=9)
        start(engine)
        engine.advance(steps=30)
        made.append(engine)
    by_code, now = made
    for engine in made:
        with on_numpy() if engine is now else nullcontext():
            engine.push(30.0, 10.0, [2, 5])
            engine.observe()
            kept = engine.get_state()
            engine.advance(steps=1)
            engine.set_state(kept)
    assert_same_bits(memory_of(by_code), memory_of(now))


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("legs", [1, 4])
@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("count", [1, 8, 9])
def test_engines_of_every_kind_in_full(kind, scheme, legs, drive, count):
    compare(
        100, 200 if count * legs == 1 else 50, kind=kind, scheme=scheme, legs=legs, drive=drive, count=count
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", FEATURES)
@pytest.mark.parametrize("legs", [1, 4])
@pytest.mark.parametrize("count", [1, 9])
def test_features_of_engines_in_full(name, legs, count):
    kind = ("suspended", "free")[legs > 1]
    compare(100, 200 if count * legs == 1 else 50, legs=legs, count=count, kind=kind, **FEATURES[name])


# Control steps

IDS = ("HorseLeg", "HorseLegRail", "HorseLegSpeed", "HorseLegTerrain", "HorseLegFixed", "HorseLegMO", "Horse",
       "HorseRough")  # fmt: skip


def step_both(made, steps=1):
    """Take steps of an environment by machine code and of its copy on NumPy; compare all that they give."""
    made.reset(seed=5)
    made.action_space.seed(1)
    for _ in range(3):
        made.step(made.action_space.sample())
    other = copy.deepcopy(made)
    for _ in range(steps):
        action = made.action_space.sample()
        observation, reward, terminated, truncated, info = made.step(action)
        with on_numpy():
            found = other.step(action)
        assert found[0].tobytes() == observation.tobytes()
        assert np.asarray(found[1]).tobytes() == np.asarray(reward).tobytes()
        assert np.array_equal(found[2], terminated)
        assert np.array_equal(found[3], truncated)
        for key in info:
            if key.startswith("reward_"):
                np.testing.assert_array_equal(found[4][key], info[key])
        count = made.batch.num_envs
        assert_same_bits(memory_of(made.engine), memory_of(other.engine))
        assert_same_bits(made.batch.rows.episode[:, :count], other.batch.rows.episode[:, :count])
    return other


@pytest.mark.parametrize("id", IDS)
def test_a_control_step_of_every_id(id):
    step_both(gym.make(f"hoof_env/{id}-v0").unwrapped)


@pytest.mark.parametrize("id", [id for id in IDS if id not in ("HorseLegMO", "HorseLegFixed")])
def test_a_control_step_of_nine_of_every_id(id):
    step_both(gym.make_vec(f"hoof_env/{id}-v0", num_envs=9).unwrapped)


@pytest.mark.slow
@pytest.mark.parametrize("id", [id for id in IDS if id != "HorseLegMO"])
def test_control_steps_of_nine_of_every_id(id):
    step_both(gym.make_vec(f"hoof_env/{id}-v0", num_envs=9).unwrapped, 5)


SETTINGS = {
    "delays and noise": {"observation_delay": 0.5, "action_delay": (0, 2), "noise": {"trunk": 0.05}},
    "springs": {"hoof_stiffness": 24000.0},
    "drawn": {"randomize": {"friction": (0.2, 0.6), "trunk_mass": (50.0, 60.0)}},
    "speeds that change": {"target_speed": (0.5, 1.5)},
}


@pytest.mark.parametrize("name", SETTINGS)
@pytest.mark.parametrize("count", [1, 9])
def test_control_steps_with_settings(name, count):
    id = "hoof_env/HorseLegSpeed-v0" if "speed" in name else "hoof_env/HorseLeg-v0"
    made = gym.make(id, **SETTINGS[name]) if count == 1 else gym.make_vec(id, num_envs=9, **SETTINGS[name])
    step_both(made.unwrapped)


def test_a_control_step_with_the_papers_solver():
    step_both(gym.make("hoof_env/HorseLegFixed-v0", solver="paper").unwrapped)


@pytest.fixture
def own_id():
    """An id with terms, entries, a map of actions and a law of its own."""
    id = "oracle/Own-v0"

    def power(step, weight):
        toe = step.leg.report.toe
        return 0.001 * weight * (toe.friction * toe.slide) + np.where(step.failed > 0.0, -1.0, 0.0)

    def angle(scene):
        toe = scene.leg.report.toe
        return np.where(toe.normal > 0.0, np.arctan2(toe.friction, toe.normal), 0.0)

    hoof_env.register(
        id,
        terms=[hoof_env.Term("power", 0.5, "1/kJ", "power of friction", power)],
        entries=[
            hoof_env.Entry("angle", "feel", "rad", angle, hoof_env.Scale("/ pi", lambda x, scene: x / np.pi))
        ],
        contact_law=turf,
    )
    yield id
    gym.registry.pop(id)


@pytest.mark.parametrize("count", [1, 9])
def test_a_control_step_of_ones_own_id(own_id, count):
    made = gym.make(own_id) if count == 1 else gym.make_vec(own_id, num_envs=9)
    other = step_both(made.unwrapped)
    assert "angle" in other.observation_names

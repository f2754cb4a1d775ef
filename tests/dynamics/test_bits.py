"""A number of the engine of several legs has the same bits alone, in any batch, on any number of threads, in
parts, with and without what is only recorded, and put back.

A matrix: kinds of engines (`KINDS`) times ways of running them. A new feature is a row of `KINDS`.
"""

import copy
import pickle

import numpy as np
import pytest

from hoof_env.dynamics.engine import MAX_SCALAR_ENVS, TrunkEngine
from hoof_env.dynamics.parts import FREEDOMS, HoofSpring, Limb, Limits, Motor, Prescribed, Trunk
from hoof_env.dynamics.stepping import SCHEMES
from hoof_env.ground.contact import Ground
from hoof_env.ground.laws import FRICTION_LAWS
from hoof_env.ground.terrain import Terrain
from hoof_env.leg.geometry import load_geometry
from hoof_env.simd import threads
from tests.dynamics.scenes import LEG, NATURAL, RUN, THETA, WALK, horse

OTHER = load_geometry("identified")
ALL, STEPS = 100, 200
ROUGH = Terrain(
    (0.0, 0.03, -0.02, 0.01), (1.0, 0.4, 2.0, 1.0), (1.0, 0.1, 0.5, 2.0), start=-0.6, spacing=0.37
)
COMMAND = np.array(
    [[9.0, 0.4, -0.3, 0.1], [11.0, 0.9, 0.2, -0.2], [5.0, 0.5, 0.1, 0.0], [7.0, 0.2, 0.0, 0.1]]
)


KERNELS = ("fixed", "rail", "suspended", "free")
"""Kinds of trunk with kernels of their own: a boom has a suspended trunk's."""

KINDS = [*((trunk, legs) for trunk in KERNELS for legs in (1, 2, 4)), ("springs", 4)]
"""Trunk and number of legs; with springs: a free trunk, limits, and swings of three harmonics."""

TWO_LEGS = [(trunk, 2) for trunk in KERNELS]


def engine(kind, n, **changes):
    """An engine of a kind for `n` environments."""
    if kind[0] == "springs":
        settings = {"harmonics": 3, "limits": Limits(), "num_envs": n}
        return horse(NATURAL, settings=settings | changes, spring=HoofSpring(4e4, 500.0, 3e4, 300.0))
    trunk_kind, legs = kind
    limbs = [Limb(LEG, (0.4, 0.0), Motor()), Limb(OTHER, (-0.4, 0.1), Prescribed())]
    limbs += [Limb(OTHER, (0.6, 0.0), Motor()), Limb(LEG, (-0.6, 0.0), Motor(rotor_inertia=0.0))]
    k = FREEDOMS[trunk_kind]  # another ground, law and scheme with each kind
    ground = Ground(exponent=(1.5, 1.125, 2.0, 1.75)[k], friction_law=FRICTION_LAWS[k % 3])
    settings = {"integrator": list(SCHEMES)[-k], "substeps": (3, 1, 2, 2)[k]}
    settings |= {"terrain": ROUGH if k % 2 else None}
    trunk = Trunk(trunk_kind, mass=150.0, height=LEG.hip_height - 0.03, pitch_inertia=30.0)
    return TrunkEngine(limbs[:legs], trunk, ground, num_envs=n, **(settings | changes))


def start(engine, which):
    """Environments `which` of `ALL` different ones, commands on the move."""
    rng, legs = np.random.default_rng(7), len(engine.limbs)
    crank_angle, draw = rng.uniform(-9, 9, (4, ALL))[:legs], rng.normal(size=(5, ALL))
    k = FREEDOMS[engine.trunk.kind]
    moves = {"vx": draw[0], "vy": 0.3 * draw[1], "pitch": 0.1 * draw[2], "pitch_rate": 0.3 * draw[3]}
    moves = {name: row[which] for name, row in moves.items() if k >= {"vx": 1, "vy": 2}.get(name, 3)}
    if engine.limbs[0].spring:
        gaits = np.zeros((4, 8, ALL))
        gaits[:, :4] = np.array([WALK.crank_speed, 0.3, 0.2, 0.2])[:, None]
        gaits[:, 1:] += rng.uniform(-0.05, 0.05, (4, 7, ALL))
        engine.reset(gaits[..., which], THETA[:, None] + 0.1 * crank_angle[:, which], y=1.5, vx=moves["vx"])
        return
    engine.reset([RUN, WALK, WALK, RUN][:legs], crank_angle[:, which], x=draw[4][which], **moves)
    scale = 1 + 0.1 * draw[4][which]
    engine.command(COMMAND[:legs, :, None] * scale)


def bits(engine, account=True):
    """State, report, account and strides of every environment as integers, shape (rows, num_envs)."""
    parts = [engine.state, engine.report, *([engine.account] if account else [])]
    parts += [engine.strides] if engine.counts_strides and account else []
    return np.concatenate([np.atleast_2d(row) for part in parts for row in part.values()]).view(np.int64)


def run(kind, which, steps=STEPS, **changes):
    e = engine(kind, len(which), **changes)
    start(e, which)
    assert not e.advance(steps=steps).any()
    return e


@pytest.mark.parametrize("kind", KINDS, ids=str)
def test_alone_and_in_any_batch(kind):
    settings = {"strides": True} if kind[0] == "springs" else {}
    whole = run(kind, np.arange(ALL), **settings)
    expected = bits(whole)
    touched = whole.account["ground_stored"] != 0
    assert touched.mean() > 0.4
    assert len(np.unique(expected[1])) == ALL or kind[0] in ("fixed", "rail")
    rng = np.random.default_rng(3)
    for size in (1, 2, MAX_SCALAR_ENVS, MAX_SCALAR_ENVS + 1, 31, 33, 128):  # the last has idle columns
        which = rng.permutation(ALL)[:size]
        np.testing.assert_array_equal(
            bits(run(kind, which, **settings)), expected[:, which], err_msg=str(size)
        )


@pytest.mark.parametrize("n", [2, 33])
@pytest.mark.parametrize("kind", TWO_LEGS, ids=str)
def test_one_advance_and_many_short_ones(kind, n):
    """The start of an advance evaluates anew where the last one ended, and finds the same."""
    once, often = run(kind, np.arange(n)), run(kind, np.arange(n), steps=0)
    for _ in range(STEPS // 10):
        often.advance(steps=10)
        often.advance(steps=0)
    np.testing.assert_array_equal(bits(once, account=False), bits(often, account=False))
    for name, total in once.account.items():  # whose sums are taken in another order
        np.testing.assert_allclose(often.account[name], total, rtol=1e-10, atol=1e-10, err_msg=name)


@pytest.mark.parametrize("n", [2, 33])
@pytest.mark.parametrize("kind", TWO_LEGS, ids=str)
def test_the_account_changes_nothing(kind, n):
    kept, left = run(kind, np.arange(n)), run(kind, np.arange(n), steps=0)
    left.advance(steps=STEPS, account=False)
    np.testing.assert_array_equal(bits(kept, account=False), bits(left, account=False))
    assert all((total == 0).all() for total in left.account.values())


@pytest.mark.parametrize("n", [2, 33])
@pytest.mark.parametrize("kind", TWO_LEGS, ids=str)
def test_a_state_goes_on_as_if_it_had_never_been_away(kind, n):
    first = run(kind, np.arange(n), steps=77)
    kept = first.get_state()
    first.advance(steps=60)
    other = engine(kind, n)
    other.set_state(kept)
    other.advance(steps=60)
    np.testing.assert_array_equal(bits(first), bits(other))
    first.set_state(kept)  # what advanced since is not in it
    first.advance(steps=60)
    np.testing.assert_array_equal(bits(first), bits(other))


def test_tables_begin_with_a_line_of_the_cache():
    for legs in range(1, 6):  # NumPy's own arrays do by chance
        limbs = [Limb(LEG.replace(linear_density=1.0 + i)) for i in range(legs)]
        assert TrunkEngine(limbs, Trunk("free"), Ground()).mechanics.model[1].ctypes.data % 64 == 0


@pytest.mark.parametrize(("n", "place"), [(16, 64), (4000, 2**21)])
def test_memory_lies_where_it_is_quick_in_copies_too_and_begins_with_nothing(n, place):
    made = TrunkEngine([Limb(LEG)], Trunk("free"), Ground(), num_envs=n)
    assert made._memory.data.nbytes > place or n < 4000
    for one in (made, copy.copy(made), pickle.loads(pickle.dumps(made))):
        data = one._memory.data
        assert data.ctypes.data % place == 0
        assert not any(values.any() for values in (one.account | one.report).values())
        data[:] = 1.0
        assert one.report["x"].all()


@pytest.mark.parametrize("n", [4, 40])
def test_some_environments_start_anew_and_the_others_do_not_notice(n):
    expected = run(("free", 2), np.arange(n))
    e, last = engine(("free", 2), n), np.arange(n) >= n - 2
    start(e, np.arange(n))
    e.advance(steps=0)
    before = bits(e)
    e.reset(RUN, 1.0, x=5.0, envs=last)
    assert e.state["centre_x"][last] == pytest.approx(5.0, abs=0.3)
    np.testing.assert_array_equal(bits(e)[:, ~last], before[:, ~last])
    e.advance(steps=STEPS)
    np.testing.assert_array_equal(bits(e)[:, ~last], bits(expected)[:, ~last])
    e.reset(RUN, [0.5, 0.7], envs=[n - 1])
    assert e.state["time"].tolist() == pytest.approx([0.2] * (n - 1) + [0.0])
    assert e.account["impulse_y"][-1] == 0


@pytest.mark.parametrize("kind", KINDS[:-1], ids=str)
def test_on_any_number_of_threads(kind, monkeypatch):
    monkeypatch.setattr(threads, "available", lambda: 32)
    settings = {"reactions": True, "strides": True}
    expected = run(kind, np.arange(ALL), **settings)
    alone = run(kind, np.arange(1), **settings)
    np.testing.assert_array_equal(bits(alone), bits(expected)[:, :1])
    np.testing.assert_array_equal(alone.reactions().joints[..., 0], expected.reactions().joints[..., 0])
    for num_threads in (2, 5, 32):
        found = run(kind, np.arange(ALL), num_threads=num_threads, **settings)
        np.testing.assert_array_equal(bits(found), bits(expected))
        np.testing.assert_array_equal(found.reactions().joints, expected.reactions().joints)
        np.testing.assert_array_equal(found._memory.data, expected._memory.data)

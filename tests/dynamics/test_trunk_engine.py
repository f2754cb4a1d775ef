"""The engine of several legs against d'Alembert with a dense mass matrix (`PlainHorse`), at instants."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import TRUNKS, HoofSpring, Limb, Limits, Motor, Prescribed, Result, Trunk
from hoof_env.gait import LIMITS, Filter, FilterSettings, GaitParameters, command_filters, parameter_names
from hoof_env.ground.contact import Ground
from hoof_env.ground.laws import FRICTION_LAWS
from hoof_env.ground.terrain import Terrain
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.profile import leg_profile, places
from tests.dynamics.tally import tally_of
from tests.legs import FIRST_FIT
from tests.linkage import NUMBER
from tests.oracle.horse import PlainHorse

FIRST, IDENTIFIED = load_geometry(FIRST_FIT), load_geometry("identified")
LEGS = (
    FIRST,
    IDENTIFIED,
    FIRST.replace(travel=-FIRST.travel),
    FIRST.replace(inertia="paper", lengths={"FG": 0.6}, linear_density=2.0),
    IDENTIFIED.replace(toe=IDENTIFIED.heel, heel=IDENTIFIED.toe, masses=tuple(np.linspace(3, 0.2, 14))),
)
TERRAINS = (
    Terrain.flat(),
    Terrain(height=(0.02,)),
    Terrain.slope(-0.2),
    Terrain.ramp(0.15, start=-0.3, length=0.7),
    Terrain.patches([(-1.0, -0.2, 0.5, 0.2), (0.1, 0.9, 3.0, 1.5)]),
    Terrain((0.0, 0.03, -0.02, 0.01), (1.0, 0.4, 2.0, 1.0), (1.0, 0.1, 0.0, 2.0), start=-0.6, spacing=0.37),
)
LOW, HIGH = np.array(list(LIMITS.values())).T
STATES = 7  # one more than are run one by one

drives = st.one_of(
    st.just(Prescribed()),
    st.builds(Motor, st.floats(0, 200), st.floats(5, 900), st.floats(0, 2e-3), st.floats(0, 60)),
)
limbs = st.builds(Limb, st.sampled_from(LEGS), st.tuples(st.floats(-0.8, 0.8), st.floats(-0.2, 0.2)), drives)
trunks = st.builds(
    Trunk,
    st.sampled_from(TRUNKS),
    mass=st.floats(50, 500),
    share=st.floats(0, 1),
    drag=st.floats(0, 40),
    pitch_inertia=st.floats(10, 100),
)
grounds = st.builds(
    Ground,
    stiffness=st.sampled_from((2e4, 3e5)),
    exponent=st.integers(8, 24).map(lambda eighths: eighths / 8),
    restitution=st.floats(0.2, 1),
    approach_floor=st.just(0.1),
    approach=st.sampled_from(("interpolated", "sampled")),
    friction_law=st.sampled_from(FRICTION_LAWS),
    friction_slow=st.just(0.01),
    friction_fast=st.floats(0.1, 0.3),
)


def reach(limbs, gaits, theta):
    """How far below the trunk's centre of mass the lowest hoof point is [m]."""
    horse = PlainHorse(Trunk("fixed"), limbs)
    at, _ = horse.hooves((0.0, 0.0, 0.0), (0, 0, 0), theta, 0 * theta, gaits)
    return -at.imag.min()


def put_somewhere(engine, rng, depth):
    """Every environment in a state of its own, hoofs in the ground or above it, filters on the move."""
    kind, legs, n = engine.trunk.kind, len(engine.limbs), engine.num_envs
    still, size = GaitParameters(*(LOW + HIGH) / 2), engine.features.gait_size
    theta = rng.uniform(-10, 10, (legs, n))
    low, high = (np.append(bound, np.full(size - 4, edge)) for bound, edge in ((LOW, -0.3), (HIGH, 0.3)))
    command, value = (rng.uniform(low[:, None], high[:, None], (legs, size, n)) for _ in range(2))
    start = {"x": rng.uniform(-1, 1, n)}
    if kind != "fixed":
        start["vx"] = rng.normal(size=n)
    if kind in ("suspended", "free"):
        height = [reach(engine.limbs, value[..., e], theta[:, e]) for e in range(n)]
        start |= {"vy": rng.normal(size=n), "y": np.array(height) - rng.uniform(-0.5, 1, n) * depth}
    if kind == "free":
        start |= {"pitch": rng.normal(0, 0.1, n), "pitch_rate": rng.normal(size=n)}
    engine.reset(still, theta, **start)
    state = engine.get_state()
    names = list(engine.state)[7:]
    rows = {name: state["limbs"][:, names.index(name)] for name in names}
    for k, name in enumerate(parameter_names(engine.features.harmonics)):
        rows[name][:] = value[:, k]
        rows[f"{name}_rate"][:] = rng.normal(0, 3, (legs, n))
    motors = np.array([isinstance(limb.drive, Motor) for limb in engine.limbs])[:, None]
    rows["crank_angle_rate"][:] = np.where(motors, rng.normal(5, 4, (legs, n)), rows["crank_speed"])
    for point in ("toe", "heel"):
        rows[f"{point}_penetration"][:] = 1.0
        rows[f"{point}_inverse_approach_speed"][:] = 1 / rng.uniform(0.1, 1.5, (legs, n))
        if engine.features.has_springs:
            rows[f"{point}_deflection_normal"][:] = rng.uniform(-0.02, 0.04, (legs, n))
            rows[f"{point}_deflection_tangential"][:] = rng.uniform(-0.03, 0.03, (legs, n))
    engine.set_state(state)
    fallen = Result.FALLEN  # a state put together at random may have the trunk in the ground: it is reported
    assert np.isin(engine.advance(command, 0), (Result.OK, fallen)).all()


def oracle(engine, horse, e):
    """`PlainHorse.at` where environment `e` is."""
    s, r = engine.state, engine.report
    names = parameter_names(engine.features.harmonics)
    bounds = engine.filters.to_array().tolist()
    bounds += bounds[-1:] * (len(names) - len(bounds))  # higher harmonics have the filters of the first
    steady = np.zeros((len(engine.limbs), len(names), 3))
    for i, command in enumerate(engine.get_state()["command"][..., e].tolist()):
        filters = [Filter(float(s[name][i, e]), float(s[f"{name}_rate"][i, e])) for name in names]
        command_filters(filters, command, bounds)
        steady[i] = [(one.value, one.rate, one.acc) for one in filters]
    slowness = np.stack(
        [s["toe_inverse_approach_speed"][:, e], s["heel_inverse_approach_speed"][:, e]], axis=1
    )
    approach = np.where(slowness > 0, 1 / np.where(slowness > 0, slowness, 1), np.nan)
    place = r["x"][e], r["y"][e], s["pitch"][e]
    velocity = r["vx"][e], r["vy"][e], r["pitch_rate"][e]
    give = None
    if engine.features.has_springs:
        axes = ("normal", "tangential")
        give = np.array(
            [[s[f"{point}_deflection_{axis}"][:, e] for axis in axes] for point in ("toe", "heel")]
        )
        give = give.transpose(2, 0, 1)
        for leg, point in np.ndindex(approach.shape):  # the ground is where the sole is
            name = ("toe", "heel")[point]
            at = complex(r[f"{name}_x"][leg, e], r[f"{name}_y"][leg, e])
            if horse.ground.depth(at, 0j)[0] + horse.limbs[leg].spring.length <= give[leg, point, 0]:
                approach[leg, point] = np.nan
    return horse.at(
        place, velocity, s["crank_angle"][:, e], s["crank_angle_rate"][:, e], steady, approach, give
    )


def finer_tables(patch):
    """Give engines tables of legs with four times as many cells.

    The error of a table's derivatives is relative to their largest value in a turn. Where they are small, and
    a motor without a rotor drives a crank of little inertia, an acceleration of the default table is off by
    4e-8 rad/s^2, of one with twice as many cells by 4e-10: the tables' error, not the mechanics'.
    """

    def profile(geometry):
        usual = leg_profile(geometry)
        return usual.with_cells(4 * usual.cells)

    patch.setattr("hoof_env.dynamics.engine.leg_profile", profile)


def assert_close(found, expected, scale, name, rtol=1e-9):
    np.testing.assert_allclose(found, expected, rtol=0, atol=rtol * scale, err_msg=name)


@settings(max_examples=24, deadline=None)
@given(
    legs=st.lists(limbs, min_size=1, max_size=4),
    trunk=trunks,
    ground=grounds,
    terrain=st.sampled_from(TERRAINS),
    depth=st.sampled_from((0.05, 0.02, -1.0)),
    seed=st.integers(0, 2**32 - 1),
)
def test_every_instant_is_d_alembert_s(legs, trunk, ground, terrain, depth, seed):
    """Accelerations, torques, momenta, energies, forces and powers, to 1e-9."""
    rng = np.random.default_rng(seed)
    theta, gait = rng.uniform(0, 6, len(legs)), np.tile((LOW + HIGH) / 2, (len(legs), 1))
    trunk = Trunk(**{**vars(trunk), "height": reach(legs, gait, theta) - depth})
    with pytest.MonkeyPatch.context() as patch:
        finer_tables(patch)
        engine = TrunkEngine(
            legs, trunk, ground, terrain, substeps=1000, num_envs=STATES, filters=FilterSettings()
        )
    put_somewhere(engine, rng, depth)
    check_instants(engine, [PlainHorse(trunk, legs, ground, terrain)] * STATES)


springs = st.builds(
    HoofSpring,
    st.floats(1e4, 1e5),
    st.floats(200, 2000),
    st.floats(1e4, 1e5),
    st.floats(200, 2000),
    st.sampled_from((0.0, 0.1)),
)


@settings(max_examples=24, deadline=None, phases=(Phase.explicit, Phase.generate))
@given(
    legs=st.lists(limbs, min_size=1, max_size=4),
    spring=springs,
    trunk=trunks,
    ground=grounds,
    terrain=st.sampled_from(TERRAINS),
    depth=st.sampled_from((0.05, -1.0)),
    seed=st.integers(0, 2**32 - 1),
)
def test_every_instant_of_an_animal_is_d_alembert_s(legs, spring, trunk, ground, terrain, depth, seed):
    """The same with springs, three harmonics, and legs of other places, sizes and springs in each
    environment."""
    rng = np.random.default_rng(seed)
    legs = [replace(limb, spring=spring) for limb in legs if limb.geometry.inertia != "paper"]
    legs = legs or [Limb(FIRST, spring=spring)]
    theta, gait = rng.uniform(0, 6, len(legs)), np.tile((LOW + HIGH) / 2, (len(legs), 1))
    trunk = Trunk(**{**vars(trunk), "height": reach(legs, gait, theta) - depth})
    engine = TrunkEngine(
        legs, trunk, ground, terrain, substeps=1000, num_envs=STATES, harmonics=3, limits=Limits()
    )
    horses = []
    for e in range(STATES):
        own, size = [], rng.uniform(0.8, 1.2, len(legs))
        for k, limb in enumerate(legs):
            geometry = limb.geometry.scaled(size[k])
            if geometry.masses is None:
                geometry = geometry.replace(linear_density=rng.uniform(1, 4))
            hip, other = tuple(rng.uniform(-0.5, 0.5, 2)), replace(spring, damping=rng.uniform(300, 900))
            own.append(replace(limb, geometry=geometry, hip=hip, spring=other))
        engine.vary(e, limbs=own)
        horses.append(PlainHorse(trunk, own, ground, terrain))
    put_somewhere(engine, rng, depth)
    check_instants(engine, horses)


def normals(horse, now):
    """Of the ground at each hoof point."""
    return np.vectorize(lambda x: horse.ground.surface(x)[1])(now.hoof.real)


def check_instants(engine, horses):
    """Compare every environment with an oracle of its own."""
    r, s, varied = engine.report, engine.state, len(set(map(id, horses))) > 1
    tally = None if varied else tally_of(engine)
    for e, horse in enumerate(horses):
        now = oracle(engine, horse, e)
        force = np.stack(
            [r["toe_normal"] - 1j * r["toe_friction"], r["heel_normal"] - 1j * r["heel_friction"]], 1
        )
        force = force[..., e] * normals(horse, now)
        hoof = np.stack([r["toe_x"] + 1j * r["toe_y"], r["heel_x"] + 1j * r["heel_y"]], 1)[..., e]
        push = max(engine.weight, np.abs(now.hoof_force).max())
        turn = max(push, np.abs(now.crank_torque).max(), np.abs(now.hip_torque).max())
        quick = max(1.0, np.abs(now.theta_acc).max(), np.abs(now.phi_acc).max(), np.abs(now.trunk_acc).max())
        fast = max(1.0, np.abs(s["crank_angle_rate"][:, e]).max())
        for name, found, expected, scale in (
            ("hoof", hoof, now.hoof, 1.0),
            ("force", force, now.hoof_force, push),
            ("trunk_acc", [r[k][e] for k in ("ax", "ay", "pitch_acceleration")], now.trunk_acc, quick),
            ("crank_angle_acceleration", r["crank_angle_acceleration"][:, e], now.theta_acc, quick),
            ("swing_angle", r["swing_angle"][:, e], now.phi, 1.0),
            ("swing_angle_rate", r["swing_angle_rate"][:, e], now.phi_rate, fast),
            ("swing_angle_acceleration", r["swing_angle_acceleration"][:, e], now.phi_acc, quick),
            ("crank_torque", r["crank_torque"][:, e], now.crank_torque, turn),
            ("hip_torque", r["hip_torque"][:, e], now.hip_torque, turn),
            ("crank_power", r["crank_power"][:, e].sum(), now.power["crank"], turn * fast),
            ("hip_power", r["hip_power"][:, e].sum(), now.power["hip"], turn * fast),
            *(_tallied(tally, now, e) if tally else _soles(engine, horse, now, e)),
        ):
            assert_close(found, expected, scale, f"{name}, environment {e}")


def _tallied(tally, now, e):
    return (
        ("centre", tally.centre[e], now.centre, 1.0),
        ("momentum", tally.momentum[e], now.momentum, np.abs(now.momentum) + 1.0),
        ("angular momentum", tally.angular_momentum[e], now.angular_momentum, np.abs(now.momentum) + 1.0),
        ("kinetic", tally.kinetic[e], now.kinetic, now.kinetic),
        ("potential", tally.potential[e], now.potential, abs(now.potential) + now.kinetic),
    )


def _soles(engine, horse, now, e):
    """Sliding speeds are the soles' speeds."""
    ahead = (now.hoof_velocity * (normals(horse, now) / 1j).conj()).real
    found = np.stack([engine.report["toe_slide"], engine.report["heel_slide"]], 1)[..., e]
    return (("slide", found, ahead - now.give_rate[..., 1], max(1.0, np.abs(now.give_rate).max())),)


def test_hoofs_are_where_the_closed_form_has_them_at_the_borders_of_turns_and_cells():
    """Of two legs, whose tables lie one behind the other: cell 0 begins half a cell before its turn."""
    legs = (IDENTIFIED, FIRST)
    cell = 2 * np.pi / max(leg_profile(leg).cells for leg in legs)
    off = np.array([-1.0, -0.5, -0.499, -1e-9, 0.0, 1e-9, 0.499, 0.5, 1.0]) * cell
    theta = (off + 2 * np.pi * np.array([-7, -1, 0, 1, 1000])[:, None]).ravel()
    trunk = Trunk("fixed", mass=1.0, height=9.0)
    engine = TrunkEngine([Limb(leg) for leg in legs], trunk, Ground(stiffness=100.0), num_envs=len(theta))
    engine.reset(GaitParameters(0.0, 0.0, 0.0, 0.0), np.tile(theta, (2, 1)))
    engine.advance(steps=0)
    for k, leg in enumerate(legs):
        hoof = places(leg, theta)[0][:, [NUMBER[leg.toe], NUMBER[leg.heel]]]
        for j, name in enumerate(("toe", "heel")):
            found = engine.report[f"{name}_x"][k] + 1j * engine.report[f"{name}_y"][k]
            np.testing.assert_allclose(found, hoof[:, j] + 9j, rtol=0, atol=1e-11)

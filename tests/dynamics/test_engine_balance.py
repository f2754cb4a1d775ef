"""Momentum and energy of the engine against books kept from `pose` and NumPy alone, while commands change."""

import numpy as np
import pytest

from hoof_env.dynamics.engine import LegEngine
from hoof_env.dynamics.result import Result
from hoof_env.dynamics.trace import new_trace
from hoof_env.dynamics.trunk import GRAVITY, Trunk
from hoof_env.gait.motion_law import FilterSettings
from hoof_env.gait.parameters import LIMITS, load_gait
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.kinematics import FrameMotion, pose

LEG = load_geometry("first_fit")
WALK, RUN = load_gait("walk", "first_fit"), load_gait("run", "first_fit")
LOW, HIGH = np.array(list(LIMITS.values())).T
FLOATING = Trunk(share=0.0, stiffness=0.0, damping=0.0, drag=0.0, height=50.0)
FILTERS = FilterSettings(swing_rate=4.0, swing_acc=80.0)
SOFT = Ground(restitution=0.5, approach_floor=0.1, friction_fast=0.05)


def play(engine, schedule):
    """Trace of a sequence of (command, substeps)."""
    rows = []
    for command, substeps in schedule:
        rows.append(new_trace(substeps))
        assert engine.advance(command, rows[-1]) is Result.OK
    return np.concatenate(rows)


def random_schedule(seed, blocks, substeps):
    rng = np.random.default_rng(seed)
    return [(rng.uniform(LOW, HIGH), substeps) for _ in range(blocks)]


def smooth_schedule(h, seconds=0.6):
    """Walk, run and between, changing six times: the same commands at the same times whatever the step."""
    mixes = (0.0, 1.0, 0.3, 0.8, 0.1, 0.6)
    walk, run = WALK.to_array(), RUN.to_array()
    return [(walk + mix * (run - walk), round(seconds / len(mixes) / h)) for mix in mixes]


def books(engine, trace):
    """What every row of a trace adds up to, trunk and 14 links together.

    Returns momentum and centre of mass (n, 2); energy (n,), kinetic and potential; power (n,) of drives and
    ground less what damper and drag take; outer force (n, 2), weight included.
    """
    leg, trunk = engine.geometry, engine.trunk
    masses, total = leg.body_masses, trunk.mass + leg.mass
    momentum, centre, energy, power, force = [], [], [], [], []
    for row in trace:
        o, v = np.array([row["trunk_x"], row["trunk_y"]]), np.array([row["trunk_vx"], row["trunk_vy"]])
        frame = FrameMotion(row["phi"], row["phi_rate"], row["phi_acc"], tuple(o), tuple(v))
        at = pose(leg, row["theta"], row["theta_rate"], row["theta_acc"], frame)
        momentum.append(trunk.mass * v + masses @ at.centre_velocities)
        centre.append((trunk.mass * o + masses @ at.centres) / total)
        kinetic = trunk.mass * v @ v + masses @ (at.centre_velocities**2).sum(1)
        kinetic += leg.body_inertias @ at.angular_velocities**2
        potential = GRAVITY * (trunk.mass * o[1] + masses @ at.centres[:, 1])
        outer = np.array([row["friction"] - trunk.drag * v[0], row["normal"] - total * GRAVITY])
        watts = row["crank_power"] + row["hip_power"] - trunk.drag * v[0] ** 2
        for p in ("toe", "heel"):
            watts += row[f"{p}_friction"] * row[f"{p}_vx"] - row[f"{p}_normal"] * row[f"{p}_rate"]
        if trunk.kind == "suspended":
            support, up = (
                (1 - trunk.share) * total * GRAVITY,
                o[1] - trunk.height,
            )  # by the rest of the animal
            potential += trunk.stiffness * up**2 / 2 - support * o[1]
            outer[1] += support - trunk.stiffness * up - trunk.damping * v[1]
            watts -= trunk.damping * v[1] ** 2
        energy.append(kinetic / 2 + potential)
        power.append(watts)
        force.append(outer)
    return tuple(np.array(column) for column in (momentum, centre, energy, power, force))


@pytest.mark.parametrize("travel", [-1, 1])
def test_momentum_in_flight_is_kept_to_round_off(travel):
    """The leg swings under random commands, nothing outside acts: no drift over thousands of steps."""
    engine = LegEngine(LEG.replace(travel=travel), FLOATING, SOFT, 1e-3, FILTERS)
    engine.reset(RUN, theta=1.0, speed=3.0)
    trace = play(engine, random_schedule(5, 100, 50))
    assert np.ptp(trace["trunk_vx"]) > 0.05  # the trunk feels the leg swing
    momentum, centre, *_ = books(engine, trace[::25])
    assert np.abs(momentum - momentum[0]).max() < 1e-9
    drift = centre - momentum[0] / (FLOATING.mass + LEG.mass) * trace["t"][::25, None]
    assert np.abs(drift - drift[0]).max() < 1e-10


@pytest.mark.parametrize("kind", ["suspended", "rail"])
def test_impulse_is_the_change_of_momentum(kind):
    """At every substep: sums of all outer forces, ground included, are exact to round-off."""
    h = 1e-3
    engine = LegEngine(LEG, Trunk(kind, height=LEG.hip_height), SOFT, h, FILTERS)
    trace = np.concatenate([engine.reset(RUN, theta=0.5, speed=2.0), play(engine, smooth_schedule(h))])
    assert trace["normal"].max() > 500  # it stood
    momentum, centre, _, _, force = books(engine, trace)
    free = [0, 1] if kind == "suspended" else [0]
    impulses = h * np.cumsum(force[:-1], axis=0)
    assert np.abs(momentum[1:] - momentum[0] - impulses)[:, free].max() < 1e-9
    moved = np.diff(centre, axis=0) - h * momentum[1:] / (engine.trunk.mass + LEG.mass)
    assert np.abs(moved)[:, free].max() < 1e-12


def energy_gap(trunk, ground, h):
    """Energy gained less work done, at every substep [J]."""
    engine = LegEngine(LEG, trunk, ground, h, FILTERS)
    speed = 0.0 if trunk.kind == "fixed" else 1.5
    trace = np.concatenate([engine.reset(WALK, theta=0.2, speed=speed), play(engine, smooth_schedule(h))])
    assert trace["normal"].max() > 100  # it stood
    _, _, energy, power, _ = books(engine, trace)
    work = h * np.cumsum((power[1:] + power[:-1]) / 2)
    assert np.ptp(work) > 100
    return energy[1:] - energy[0] - work


@pytest.mark.parametrize(
    ("kind", "ground"),
    [
        ("suspended", SOFT),
        ("suspended", Ground(normal_law="hu-guo", restitution=0.3, friction_law="tanh", friction_fast=0.1)),
        ("rail", SOFT),
        ("fixed", SOFT),
    ],
)
def test_energy_gained_is_work_done(kind, ground):
    """Work of drives and ground less what damper and drag take: the error is of order h and nothing leaks."""
    trunk = Trunk(kind, height=LEG.hip_height)
    coarse, middle, fine = (energy_gap(trunk, ground, h) for h in (8e-4, 4e-4, 2e-4))
    middle, fine = middle[1::2], fine[3::4]  # at the same instants
    sizes = [np.abs(gap).max() for gap in (coarse, middle, fine)]
    assert (np.log2([sizes[0] / sizes[1], sizes[1] / sizes[2]]) > 0.8).all()
    assert np.abs(2 * fine - middle).max() < 0.03 * sizes[2]  # what stays as h goes to 0


def test_a_standing_leg_bears_its_share_of_the_weight():
    """Crank stopped, all settled: the leg bears its share of the weight and what the spring pulls down."""
    trunk = Trunk(height=1.65)
    engine = LegEngine(LEG, trunk, SOFT, 1e-3, FILTERS)
    still = np.array([0.0, *WALK.to_array()[1:]])
    engine.reset(type(WALK).from_array(still), theta=2.6, height=1.75)
    last = play(engine, [(still, 8000)])[-1]
    total = trunk.mass + LEG.mass
    assert last["normal"] > 100
    assert last["normal"] == pytest.approx(
        trunk.share * total * GRAVITY + trunk.stiffness * (last["trunk_y"] - trunk.height), rel=1e-6
    )
    assert (last["trunk_vx"], last["trunk_vy"]) == pytest.approx((0, 0), abs=1e-6)
    assert last["friction"] == pytest.approx(0, abs=1e-2)

    def held(theta, phi):
        """Work that the drives must do against weight and ground to bring the leg here."""
        at = pose(LEG, theta, frame=FrameMotion(phi=phi))
        ground = last["toe_normal"] * at.point(LEG.toe)[1] + last["heel_normal"] * at.point(LEG.heel)[1]
        return GRAVITY * LEG.body_masses @ at.centres[:, 1] - ground

    theta, phi, step = last["theta"], last["phi"], 1e-5
    by_theta = (held(theta + step, phi) - held(theta - step, phi)) / (2 * step)
    by_phi = (held(theta, phi + step) - held(theta, phi - step)) / (2 * step)
    assert (last["crank_torque"], last["hip_torque"]) == pytest.approx((by_theta, by_phi), abs=1e-3)


@pytest.mark.parametrize("kind", ["fixed", "rail"])
def test_fixed_and_rail_keep_what_they_hold(kind):
    engine = LegEngine(LEG, Trunk(kind, height=1.6), SOFT, 1e-3, FILTERS)
    engine.reset(RUN, x=2.5)
    trace = play(engine, random_schedule(3, 10, 50))
    assert (trace["trunk_y"] == 1.6).all()
    assert (trace["trunk_vy"] == 0).all()
    assert (np.ptp(trace["trunk_x"]) > 0.1) == (kind == "rail")
    if kind == "fixed":
        assert (trace["trunk_x"] == 2.5).all()
        assert (trace["trunk_vx"] == 0).all()


def test_the_elastic_peak_of_a_free_trunk_converges_with_the_step():
    def peak(h):
        engine = LegEngine(LEG, Trunk(height=LEG.hip_height), Ground(), h, FILTERS)
        engine.reset(RUN, speed=2.0)
        return play(engine, [(RUN.to_array(), round(0.6 / h))])["normal"].max()

    best = peak(1e-5)
    errors = np.array([abs(peak(h) / best - 1) for h in (1.6e-3, 8e-4, 4e-4, 2e-4)])
    assert errors[-1] < 1e-3
    assert (errors[:-1] / errors[1:] > 1.5).all()

"""The oracle of the engines against independent knowledge: `pose` and Lagrange, conservation."""

import numpy as np
import pytest

from hoof_env.constants import GRAVITY
from hoof_env.dynamics.parts import FREEDOMS, TRUNKS, Limb, Motor, Prescribed, Trunk
from hoof_env.ground.contact import Ground
from hoof_env.ground.terrain import Terrain
from hoof_env.leg.kinematics import FrameMotion, pose
from tests.dynamics.scenes import LEG, RUN, WALK
from tests.dynamics.scenes import NATURAL as GROUND
from tests.oracle.crank import PlainCrank
from tests.oracle.ground import PlainGround
from tests.oracle.horse import PlainHorse
from tests.oracle.run import depths, follow, simulate

OTHER = LEG.replace(travel=-LEG.travel, linear_density=2.0, inertia="paper", lengths={"FG": 0.6})
LIMIT = 600.0
LIMBS = (
    Limb(LEG, (0.6, -0.1), Motor(torque_limit=LIMIT)),
    Limb(OTHER, (-0.5, 0.2), Motor(60.0, LIMIT, rotor_inertia=1e-3, gear_ratio=30.0)),
)
FREE = Trunk("free", mass=90.0, drag=0.0, pitch_inertia=15.0)
INSIDE = np.array([[0.3, 0.2], [0.4, np.nan]])
"""Approach speeds: three hoof points have touched down, the fourth has not, wherever it is."""


def state(seed):
    """x, y, pitch, two crank angles; their rates; filters (2, 4, 3) on the move, the crank's at no jerk."""
    rng = np.random.default_rng(seed)
    value = np.array([RUN.to_array(), WALK.to_array()])
    filters = np.stack([value, rng.normal(size=(2, 4)), 10 * rng.normal(size=(2, 4)) * [0, 1, 1, 1]], axis=-1)
    q = np.array([0.3, 1.2, 0.2, *rng.uniform(0, 7, 2)])
    return q, rng.normal(size=5) * [1, 1, 1, 3, 3] + [0, 0, 0, 5, 5], filters


def filters_after(filters, t):
    """The same filters `t` [s] later, their accelerations constant."""
    value, rate, acc = np.moveaxis(filters, -1, 0)
    return np.stack([value + t * rate + t * t / 2 * acc, rate + t * acc, acc], axis=-1)


def swing(theta, filters):
    """phi, its derivative by theta and its rate while theta stands."""
    (_, offset, a, b), (_, doffset, da, db) = filters[:, 0], filters[:, 1]
    s, c = np.sin(theta), np.cos(theta)
    return offset + a * s + b * c, a * c - b * s, doffset + da * s + db * c


def poses(q, qd, filters):
    """Leg, pose, angular velocity of the rotor: of both `LIMBS`."""
    for limb, theta, rate, gait in zip(LIMBS, q[3:], qd[3:], filters, strict=True):
        phi, slope, by_time = swing(theta, gait)
        sense, phi_rate = limb.geometry.travel, slope * rate + by_time
        hip = complex(*limb.hip) * np.exp(1j * q[2])
        velocity = complex(qd[0], qd[1]) + 1j * qd[2] * hip
        frame = FrameMotion(
            phi=phi + sense * q[2],  # a turn of the whole, in the leg's own sense
            phi_rate=phi_rate + sense * qd[2],
            position=(q[0] + hip.real, q[1] + hip.imag),
            velocity=(velocity.real, velocity.imag),
        )
        rotor = qd[2] + sense * (phi_rate - limb.drive.gear_ratio * rate)
        yield limb, pose(limb.geometry, theta, rate, 0.0, frame), rotor


def energies(q, qd, filters):
    """Kinetic and potential energy [J] of `FREE` with `LIMBS`, body by body."""
    kinetic = FREE.mass * (qd[0] ** 2 + qd[1] ** 2) / 2 + FREE.pitch_inertia * qd[2] ** 2 / 2
    potential = FREE.mass * GRAVITY * q[1]
    for limb, p, rotor in poses(q, qd, filters):
        m, inertia = limb.geometry.body_masses, limb.geometry.body_inertias
        kinetic += m @ (p.centre_velocities**2).sum(1) / 2 + inertia @ p.angular_velocities**2 / 2
        kinetic += limb.drive.rotor_inertia * rotor**2 / 2
        potential += GRAVITY * m @ p.centres[:, 1]
    return kinetic, potential


def slope_of(f, h=2e-4):
    """Derivative at 0 of a function, of sixth order in `h`."""
    weights = ((1, 45 / 60), (2, -9 / 60), (3, 1 / 60))
    return sum(w * (f(k * h) - f(-k * h)) for k, w in weights) / h


# -- one instant -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_a_free_trunk_and_two_motors_obey_lagrange(seed):
    """d/dt dL/dqd - dL/dq = Q, by finite differences of energies that `pose` gives."""
    q, qd, filters = state(seed)
    now = PlainHorse(FREE, LIMBS, GROUND).at(q[:3], qd[:3], q[3:], qd[3:], filters, INSIDE)
    qdd = np.concatenate([now.trunk_acc, now.theta_acc])
    gains = np.array([limb.drive.speed_gain for limb in LIMBS])
    drives = np.concatenate([np.zeros(3), np.clip(gains * (filters[:, 0, 0] - qd[3:]), -LIMIT, LIMIT)])

    def lagrangian(dq, dqd, t):
        """L beside the state that the motion reaches after `t` [s]."""
        q_t, qd_t = q + qd * t + qdd * t * t / 2, qd + qdd * t
        kinetic, potential = energies(q_t + dq, qd_t + dqd, filters_after(filters, t))
        return kinetic - potential

    def hooves(q):
        corners = [
            [p.point(limb.geometry.toe), p.point(limb.geometry.heel)] for limb, p, _ in poses(q, qd, filters)
        ]
        return np.array(corners) @ [1, 1j]

    assert now.hoof == pytest.approx(hooves(q), abs=1e-12)
    assert np.abs(now.hoof_force).max() > 100
    for e, drive in zip(np.eye(5), drives, strict=True):
        gain = slope_of(lambda t, e=e: (lagrangian(0, e, t) - lagrangian(0, -e, t)) / 2)  # L is square in qd
        push = slope_of(lambda s, e=e: lagrangian(s * e, 0, 0.0))
        ground = np.sum(now.hoof_force.conj() * slope_of(lambda s, e=e: hooves(q + s * e))).real
        assert gain - push == pytest.approx(drive + ground, rel=1e-7, abs=1e-6)
    assert (now.kinetic, now.potential) == pytest.approx(energies(q, qd, filters), rel=1e-12)


@pytest.mark.parametrize("kind", TRUNKS)
def test_powers_add_up_to_the_change_of_energy(kind):
    """Mixed drives, commands on the move, hooves in a slope: no one's power is forgotten."""
    limbs = (Limb(LEG, (0.5, 0.1), Prescribed()), Limb(OTHER, (-0.4, 0.0), Motor()))
    horse = PlainHorse(Trunk(kind, drag=30.0), limbs, GROUND, Terrain.slope(0.2))
    q, qd, filters = state(4)
    qd[:3] *= np.arange(3) < FREEDOMS[kind]
    q[2] *= kind == "free"
    qd[3] = filters[0, 0, 0]
    now = horse.at(q[:3], qd[:3], q[3:], qd[3:], filters, INSIDE)
    qdd = np.concatenate([now.trunk_acc, now.theta_acc])

    def energy(t):
        q_t, qd_t = q + qd * t + qdd * t * t / 2, qd + qdd * t
        then = horse.at(q_t[:3], qd_t[:3], q_t[3:], qd_t[3:], filters_after(filters, t), INSIDE)
        return then.kinetic + then.potential

    assert slope_of(energy) == pytest.approx(sum(now.power.values()), rel=1e-8)
    idle = dict.fromkeys(now.power, False) | {"drag": kind == "fixed", "damping": kind != "suspended"}
    assert {name: power == 0 for name, power in now.power.items()} == idle


def test_a_limp_horse_falls_as_one():
    limbs = [Limb(LEG, hip, Motor(speed_gain=0.0)) for hip in ((0.5, 0), (0.5, 0.1), (-0.5, 0), (-0.4, 0))]
    now = PlainHorse(FREE, limbs).at((0, 2, 0.3), (1, 2, 0), range(4), [0] * 4, [[5.0, 0.4, 0.1, 0.2]] * 4)
    assert now.trunk_acc == pytest.approx([0, -GRAVITY, 0], abs=1e-10)
    assert now.theta_acc == pytest.approx(0, abs=1e-9)
    assert now.hip_torque == pytest.approx(0, abs=1e-9)


def test_a_slope_is_level_ground_turned():
    turn = np.exp(0.3j)
    level, slope = PlainGround(GROUND), PlainGround(GROUND, Terrain.slope(0.3))
    for place, velocity in ((0.5 - 0.02j, 0.4 - 0.3j), (-0.2 - 0.001j, -0.02 + 0.1j)):
        expected = np.multiply(level.forces(place, velocity, 0.4), turn)
        found = np.array(slope.forces(place * turn, velocity * turn, 0.4))
        assert found == pytest.approx(expected, rel=1e-9)
        assert slope.depth(place * turn, velocity * turn) == pytest.approx((-place.imag, -velocity.imag))
    soft = PlainGround(GROUND, Terrain((0.0, 0.0), (0.5, 1.5), (0.0, 2.0), start=1.0, spacing=2.0))
    found, expected = (np.array(kind.forces(1.5 - 0.01j, 1 + 0j, 0.4)) for kind in (soft, level))
    assert found == pytest.approx(expected * [0.75, 0.75 * 0.5], rel=1e-12)


# -- runs ------------------------------------------------------------------------------------------------


def test_a_ball_comes_down_on_time_and_leaves_as_its_law_says():
    """Dropped from 1 m without weight in the ground: touch-down by the textbook, bounce by the law."""
    ground = PlainGround(Ground(normal_law="exact", restitution=0.5))

    def rate(y, approach):
        touching = not np.isnan(approach[0])
        push = ground.forces(1j * y[0], 1j * y[1], approach[0])[0].imag / 5.0 if touching else -GRAVITY
        return np.array([y[1], push])

    def depth(y):
        return depths(ground, 1j * y[:1], 1j * y[1:])

    y, approach, (down, up) = follow(rate, depth, np.array([1.0, 0.0]), np.array([0, 0.2, 0.6]), 1e-4)
    fall = np.sqrt(2 * GRAVITY)
    assert (down.t, down.approach, down.down, up.down) == pytest.approx((fall / GRAVITY, fall, True, False))
    assert y[1] == pytest.approx([1 - GRAVITY * 0.02, -GRAVITY * 0.2])
    assert y[2, 1] == pytest.approx(0.5 * fall - GRAVITY * (0.6 - up.t), rel=1e-8)
    assert np.isnan(approach).all()


def test_flight_keeps_momentum_and_the_energy_account():
    horse = PlainHorse(FREE, LIMBS, GROUND)
    times = np.linspace(0, 0.15, 4)
    run = simulate(horse, [RUN, WALK], times, (1.0, 4.0), (0.0, 9.0), (0, 6, 0.1), (3, 1, 0.5))
    gaits = np.array([RUN.to_array(), WALK.to_array()])
    at = [
        horse.at(*row, gaits)
        for row in zip(run.trunk, run.trunk_rate, run.theta, run.theta_rate, strict=True)
    ]
    weight = horse.masses.sum() * GRAVITY
    momentum = np.array([now.momentum for now in at]) + 1j * weight * times
    assert momentum == pytest.approx(momentum[0], abs=1e-9 * abs(momentum[0]))
    turning = np.array([now.angular_momentum for now in at])
    assert turning == pytest.approx(turning[0], abs=1e-9 * abs(turning[0]))
    energy = np.array([now.kinetic + now.potential for now in at])
    drives = sum(run.work.values())
    assert np.ptp(drives) > 10
    assert energy - drives == pytest.approx(energy[0], rel=1e-9 * np.ptp(drives) / energy[0])
    assert np.ptp(run.trunk[:, 2] - 0.5 * times) > 0.01  # the legs turn the trunk
    assert not run.touches


@pytest.fixture(scope="module")
def crank():
    return PlainCrank(Limb(LEG), RUN, GROUND, LEG.hip_height, pieces=24)


def test_on_the_ground_the_account_closes_and_the_tables_agree(crank):
    trunk = Trunk("fixed", height=LEG.hip_height)
    horse = PlainHorse(trunk, [Limb(LEG)], GROUND)
    times = np.array([0.0, 0.05, 0.065, 0.075])
    run = simulate(horse, [RUN], times, [0.9])
    theta, rate, touches = crank.run(0.9, times)
    assert run.theta[:, 0] == pytest.approx(theta, abs=1e-10)
    assert run.theta_rate[:, 0] == pytest.approx(rate, abs=1e-8)
    assert [(touch.point, touch.down) for touch in run.touches] == [(0, True), (1, True)]
    assert np.array([(touch.t, touch.approach) for touch in run.touches]) == pytest.approx(
        np.array([(touch.t, touch.approach) for touch in touches]), rel=1e-8
    )
    assert (~np.isnan(run.approach[:, 0])).sum(axis=1).tolist() == [0, 0, 1, 2]
    first, last = (
        horse.at(run.trunk[k], run.trunk_rate[k], run.theta[k], run.theta_rate[k], [RUN.to_array()])
        for k in (0, -1)
    )
    change = last.kinetic + last.potential - first.kinetic - first.potential
    assert sum(work[-1] for work in run.work.values()) == pytest.approx(change, abs=1e-9)
    assert run.work["friction"][-1] < 0


def test_the_reference_crank_has_converged(crank):
    """1e-8 rad after 2 s of touch-downs; the starts are hard ones."""
    for start in (0.0, 2.1):
        ends = [crank.run(start, [0.0, 2.0], tolerance)[0][-1] for tolerance in (1e-12, 1e-13)]
        assert ends[0] == pytest.approx(ends[1], abs=1e-8)
        assert ends[0] - start < RUN.crank_speed * 2 - 0.1  # the ground has slowed it

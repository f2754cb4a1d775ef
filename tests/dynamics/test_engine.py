"""The engine on a fixed trunk against a direct evaluation; its state, its failures and its border."""

import copy
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hoof_env.dynamics.constrained import ConstrainedLeg
from hoof_env.dynamics.engine import LegEngine
from hoof_env.dynamics.result import Result
from hoof_env.dynamics.trace import TRACE, new_trace
from hoof_env.dynamics.trunk import Trunk
from hoof_env.errors import ParameterError
from hoof_env.gait.motion_law import FilterSettings
from hoof_env.gait.parameters import LIMITS, load_gait
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.kinematics import FrameMotion, pose
from hoof_env.leg.linkage import POINTS

LEG = load_geometry("first_fit")
GAITS = {name: load_gait(name, "first_fit") for name in ("walk", "run")}
RUN = GAITS["run"]
FIXED = Trunk("fixed", height=LEG.hip_height)
COMMANDS = [np.array(c) for c in ([9.0, 0.9, -0.4, 0.1], [2.0, 0.2, 0.5, -0.5], [12.0, 1.2, -0.6, -0.4])]

# Golden: what the search that identified this leg reported of it, an independent program, at 1 ms. Contact
# from the first sample inside to the first outside; hoof angle at the first and the last sample inside, least
# and greatest; peak and mean over the cycle of the normal force, with backward differences as rates.
IDENTIFIED = {
    "walk": {
        "contact": (0.247, 0.583), "angle_deg": (-3.251, 20.393, -10.346, 20.479),
        "elastic": (176.025, 35.378), "inelastic": (477.671, 74.964),
    },
    "run": {
        "contact": (0.205, 0.484), "angle_deg": (6.014, 70.25, 2.965, 70.25),
        "elastic": (5885.621, 803.919), "inelastic": (8816.767, 928.29),
    },
}  # fmt: skip


def cycle(gait, restitution, h=1e-3):
    """One revolution as the paper has it: fixed trunk, approach speed at the first sample inside."""
    ground = Ground(restitution=restitution, approach="sampled", approach_floor=1e-4)
    engine = LegEngine(LEG, FIXED, ground, h)
    engine.reset(gait)
    trace = new_trace(round(1 / h))
    assert engine.advance(gait.to_array(), trace) is Result.OK
    return trace


def forces_of(penetrations, rates, chi):
    """Eq. 14 on one point, sample by sample, written anew."""
    forces, approach = [], None
    for d, v in zip(penetrations, rates, strict=True):
        if d <= 0:
            approach = None
            forces.append(0.0)
            continue
        approach = max(v, 1e-4) if approach is None else approach
        forces.append(max(2e4 * d**1.5 * (1 + chi * v / approach), 0.0))
    return np.array(forces)


@pytest.mark.parametrize("restitution", [1.0, 0.0, 0.6])
@pytest.mark.parametrize("gait", GAITS.values(), ids=GAITS)
def test_forces_on_a_fixed_trunk_are_those_of_the_prescribed_motion(gait, restitution):
    trace = cycle(gait, restitution)
    normal = {}
    for name, letter in (("toe", LEG.toe), ("heel", LEG.heel)):
        positions, velocities = [], []
        for t in trace["t"]:
            theta, w = gait.crank_speed * t, gait.crank_speed
            s, c = np.sin(theta), np.cos(theta)
            a, b = gait.swing_sin, gait.swing_cos
            phi = gait.swing_offset + a * s + b * c
            frame = FrameMotion(phi=phi, phi_rate=w * (a * c - b * s), position=(0.0, LEG.hip_height))
            at = pose(LEG, theta, w, 0.0, frame)
            positions.append(at.point(letter))
            velocities.append(at.point_velocities[POINTS.index(letter)])
        (x, y), (vx, vy) = np.transpose(positions), np.transpose(velocities)
        for field, expected in (("x", x), ("vx", vx), ("penetration", -y), ("rate", -vy)):
            assert trace[f"{name}_{field}"] == pytest.approx(expected, abs=1e-9)
        normal[name] = forces_of(-y, -vy, 0.75 * (1 - restitution**2))
        assert trace[f"{name}_normal"] == pytest.approx(normal[name], rel=1e-6, abs=1e-6)
        friction = -0.4 * normal[name] * np.sign(vx) * np.clip((np.abs(vx) - 1e-3) / 9e-3, 0, 1)
        assert trace[f"{name}_friction"] == pytest.approx(friction, rel=1e-6, abs=1e-6)
    assert trace["normal"] == pytest.approx(normal["toe"] + normal["heel"], rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("name", GAITS)
def test_the_leg_is_the_one_that_was_identified(name):
    golden = IDENTIFIED[name]
    elastic, inelastic = cycle(GAITS[name], 1.0), cycle(GAITS[name], 0.0)
    inside = np.flatnonzero((elastic["toe_penetration"] > 0) | (elastic["heel_penetration"] > 0))
    assert (np.diff(inside) == 1).all()
    assert elastic["t"][[inside[0], inside[-1] + 1]] == pytest.approx(golden["contact"], abs=1e-9)
    angle = np.degrees(elastic["hoof_angle"][inside])
    assert (angle[0], angle[-1], angle.min(), angle.max()) == pytest.approx(golden["angle_deg"], abs=6e-4)
    normal = elastic["normal"]
    assert (normal.max(), normal.mean()) == pytest.approx(
        golden["elastic"], rel=1e-4
    )  # lengths had six digits
    # with the rates that the search took, the inelastic numbers are its own
    differenced = 0.0
    for point in ("toe", "heel"):
        d = inelastic[f"{point}_penetration"]
        differenced = differenced + forces_of(d, np.diff(d, prepend=d[-1]) / 1e-3, 0.75)
    assert (differenced.max(), differenced.mean()) == pytest.approx(golden["inelastic"], rel=2e-4)
    normal = inelastic["normal"]  # the engine has the true rates
    assert (normal.max(), normal.mean()) == pytest.approx(golden["inelastic"], rel=0.01)


def test_the_sampled_peak_converges_to_that_of_the_motion():
    coarse, fine, finest = (cycle(RUN, 1.0, h)["normal"].max() for h in (4e-3, 1e-3, 1e-5))
    assert coarse <= fine <= finest * (1 + 1e-12)  # samples cannot exceed the maximum
    assert fine == pytest.approx(finest, rel=1e-4)


# -- state -----------------------------------------------------------------------------------------------


def bits(state):
    return tuple(part.tobytes() for part in (state.body, state.motion, state.filters, state.contacts))


def engine_at(kind="suspended", substeps=300):
    engine = LegEngine(
        LEG, Trunk(kind, height=LEG.hip_height), Ground(restitution=0.5, approach_floor=0.1), 1e-3
    )
    engine.reset(RUN, theta=0.4, speed=0.0 if kind == "fixed" else 1.0)
    engine.advance(COMMANDS[0], new_trace(substeps))
    return engine


@pytest.mark.parametrize("kind", ["fixed", "rail", "suspended"])
def test_the_same_commands_give_the_same_bits_however_they_are_cut(kind):
    ends = []
    for cut in (40, 10, 1):
        engine = engine_at(kind)
        for command in COMMANDS:
            for _ in range(40 // cut):
                trace = new_trace(cut)
                engine.advance(command, trace)
        engine.state.body["t"] = round(engine.state.body["t"], 9)  # the clock is a sum and may round
        ends.append(bits(engine.state))
    assert ends[0] == ends[1] == ends[2]


@pytest.mark.parametrize("kind", ["fixed", "rail", "suspended"])
@pytest.mark.parametrize("substeps", [1, 200, 300])
def test_a_restored_state_goes_on_bit_for_bit(kind, substeps):
    engine, other = engine_at(kind, substeps), engine_at(kind, 7)
    kept = engine.state.copy()
    futures = []
    for runner in (engine, engine, other):
        runner.state = kept.copy()
        trace = new_trace(50)
        runner.advance(COMMANDS[1], trace)
        futures.append((trace.tobytes(), bits(runner.state)))
    assert futures[0] == futures[1] == futures[2]
    assert bits(kept) != futures[0][1]


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda e: pickle.loads(pickle.dumps(e))])
@pytest.mark.parametrize("kind", [LegEngine, ConstrainedLeg])
def test_a_copied_engine_goes_on_bit_for_bit(kind, copied):
    engine = engine_at() if kind is LegEngine else ConstrainedLeg(LEG, Ground())
    if kind is ConstrainedLeg:
        engine.reset(RUN, theta=0.2)
    other, runs = copied(engine), []
    for runner in (engine, other):
        first, second = new_trace(30), new_trace(30)
        runner.advance(COMMANDS[1], first)
        before = bits(runner.state)
        start = runner.reset(GAITS["walk"], theta=2.0, x=0.5)  # which writes to the records by name
        runner.advance(COMMANDS[1], second)
        runs.append([first.tobytes(), before, start.tobytes(), second.tobytes(), bits(runner.state)])
    assert runs[0] == runs[1]


def test_reset_forgets_everything():
    fresh, used = engine_at(), engine_at(substeps=777)
    for engine in (fresh, used):
        engine.reset(GAITS["walk"], theta=2.0, height=1.8, speed=0.5)
    assert bits(fresh.state) == bits(used.state)


@given(theta=st.floats(-20, 20), speed=st.floats(-5, 5), height=st.floats(1.0, 3.0), x=st.floats(-9, 9))
@settings(deadline=None, max_examples=30)
def test_reset_puts_the_trunk_where_it_is_told(theta, speed, height, x):
    engine = LegEngine(LEG, Trunk(), Ground(), 1e-3)
    row = engine.reset(RUN, theta=theta, speed=speed, height=height, x=x)[0]
    place = (row["trunk_x"], row["trunk_y"], row["trunk_vx"], row["trunk_vy"])
    assert place == pytest.approx((x, height, speed, 0.0), abs=1e-12)
    assert (row["t"], row["theta"]) == (0.0, theta)


def test_samples_are_taken_at_the_end_of_each_substep():
    engine = LegEngine(LEG, FIXED, Ground(), 1e-3)
    assert engine.reset(RUN)["t"] == [0.0]
    trace = new_trace(5)
    engine.advance(RUN.to_array(), trace)
    assert trace["t"] == pytest.approx([1e-3, 2e-3, 3e-3, 4e-3, 5e-3], abs=1e-15)
    assert trace["theta"] == pytest.approx(2 * np.pi * trace["t"], abs=1e-14)


# -- failures and the border -----------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["fixed", "rail", "suspended"])
@pytest.mark.parametrize("which", range(4))
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_command_that_is_not_finite_changes_nothing(kind, which, bad):
    engine = engine_at(kind)
    before = bits(engine.state)
    command = COMMANDS[1].copy()
    command[which] = bad
    result = engine.advance(command, new_trace(20))
    if np.isnan(bad):
        assert result is Result.NOT_FINITE
        assert "finite" in result.message
        assert bits(engine.state) == before
        assert engine.advance(COMMANDS[1], new_trace(20)) is Result.OK
    else:
        assert result is Result.OK  # as far as the filters' rate bounds let it


@pytest.mark.parametrize(("field", "value"), [("px", np.inf), ("py", 1e308), ("cx", np.nan), ("cy", np.nan)])
def test_an_absurd_state_is_reported_and_kept(field, value):
    engine = engine_at()
    engine.state.body[field] = value
    before = bits(engine.state)
    assert engine.advance(COMMANDS[0], new_trace(2000)) is Result.NOT_FINITE
    assert bits(engine.state) == before


@pytest.mark.parametrize("kind", ["fixed", "rail", "suspended"])
def test_an_engine_that_was_never_reset_goes_nowhere(kind):
    engine = LegEngine(LEG, Trunk(kind), Ground(), 1e-3)
    assert engine.advance(COMMANDS[0], new_trace(1)) is Result.NOT_FINITE
    engine.reset(RUN)
    assert engine.advance(COMMANDS[0], new_trace(1)) is Result.OK


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda e: e.advance(np.zeros(3), new_trace(1)), r"command: expected 4 values .* got shape \(3,\)"),
        (lambda e: e.reset(RUN, theta=np.nan), "theta: expected a finite number"),
        (lambda e: e.reset(RUN, height=np.inf), "height: expected a finite number"),
        (lambda e: e.reset(RUN, speed="fast"), "speed: expected a finite number"),
        (lambda e: e.reset(RUN, x=None), "x: expected a finite number"),
    ],
)
def test_bad_arguments_are_named(call, message):
    with pytest.raises(ParameterError, match=message):
        call(engine_at())


def test_a_trunk_is_not_asked_for_what_it_cannot_do():
    with pytest.raises(ParameterError, match=r"height: a rail trunk is at 1\.7 m, got 1\.8 m"):
        LegEngine(LEG, Trunk("rail", height=1.7), Ground()).reset(RUN, height=1.8)
    with pytest.raises(ParameterError, match="speed: expected 0 of a fixed trunk, got 1 m/s"):
        LegEngine(LEG, Trunk("fixed"), Ground()).reset(RUN, speed=1.0)


@pytest.mark.parametrize("sim_dt", [0.0, -1e-3, np.nan, 0.011, "1ms"])
def test_a_step_too_long_for_the_filters_is_refused(sim_dt):
    with pytest.raises(ParameterError, match="sim_dt: expected a finite number in"):
        LegEngine(LEG, Trunk(), Ground(), sim_dt)
    LegEngine(LEG, Trunk(), Ground(), 0.011, FilterSettings(gain=10.0))


def test_bounds_of_every_parameter_can_be_commanded():
    low, high = np.array(list(LIMITS.values())).T
    engine = engine_at()
    for command in (low, high, low):
        trace = new_trace(500)
        assert engine.advance(command, trace) is Result.OK
        assert all(np.isfinite(trace[name]).all() for name in TRACE.names if name != "cop_x")

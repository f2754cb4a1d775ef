"""What a trace row says is what its name says."""

import numpy as np
import pytest

from hoof_env.dynamics.engine import LegEngine
from hoof_env.dynamics.trace import TRACE, new_trace, to_table
from hoof_env.dynamics.trunk import Trunk
from hoof_env.gait.parameters import load_gait
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.kinematics import FrameMotion, pose
from hoof_env.leg.linkage import POINTS

RUN = load_gait("run", "first_fit")


@pytest.fixture(scope="module", params=[-1, 1])
def played(request):
    """A leg, and a trace of it that has stance and flight, commands changing."""
    leg = load_geometry("first_fit").replace(travel=request.param)
    ground = Ground(restitution=0.5, approach_floor=0.1)
    engine = LegEngine(leg, Trunk(height=leg.hip_height), ground, 1e-3)
    engine.reset(RUN, speed=1.0, x=4.0)
    rows = []
    for command in (
        RUN.to_array(),
        load_gait("walk", "first_fit").to_array(),
        np.array([9.0, 1.0, -0.5, 0.3]),
    ):
        rows.append(new_trace(400))
        engine.advance(command, rows[-1])
    return leg, np.concatenate(rows)


def test_points_are_where_the_pose_has_them(played):
    leg, trace = played
    for row in trace[::10]:
        frame = FrameMotion(
            row["phi"], row["phi_rate"], row["phi_acc"],
            (row["trunk_x"], row["trunk_y"]), (row["trunk_vx"], row["trunk_vy"]),
        )  # fmt: skip
        at = pose(leg, row["theta"], row["theta_rate"], row["theta_acc"], frame)
        for name, letter in (("toe", leg.toe), ("heel", leg.heel)):
            velocity = at.point_velocities[POINTS.index(letter)]
            assert (row[f"{name}_x"], -row[f"{name}_penetration"]) == pytest.approx(
                at.point(letter), abs=1e-12
            )
            assert (row[f"{name}_vx"], -row[f"{name}_rate"]) == pytest.approx(velocity, abs=1e-11)
        toe, heel = at.point(leg.toe), at.point(leg.heel)
        rise = (heel - toe)[1] / np.linalg.norm(heel - toe)
        assert np.sin(row["hoof_angle"]) == pytest.approx(rise, abs=1e-12)  # heel up is positive


def test_a_flat_sole_has_its_toe_in_front(played):
    leg, trace = played
    flat = trace[np.argmin(np.abs(np.sin(trace["hoof_angle"])))]
    forward = leg.travel == load_geometry("first_fit").travel  # mirrored, the leg stands the wrong way round
    assert abs(flat["hoof_angle"]) == pytest.approx(0.0 if forward else np.pi, abs=0.1)
    assert (flat["toe_x"] > flat["heel_x"]) == forward


def test_sums_over_both_points(played):
    _, trace = played
    assert (trace["normal"] == trace["toe_normal"] + trace["heel_normal"]).all()
    assert (trace["friction"] == trace["toe_friction"] + trace["heel_friction"]).all()
    assert trace["grf"] == pytest.approx(np.hypot(trace["normal"], trace["friction"]), rel=1e-14)
    assert trace["grf"].max() > 100


def test_what_is_outside_bears_nothing_and_has_no_approach_speed(played):
    _, trace = played
    for point in ("toe", "heel"):
        outside = trace[f"{point}_penetration"] <= 0
        assert outside.any()
        assert not outside.all()
        for name in ("normal", "friction", "approach"):
            assert (trace[f"{point}_{name}"][outside] == 0).all()
        assert (trace[f"{point}_approach"][~outside] >= 0.1).all()


def test_the_centre_of_pressure_lies_between_the_points_that_bear(played):
    _, trace = played
    loaded = trace["normal"] > 0
    assert np.isnan(trace["cop_x"][~loaded]).all()
    at = trace[loaded]
    ends = np.sort([at["toe_x"], at["heel_x"]], axis=0)
    assert (at["cop_x"] >= ends[0] - 1e-12).all()
    assert (at["cop_x"] <= ends[1] + 1e-12).all()
    alone = (at["toe_normal"] > 0) & (at["heel_normal"] == 0)
    assert alone.any()
    assert at["cop_x"][alone] == pytest.approx(at["toe_x"][alone], rel=1e-14)
    moment = at["toe_normal"] * (at["toe_x"] - at["cop_x"]) + at["heel_normal"] * (at["heel_x"] - at["cop_x"])
    assert moment == pytest.approx(np.zeros(len(at)), abs=1e-9)


def test_a_table_has_every_column_and_its_own_memory(played):
    _, trace = played
    table = to_table(trace)
    assert tuple(table) == TRACE.names
    for name, column in table.items():
        assert column.tobytes() == np.ascontiguousarray(trace[name]).tobytes()
        assert not np.shares_memory(column, trace)


def test_a_new_trace_is_empty():
    trace = new_trace(3)
    assert trace.dtype == TRACE
    assert trace.shape == (3,)
    assert all((trace[name] == 0).all() for name in TRACE.names)

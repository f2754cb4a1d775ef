"""What the engine says of an instant, and that a force acts where its moment says."""

import numpy as np
import pytest

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Limb, Prescribed, Trunk
from hoof_env.gait import load_gait
from hoof_env.ground.contact import Ground
from hoof_env.ground.terrain import Terrain
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.kinematics import FrameMotion, pose
from hoof_env.record.columns import columns_of_engine, ground_at
from hoof_env.record.instant import POINTS, UNITS, Instant, leg_instants
from tests.legs import FIRST_FIT

LEG, RUN = load_geometry(FIRST_FIT), load_gait("run", FIRST_FIT)
HILLS = Terrain.through([-1.0, 0.4, 1.0, 2.0], [0.0, 0.0, 0.1, -0.05], friction=[1.0, 1.0, 0.5, 2.0])


def roll(terrain, trunk="suspended", seconds=1.0, **start):
    trunk = Trunk(trunk, height=LEG.hip_height, pitch_inertia=30.0)
    engine = TrunkEngine(Limb(LEG, drive=Prescribed()), trunk, Ground(), terrain)
    engine.reset(RUN, **start)
    return engine, engine.run(RUN.to_array(), round(seconds * 1000))


def test_every_field_has_a_unit_and_every_column_is_a_field():
    assert set(UNITS) == set(Instant._fields)
    assert set(columns_of_engine(roll(HILLS, seconds=0.01)[1], HILLS)) == set(Instant._fields)


def test_a_record_becomes_instants():
    _, record = roll(Terrain.flat())
    rows = leg_instants(columns_of_engine(record, command=np.arange(4.0)))
    assert len(rows) == len(record["time"])
    for k, now in list(enumerate(rows))[::100]:
        names = ("crank_angle", "crank_angle_rate", "swing_angle", "swing_offset", "swing_cos")
        of_leg = [record[name][k, 0, 0] for name in names]
        seen = (now.crank_angle, now.crank_angle_rate, now.swing_angle, now.swing_offset, now.swing_cos)
        assert (now.time, *seen) == (record["time"][k, 0], *of_leg)
        assert (now.command_crank_speed, now.command_swing_cos) == (0.0, 3.0)
        assert now.normal == record["toe_normal"][k, 0, 0] + record["heel_normal"][k, 0, 0]
        assert now.toe_depth == pytest.approx(-now.toe_y)
    assert np.isnan(leg_instants(columns_of_engine(record))[0].command_swing_sin)


def test_the_hoof_has_no_moment_about_its_centre_of_pressure():
    for ground in (Terrain.flat(), HILLS):
        found = columns_of_engine(roll(ground)[1], ground)
        loaded = found["toe_normal"] + found["heel_normal"] > 0
        assert 50 < loaded.sum() < len(loaded)
        moment = sum(
            (found[f"{p}_x"] - found["cop_x"]) * found[f"{p}_force_y"]
            - (found[f"{p}_y"] - found["cop_y"]) * found[f"{p}_force_x"]
            for p in POINTS
        )
        np.testing.assert_allclose(moment, 0, atol=1e-8)
        for name in ("cop_x", "cop_y", "force_x", "force_y"):
            assert not found[name][~loaded].any()


def test_with_equal_friction_the_centre_is_the_mean_weighted_by_load():
    found = columns_of_engine(roll(Terrain.flat(), seconds=1.5)[1])
    both = (found["toe_normal"] > 0) & (found["heel_normal"] > 0)
    toe, heel = (found[f"{p}_friction"] / np.where(both, found[f"{p}_normal"], 1) for p in POINTS)
    equal = both & (np.abs(toe - heel) < 1e-12)
    assert equal.sum() > 10
    load = {p: found[f"{p}_normal"][equal] for p in POINTS}
    mean = sum(load[p] * found[f"{p}_x"][equal] for p in POINTS) / sum(load.values())
    np.testing.assert_allclose(found["cop_x"][equal], mean)
    alone = (found["toe_normal"] > 0) & (found["heel_normal"] == 0)
    assert alone.sum() > 10
    np.testing.assert_allclose(found["cop_y"][alone], found["toe_y"][alone])


def test_a_pitching_trunk_carries_its_leg_where_the_engine_has_it():
    _, record = roll(HILLS, "free", 0.2, pitch=0.2, pitch_rate=-0.5, y=LEG.hip_height + 0.15, vx=1.0)
    found = columns_of_engine(record, HILLS)
    for now in leg_instants(found)[::20]:
        points = pose(LEG, now.crank_angle, frame=FrameMotion(phi=now.swing_angle))
        for point, corner in (("toe", LEG.toe), ("heel", LEG.heel)):
            z = complex(*points.point(corner)) * np.exp(1j * now.pitch) + complex(now.x, now.y)
            at = complex(getattr(now, f"{point}_x"), getattr(now, f"{point}_y"))
            assert abs(z - at) < 1e-9
    speed = np.gradient(found["x"], found["time"])
    np.testing.assert_allclose(found["vx"][1:-1], speed[1:-1], atol=2e-3)


def test_forces_in_the_world_add_up_to_the_engine_s_impulse_on_hills():
    engine, record = roll(HILLS, vx=1.0)
    found = columns_of_engine(record, HILLS)
    level = found["toe_friction"] + found["heel_friction"]
    assert np.abs(found["force_x"] - level).max() > 10  # hills matter
    for axis in "xy":
        force = found[f"force_{axis}"]
        impulse = 0.5e-3 * (force[1:] + force[:-1]).sum()
        assert impulse == pytest.approx(engine.account[f"impulse_{axis}"][0], abs=0.5)
    assert abs(engine.account["impulse_y"][0]) > 100
    depth, inside = found["toe_depth"], found["toe_depth"] > 0
    np.testing.assert_allclose(depth[inside], record["toe_penetration"][inside, 0, 0], atol=1e-12)


def test_one_instant_and_a_run_are_read_alike():
    engine, record = roll(HILLS, seconds=0.05)
    last = leg_instants(columns_of_engine(record, HILLS))[-1]
    (now,) = leg_instants(columns_of_engine(engine.state | engine.report, HILLS))
    np.testing.assert_array_equal(last, now)


def test_the_ground_at_a_point_is_the_terrain_s():
    x = np.array([-5.0, -1.0, 0.2, 0.7, 1.5, 9.0])
    height, normal = ground_at(HILLS, x)
    np.testing.assert_allclose(height, HILLS.height_at(x), atol=1e-12)
    slope = np.array([0.0, 0.0, 0.0, 1 / 6, -0.15, 0.0])
    np.testing.assert_allclose(normal, (1j - slope) / np.hypot(1, slope), atol=1e-9)
    assert ground_at(Terrain.flat(), np.zeros(0))[0].shape == (0,)

"""The engine against the peers: as near as each is to itself at twice its step."""

from dataclasses import replace

import pytest

pytest.importorskip("mujoco")
pytest.importorskip("exudyn")

from benchmarks.common import ALL
from hoof_env.dynamics.parts import Motor
from tests.legs import FIRST_FIT, PRESETS
from tests.peers.agreement import PEERS, compare, quantities
from tests.peers.cases import CASES, Case
from tests.peers.trunk_legs import TrunkLegs

GROUND = [case for case in CASES if case.ground]
COARSE = {"ours": 5e-4, "MuJoCo": 1e-3, "Exudyn": 1e-3}


def assert_agreement(rows, forces, motion):
    """Within the engines' own differences, and these small: of forces and torques, and of coordinates."""
    for row in rows:
        small = motion if row.unit in ("m", "rad") else forces
        label = f"{row.engine}, {row.quantity}: {row}"
        if row.engine in PEERS:
            assert row.share < 1, label
            assert row.relative < small, label
            assert row.closure < 1e-8, label
        else:
            assert row.relative < 2e-3, label
            assert row.closure < 1e-12, label


def test_a_leg_on_a_rail_moves_as_in_the_peers():
    rows = compare(FIRST_FIT, Case("rail", drive=Motor(), duration=0.5), COARSE)
    assert {row.engine for row in rows} >= set(PEERS)
    assert_agreement(rows, forces=5e-3, motion=1e-5)


def test_the_comparison_sees_a_rotor_that_is_a_hundredth_heavier():
    case = Case("rail", drive=Motor(), duration=0.5)
    heavier = replace(case, drive=Motor(rotor_inertia=1.01 * Motor().rotor_inertia))
    for quantity in ("crank angle", "crank torque"):
        one, two, coarse = (
            quantities(case, some.horse(FIRST_FIT).ours(dt), ALL, ALL)[quantity]
            for some, dt in ((case, 1e-4), (heavier, 1e-4), (case, 2e-4))
        )
        assert abs(one - two).max() > 1e3 * abs(one - coarse).max()


@pytest.mark.peers
@pytest.mark.parametrize("case", [case for case in CASES if not case.ground], ids=lambda case: case.name)
@pytest.mark.parametrize("preset", PRESETS.values(), ids=PRESETS)
def test_engine_agrees_with_the_peers_in_the_air(preset, case):
    steps = {"ours": 1e-4, "MuJoCo": 2e-4, "Exudyn": 2e-4}
    assert_agreement(compare(preset, case, steps), forces=2e-4, motion=1e-6)


@pytest.mark.peers
@pytest.mark.parametrize("case", GROUND, ids=lambda case: case.name)
def test_engine_agrees_with_the_peers_on_the_ground(case):
    """On one leg, for time; docs/evidence/README.md has both."""
    for row in compare("identified", case):
        label = f"{row.engine}, {row.quantity}: {row}"
        if row.engine in PEERS:
            assert row.share < 1.5, label
            assert row.relative < (1e-5 if row.unit in ("m", "rad") else 1e-4), label
            assert row.closure < 1e-8, label
        else:
            assert row.closure < 1e-12, label


@pytest.mark.peers
@pytest.mark.parametrize("case", GROUND, ids=lambda case: case.name)
@pytest.mark.parametrize("preset", PRESETS.values(), ids=PRESETS)
def test_every_case_feels_the_ground(preset, case):
    horse = case.horse(preset)
    legs = TrunkLegs(horse.limbs, horse.trunk, horse.start, 1e-3, horse.ground, "midpoint")
    legs.run(case.duration, case.samples)
    assert legs.engine.account["impulse_y"][0] > 1

"""The engine against the peers on this project's ground, whose forces the peers take from outside."""

import pytest

pytest.importorskip("mujoco")
pytest.importorskip("exudyn")

from tests.peers.agreement import PEERS, compare
from tests.peers.cases import CASES
from tests.peers.trunk_legs import TrunkLegs

GROUND = [case for case in CASES if case.ground]
pytestmark = pytest.mark.peers


@pytest.mark.parametrize("case", GROUND, ids=lambda case: case.name)
def test_engine_agrees_with_the_peers(case):
    """On one leg, for time; docs/evidence/agreement.md has both."""
    for row in compare("identified", case):
        label = f"{row.engine}, {row.quantity}: {row}"
        if row.engine in PEERS:
            assert row.share < 1.5, label
            assert row.relative < (1e-5 if row.unit in ("m", "rad") else 1e-4), label
            assert row.closure < 1e-8, label
        else:
            assert row.closure < 1e-12, label


@pytest.mark.parametrize("case", GROUND, ids=lambda case: case.name)
@pytest.mark.parametrize("preset", ["first_fit", "identified"])
def test_every_case_feels_the_ground(preset, case):
    horse = case.horse(preset)
    legs = TrunkLegs(horse.limbs, horse.trunk, horse.start, 1e-3, horse.ground, "midpoint")
    legs.run(case.duration, case.samples)
    assert legs.engine.account["impulse_y"][0] > 1

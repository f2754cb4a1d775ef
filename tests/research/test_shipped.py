"""What is shipped as identified meets what it is said to meet."""

import numpy as np
import pytest

from hoof_env.gait.parameters import load_gait
from hoof_env.ground.preset import load_ground
from hoof_env.leg.geometry import load_geometry, read_preset
from research.identify.candidate import encode
from research.identify.confirm import confirm
from research.identify.ensemble import load_ensemble
from research.identify.objective import ILL_CONDITIONED, Objective
from research.identify.targets import load_targets


def test_the_identified_leg_meets_every_row_and_claim_with_the_exact_and_the_papers_solver():
    verdict = confirm(read_preset("identified"), load_targets(), "walks")
    assert verdict.holds
    assert verdict.within("exact") == (22, 22)
    assert verdict.within("paper, probable beta") == (19, 19)


def objective_of(geometry, walk, run, exponent):
    choice, x = encode(geometry, walk, run, exponent)
    return Objective(choice, samples=801, paper_solver=True), x


def test_the_identified_leg_is_plausible():
    gaits = (load_gait(gait, "identified") for gait in ("walk", "run"))
    objective, x = objective_of(load_geometry("identified"), *gaits, load_ground("identified").exponent)
    assert objective.report(x)["plausibility"] == {}


ENSEMBLE = load_ensemble("identified")


@pytest.mark.parametrize("number", range(len(ENSEMBLE.members)))
def test_every_member_of_its_ensemble_meets_every_row_too(number):
    """By the search's own measure, which agrees with the judge's to a twentieth of a bar."""
    member = ENSEMBLE.members[number]
    objective, x = objective_of(
        member.geometry, member.gaits["walk"], member.gaits["run"], load_ground("identified").exponent
    )
    well = ~np.isin(objective.row_ids, ILL_CONDITIONED)
    assert np.abs(objective.rows(x)).max() <= 1.0
    assert np.abs(objective.paper_rows(x))[well].max() <= 1.0
    assert sum(objective.report(x)["plausibility"].values()) < 0.02

import json
import re

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hoof_env.ground.contact import Ground
from hoof_env.ground.normal_force import FACTORS, restitution_of_factor
from hoof_env.paper.measure import POINTS
from hoof_env.paper.reproduce import GAITS
from hoof_env.paper.study.laws import PAPER_LAW, examine_laws, free_peak
from hoof_env.paper.study.laws_text import hardest_free
from hoof_env.paper.study.replay import exact_cycle, replay


@pytest.fixture(scope="module")
def section(few_points):
    return examine_laws(None, lambda line: None)


def entries(section):
    return [(law, sweep) for e in section.data["exponents"].values() for law, sweep in e["laws"].items()]


def test_full_restitution_reduces_nothing_and_gives_all_work_back(section):
    for _, sweep in entries(section):
        assert sweep["nominal"][-1] == 1.0
        for gait in GAITS:
            assert sweep[gait]["reduction"][-1] == 0.0
            assert sweep[gait]["returned"][-1] == pytest.approx(1, abs=1e-3)
            assert all(0 <= part <= 1.001 for part in sweep[gait]["returned"])


def test_the_exact_law_returns_what_it_says_and_the_papers_does_not(section):
    for law, sweep in entries(section):
        distance = np.abs(np.subtract(sweep["delivered"], sweep["nominal"]))
        if law == "exact":
            assert distance.max() < 1e-6
        if law == PAPER_LAW:
            assert sweep["delivered"][0] == pytest.approx(0.663, abs=1e-3)


def test_peaks_are_convex_in_the_factor_and_grow_with_it_without_bound(section):
    """A peak is the maximum over time of lines in chi."""
    for entry in section.data["exponents"].values():
        for gait in GAITS:
            pairs = [
                pair
                for sweep in entry["laws"].values()
                for pair in zip(sweep["chi"], sweep[gait]["peak"], strict=True)
            ]
            chi, peak = np.array(sorted(set(pairs))).T
            apart = np.concatenate(([True], np.diff(chi) > 1e-6))  # laws that share a factor to round-off
            slopes = np.diff(peak[apart]) / np.diff(chi[apart])
            assert np.all(np.diff(slopes) >= -1e-6 * slopes[-1])
            assert slopes[-1] > 0


def test_laws_of_one_factor_are_one_law_on_a_prescribed_motion(section):
    """Hunt-Crossley's chi at cr = 0.5 is Lankarani-Nikravesh's at 0: 3/4."""
    for entry in section.data["exponents"].values():
        one, two = entry["laws"][PAPER_LAW], entry["laws"]["hunt-crossley"]
        j, k = one["nominal"].index(0.0), two["nominal"].index(0.5)
        assert one["chi"][j] == two["chi"][k] == 0.75
        for gait in GAITS:
            assert one[gait]["peak"][j] == two[gait]["peak"][k]


@pytest.mark.parametrize("gait", GAITS)
def test_the_papers_inelastic_force_is_the_elastic_one_times_its_factor(gait):
    cycle = exact_cycle(gait, None)
    elastic, inelastic = (replay(cycle, Ground(restitution=cr)) for cr in (1.0, 0.0))
    for point in POINTS:
        inside = elastic[f"{point}_penetration"] > 0
        speed = elastic[f"{point}_approach"][inside]
        factor = np.maximum(1 + 0.75 * elastic[f"{point}_rate"][inside] / speed, 0)
        np.testing.assert_allclose(
            inelastic[f"{point}_normal"][inside], factor * elastic[f"{point}_normal"][inside], rtol=1e-12
        )


@pytest.mark.parametrize("chi", [0.2, 0.75, 3.0, 30.0])
@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0])
def test_free_peaks_are_those_of_an_integrated_impact(chi, exponent):
    def fall(_, state):
        d, v = state
        return v, -(max(d, 0.0) ** exponent) * (1 + chi * v)

    steps = solve_ivp(fall, (0, 2.5), (0.0, 1.0), rtol=1e-10, atol=1e-12, max_step=2e-3)
    d, v = steps.y
    elastic = ((exponent + 1) / 2) ** (exponent / (exponent + 1))
    peak = np.max(np.maximum(d, 0) ** exponent * (1 + chi * v))
    assert free_peak(chi, exponent) == pytest.approx(peak / elastic, rel=1e-3)


def test_without_damping_a_free_impact_has_its_elastic_peak():
    assert free_peak(0.0, 1.5) == free_peak(1e-9, 1.5) == 1.0
    assert free_peak(1e-5, 1.5) == pytest.approx(1, abs=1e-4)


def test_rescaled_stiffness_keeps_the_running_peak(section):
    peaks = {}
    for exponent, entry in section.data["exponents"].items():
        ground = Ground(exponent=float(exponent), stiffness=entry["stiffness_rescaled"])
        peaks[exponent] = replay(exact_cycle("run", None), ground)["normal"].max()
    assert list(peaks.values()) == pytest.approx([peaks[section.data["exponent"]]] * len(peaks))


def test_the_restitution_of_the_published_reductions_gives_them_back(section):
    sweep = section.data["exponents"][section.data["exponent"]]["laws"]["exact"]
    for gait, found in section.data["published"].items():
        bracket = sorted(zip(sweep["delivered"], sweep[gait]["reduction"], strict=True))
        below = max(e for e, reduction in bracket if reduction >= found["reduction"])
        above = min(e for e, reduction in bracket if reduction <= found["reduction"])
        assert below <= found["delivered"] <= above


def test_the_floor_acts_from_the_smallest_approach_speed_on(section):
    floor = section.data["floor"]
    for gait in GAITS:
        peaks, slowest = np.array(floor["peak"][gait]), min(floor["approach"][gait].values())
        below = np.array(floor["floor"]) < slowest
        assert np.ptp(peaks[below]) == 0
        assert np.all(np.diff(peaks) <= 0)
        assert peaks[-1] < peaks[0]


def test_factors_and_delivered_restitutions_are_the_simulators(section):
    for law, sweep in entries(section):
        for cr, chi, e in zip(sweep["nominal"], sweep["chi"], sweep["delivered"], strict=True):
            assert chi == FACTORS[law](cr)
            assert e == restitution_of_factor(chi)


def test_the_section_is_json_and_draws_all_figures_that_it_shows(section):
    pytest.importorskip("matplotlib")
    json.dumps(section.data, allow_nan=False)
    assert set(re.findall(r"\]\((\w+)\.png\)", section.markdown)) == section.figures.keys()
    for draw in section.figures.values():
        assert draw().axes
    assert "nan" not in section.markdown


def test_damping_strong_enough_raises_the_free_peak_too(section):
    base = section.data["exponents"][section.data["exponent"]]
    curve = base["laws"]["exact"]
    e = hardest_free(curve)
    for delivered, peak in zip(curve["delivered"], curve["free_peak"], strict=True):
        if abs(delivered - e) > 0.05 and delivered < 1:
            assert (peak > 1) == (delivered < e)
    assert f"above 1 below e = {e:.2f}" in section.markdown
    assert hardest_free({"delivered": [0.5, 1.0], "free_peak": [0.9, 1.0]}) is None

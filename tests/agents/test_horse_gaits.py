"""The search for reference gaits: its box, what it keeps, and that what comes with the package is from it."""

from __future__ import annotations

import json

import numpy as np
import pytest
from foreign import CUT, FOREIGN

from agents import horse_gaits
from agents.horse_gaits import BatchRollout, Search, decode, encode, landings, shipped, slip_at, speed_of
from agents.rules import MAX_SLIP
from hoof_env.errors import DataFileError
from hoof_env.tasks.horse_gaits import FASTEST, HorseGait, bounds, crank_angles, reference_gaits
from hoof_env.tasks.horse_gaits import horse_gaits as gaits_of_the_package


def test_every_point_of_the_box_is_a_gait_and_the_way_back_is_the_same():
    points = np.random.default_rng(0).uniform(-1, 1, (50, 16))
    gaits = decode(points)
    for gait in gaits:
        assert (HorseGait.from_array(gait).to_array() == gait).all()
    np.testing.assert_allclose(encode(gaits), points, atol=1e-12)


def test_a_search_ends_where_gaits_do(monkeypatch):
    """A wider box than gaits may have is cut off at their bounds, not at the search's own."""
    monkeypatch.setattr(horse_gaits, "RATE", (0.01, 100.0))
    np.testing.assert_array_equal(decode(np.array([[-1.0] * 16, [1.0] * 16]))[:, 0], bounds()[:, 0])
    for bound in bounds():
        assert (HorseGait.from_array(bound).to_array() == bound).all()
    assert bounds()[1, 0] == FASTEST


def test_speeds_are_those_of_their_froude_numbers():
    assert speed_of(0.25) == pytest.approx(1.853, abs=1e-3)


def test_the_same_gait_has_the_same_return_in_every_row():
    gait = reference_gaits(np.array([1.85]))
    returns, figures, lags = BatchRollout(1.85, 8, episode_seconds=0.5).play(
        np.tile(gait, (8, 1)), 3, starts=4
    )
    assert (lags[:4] == lags[4:]).all()
    assert (returns[:4] == returns[4:]).all()
    assert len(set(returns[:4])) == 4
    assert all(one["seconds"] <= 0.5 for one in figures)


@pytest.mark.parametrize("lag", [-0.2, 0.0, 0.07, 0.24])
def test_the_lag_is_the_time_from_a_hind_hoof_s_landing_to_a_fore_hoof_s(lag):
    gaits, lands = reference_gaits(np.array([1.2, 1.85, 2.6])), np.array([0.1, 0.4, 0.9])
    fore, hind = (crank_angles(gaits, at, np.zeros((4, 3))) for at in (lands + lag, lands))
    found = np.angle(landings(gaits, np.array([*fore[:2], *hind[2:]]))) / (4 * np.pi)
    np.testing.assert_allclose(found, lag, atol=1e-12)


def test_a_search_goes_on_and_charges_the_lag(monkeypatch):
    asked, play = [], BatchRollout.play

    def played(self, gaits, seed, starts=horse_gaits.STARTS):
        returns, figures, lags = play(self, gaits, seed, starts)
        return returns, figures, np.full_like(lags, 0.1)

    given, begin = [], BatchRollout.__init__
    monkeypatch.setattr(BatchRollout, "__init__", lambda *args: (given.append(args[3]), begin(*args))[1])
    search = Search(1, reference_gaits(np.array([1.85]))[0], lag=1e6)
    tell = search.strategy.tell
    monkeypatch.setattr(BatchRollout, "play", played)
    monkeypatch.setattr(
        search.strategy, "tell", lambda points, costs: (asked.extend(costs), tell(points, costs))
    )
    found = search.run(1.85, 2, lambda speed, best: None)
    assert search.count == 2
    assert found["lag"] == 0.1
    np.testing.assert_allclose(asked, 1e5, rtol=0.01)
    Search(1, reference_gaits(np.array([1.85]))[0]).run(1.85, 0, lambda speed, best: None)
    assert given == [horse_gaits.TROT_WEIGHTS, horse_gaits.WEIGHTS]
    assert {"speed_m_s", "slip_m", "failed", "return"} <= set(found)


def test_what_is_shipped_goes_by_the_speed_that_a_gait_has(monkeypatch):
    monkeypatch.setattr(horse_gaits, "slip_at", lambda gait, speed: 0.2 if speed == 2.5 else 0.05)

    def step(speed, reached, slip=0.1, failed=0.0, lag=0.2):
        return {
            "speed": speed, "speed_m_s": reached, "failed": failed, "gait": [reached] * 16, "slip_m": slip,
            "return": 10.0 - speed, "lag": lag,
        }  # fmt: skip

    searches = {
        "free 0": {"steps": [step(1.85, 1.8)]},
        "free 1": {"steps": [step(1.9, 1.85, slip=0.01)]},
        "free, faster": {"steps": [step(2.5, 2.2), step(2.6, 2.19, 0.05), step(4.5, 4.0, failed=0.5)]},
        "free, slower": {"steps": [step(1.2, 1.2)]},
        "trot-like, faster": {
            "steps": [
                step(2.5, 2.4, lag=0.01),
                step(2.6, 2.5, lag=0.01),
                step(2.7, 2.6),
                step(3.9, 3.8, lag=0.01),
            ]
        },
    }
    found = shipped(searches)
    assert found["reference"]["speeds"] == [1.2, 1.8, 2.19]  # of two alike, the one that slips less
    assert found["gaits"]["fast"][0] == 3.8  # the faster one fell
    assert found["gaits"]["walk"][0] == 1.8
    assert found["gaits"]["trot-like"][0] == 2.4  # others slide, land apart or are faster than any command


@pytest.mark.parametrize(("name", "speed", "slides"), [("walk", 1.85, False), ("fast", 4.46, True)])
def test_the_slip_of_a_gait_is_that_of_its_hooves_at_its_speed(name, speed, slides):
    """Half of the summary's mean of all hooves to twice that, for it is of the pair that slides more."""
    gait = gaits_of_the_package()[name].to_array()
    slip = slip_at(gait.tolist(), speed)
    _, summaries, _ = BatchRollout(speed, 32, episode_seconds=10.0).play(np.tile(gait, (32, 1)), 0, starts=32)
    mean = np.mean([one["slip_m"] for one in summaries])
    assert mean < slip < 2.5 * mean
    assert (slip > MAX_SLIP) == slides


def test_a_gait_that_falls_has_no_slip_and_the_trot_like_one_little():
    gait = gaits_of_the_package()["trot-like"].to_array().tolist()
    assert slip_at(gait, 3.66) < MAX_SLIP
    assert slip_at(gait, 1.85) == np.inf  # falls from the start at another speed


def test_the_package_has_gaits_in_the_order_of_their_speeds():
    from hoof_env.tasks.horse_gaits import _data

    speeds = _data()["reference"]["speeds"]
    assert speeds == sorted(set(speeds))
    np.testing.assert_allclose(reference_gaits(np.array(speeds)), _data()["reference"]["gaits"], rtol=1e-12)
    assert {"walk", "fast", "trot-like"} <= set(gaits_of_the_package())


@pytest.mark.parametrize("content", [CUT, *FOREIGN, '{"searches": {"free 0": {"steps": [{"gait": [1.0]}]}}}'])
def test_other_files_are_refused_and_left_alone(content, tmp_path, monkeypatch):
    monkeypatch.setattr(horse_gaits.Finder, "family", lambda *_: pytest.fail("was searched"))
    out = tmp_path / "horse.json"
    out.write_text(content)
    with pytest.raises(DataFileError, match=r"horse\.json: expected searches of agents\.horse_gaits"):
        horse_gaits.main(["--out", str(out), "--shipped", str(tmp_path / "gaits.json")])
    assert out.read_text() == content


def test_the_file_is_gone_on_with(tmp_path, monkeypatch, capsys):
    out = tmp_path / "horse.json"
    monkeypatch.setattr(horse_gaits, "MOST", 1)
    shipped = tmp_path / "gaits.json"
    arguments = ["--out", str(out), "--generations", "1", "--each", "1", "--restarts", "1"]
    arguments += ["--shipped", str(shipped)]
    horse_gaits.main(arguments)
    first = json.loads(out.read_text())
    assert {"free 0", "free, faster", "free, slower", "trot-like 0"} <= set(first["searches"])
    written = capsys.readouterr().out
    horse_gaits.main(arguments)
    assert capsys.readouterr().out == f"written: {shipped}\n"
    assert json.loads(out.read_text()) == first
    reference = json.loads(shipped.read_text())["reference"]
    assert len(reference["speeds"]) == len(reference["gaits"]) == len(reference["trunk"])
    assert written.count("\n") >= 4

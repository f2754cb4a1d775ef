"""The search for kinematic gaits: what it asks for, what it measures, and what it finds."""

import json

import numpy as np
import pytest
from foreign import CUT, FOREIGN

from agents import gait_box, gait_costs, gait_rig, start_phases
from agents import kinematic_gaits as search
from agents.gait_figures import play
from agents.horse_gaits import speed_of
from agents.judges import searched_bars
from hoof_env.envs.policies import make_policy
from hoof_env.errors import DataFileError, HoofEnvError, ParameterError
from hoof_env.evaluation.episodes import make_rows
from hoof_env.tasks.horse_gaits import bounds, horse_gaits, kinematic_speeds

TURN = np.arange(gait_rig.BINS) / gait_rig.BINS


def curve(*peaks, width=0.08):
    """Force over a turn with peaks (place, height)."""
    return sum(high * np.exp(-(((TURN - at) / width) ** 2)) for at, high in peaks)


def test_points_of_the_box_are_gaits_that_a_horse_takes():
    points = np.random.default_rng(0).uniform(-1, 1, (50, 16))
    gaits = gait_box.decode(points)
    low, high = bounds()
    assert ((gaits >= low) & (gaits <= high)).all()
    np.testing.assert_allclose(gait_box.encode(gaits), points, atol=1e-12)


@pytest.mark.parametrize("kind", ["walk", "trot"])
@pytest.mark.parametrize("stride", gait_box.STRIDES)
def test_a_search_begins_with_the_stride_that_is_asked_for(kind, stride):
    """A crank turns once a stride: hooves that do not slip move by one stride in that time."""
    speed = speed_of(0.25)
    gaits = gait_box.first_gaits(kind, speed, stride)
    np.testing.assert_allclose(speed * 2 * np.pi / gaits[:, 0] / 1.4, stride)
    assert len(np.unique(gaits[:, 1])) == len(gait_box.LEADS)


def test_a_dip_is_as_deep_as_between_two_peaks():
    one = curve((0.5, 1.0), width=0.15)
    two = curve((0.4, 1.0), (0.65, 0.8))
    shoulder = curve((0.5, 1.0), (0.55, 0.3), width=0.15)
    found = gait_rig.dips(np.stack([one, two, shoulder, np.roll(two, 17)], 1))
    assert found[0] == found[2] == 0.0
    between = two[(TURN > 0.4) & (TURN < 0.65)].min()
    assert found[1] == pytest.approx((two[TURN > 0.55].max() - between) / two.max())
    assert found[3] == pytest.approx(found[1])


def test_a_lag_of_nearly_half_a_stride_is_as_near_to_a_trot_as_one_of_nearly_none():
    lags = np.array([0.01, 0.49, 0.25, 0.06, 0.44])
    apart = gait_costs.distance(lags, -0.05, 0.05, 0.02, is_lag=True)
    assert apart[0] == apart[1] == 0.0
    assert apart[2] == max(apart)
    assert apart[3] == pytest.approx(apart[4])


def test_a_figure_costs_nothing_within_its_bar_and_one_for_each_scale_beyond():
    values = np.array([0.62, 0.58, 0.56, 0.9])
    apart = gait_costs.distance(values, 0.58, 1.0, 0.02, is_lag=False)
    assert apart[0] == apart[3] == 0.0
    assert apart[2] - apart[1] == pytest.approx(1.0)
    nearest = gait_costs.distance(np.array([1.0]), 0.0, 0.09, 0.02, is_lag=False)
    assert nearest[0] > 40


def figures_of(gaits, speed, starts):
    return gait_rig.Rig(len(gaits) * starts).play(np.array(gaits), speed, 0, starts)


def test_the_rig_measures_what_the_judges_measure():
    """By other means: 20 ms apart and over a turn of the crank instead of at every substep."""
    envs = make_rows("hoof_env/Horse-v0", 16)
    zero = make_policy("reference", envs)
    for name, speed in (("walk", speed_of(0.25)), ("trot-like", 3.6)):
        gait = horse_gaits()[name].to_array()
        found = figures_of([gait, gait], speed, 8)
        judged = play(envs, zero, speed, gait)
        for pair in ("fore", "hind"):
            assert found[f"duty_{pair}"][0] == pytest.approx(judged[f"duty_{pair}"], abs=0.02)
            assert found[f"slip_{pair}"][0] == pytest.approx(judged[f"slip_{pair}"], abs=0.02)
        assert (found["lag"][0] - judged["lag"] + 0.25) % 0.5 - 0.25 == pytest.approx(0, abs=0.01)
        assert found["stride_over_hip"][0] == pytest.approx(judged["stride_over_hip"], rel=0.02)
        assert found["transport"][0] == pytest.approx(judged["transport"], rel=0.03)
        assert found["reached"][0] == pytest.approx(judged["reached"], rel=0.02)


def test_gaits_do_not_share_their_figures():
    walk, fast = (horse_gaits()[name].to_array() for name in ("walk", "fast"))
    both = figures_of([walk, fast], 1.85, 2)
    alone = figures_of([fast], 1.85, 2)
    for name, values in both.items():
        assert values[1] == pytest.approx(alone[name][0], nan_ok=True), name


def test_a_gait_that_falls_costs_more_than_any_that_stands():
    walk = horse_gaits()["walk"].to_array()
    still = walk.copy()
    still[[4, 11]] = 0.3, 1.7  # legs that lie back
    figures = figures_of([walk, still], 1.85, 2)
    assert figures["fell"].tolist() == [0.0, 1.0]
    bars = gait_costs.peaked(searched_bars("walk", 0.2))
    costs = gait_costs.costs_of(figures, bars)
    assert np.isfinite(costs).all()
    assert costs[1] > costs[0] + gait_costs.FALL


def test_the_command_finds_a_gait_and_goes_on_where_it_stopped(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(search, "STRIDES", (1.6,))
    monkeypatch.setattr(gait_rig, "SECONDS", 3.0)
    monkeypatch.setattr(start_phases, "DROPPED", 8)
    out, shipped = tmp_path / "found.json", tmp_path / "shipped.json"
    argv = ["--gaits", "walk", "--froude", "0.2", "--first", "2", "--more", "1", "--out", str(out)]
    search.main([*argv, "--shipped", str(shipped)])
    found = json.loads(out.read_text())["searches"]
    assert list(found) == [
        "walk at 0.2 by force, seed 0, stride 1.6", "walk at 0.2 by force, seed 0, best"
    ]  # fmt: skip
    (one,) = json.loads(shipped.read_text()).values()
    best = found["walk at 0.2 by force, seed 0, best"]["gait"]
    assert (one["gait"][0], one["gait"][2:]) == (best[0], best[2:])
    assert 2 * (one["gait"][1] - best[1]) == pytest.approx(round(2 * (one["gait"][1] - best[1])))
    assert "has 0 of 2 searches\n2 searches to do" in capsys.readouterr().out
    before = out.read_text()
    search.main([*argv, "--shipped", str(shipped)])
    assert "has 2 of 2 searches\n" in capsys.readouterr().out
    assert out.read_text() == before
    search.main([*argv, "--begin", str(shipped), "--shipped", str(tmp_path / "again.json")])
    assert list(json.loads(out.read_text())["searches"])[2:] == [
        "walk at 0.2 by force, seed 0, from shipped.json"
    ]
    with pytest.raises(ParameterError, match=r"kinematic-walk"):
        search.main(["--gaits", "trot", "--froude", "1", "--begin", str(shipped), "--out", str(out)])
    capsys.readouterr()


@pytest.mark.parametrize(
    "content", [CUT, *FOREIGN[:-1], '{"searches": {"walk": {"gait": [0.0]}}}', FOREIGN[-1]]
)
@pytest.mark.parametrize("option", ["--out", "--begin"])
def test_other_files_are_refused_and_left_alone(content, option, tmp_path, monkeypatch):
    monkeypatch.setattr(search, "find", lambda *_: pytest.fail("was searched"))
    path = tmp_path / "kept.json"
    path.write_text(content)
    shipped = tmp_path / "shipped.json"
    with pytest.raises(
        DataFileError, match=r"kept\.json: expected (searches|gaits) (of|as) agents\.kinematic"
    ):
        search.main([option, str(path), "--shipped", str(shipped)])
    assert path.read_text() == content
    assert not shipped.exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--gaits", "walk"], "--froude: expected 1 Froude numbers, one for each of walk, got 2"),
        (["--gaits", "walk", "canter"], "--gaits: expected one of trot, walk, got 'canter'"),
        (["--criterion", "speed"], "--criterion: expected one of force, "),
        (["--froude", "0", "1"], "--froude: expected .* 0"),
        (["--first", "0"], "--first: expected a whole number, 1 or more, got 0"),
    ],
)
def test_what_no_search_can_take_is_refused_before_the_first(words, message, tmp_path, monkeypatch):
    monkeypatch.setattr(search, "find", lambda *_: pytest.fail("was searched"))
    with pytest.raises(ParameterError, match=message):
        search.main([*words, "--out", str(tmp_path / "a.json"), "--shipped", str(tmp_path / "b.json")])


def test_a_start_is_in_the_middle_of_the_phases_from_which_none_falls(monkeypatch):
    class Horses:
        """Fall at phases from 0.1 to 0.3 strides."""

        dt = 0.7
        phase = 0.0

        def reset(self, seed, options):
            self.phase = options["phase"]

        def step(self, actions):
            return None, None, np.full(len(actions), 0.09 < self.phase < 0.31)

    monkeypatch.setattr(start_phases, "make_rows", lambda *_, **__: Horses())
    # Free are 0.325 to 0.475 and 0 to 0.075
    assert start_phases.phase_of(np.zeros(16), 3.6) == pytest.approx(0.45)
    monkeypatch.setattr(Horses, "step", lambda self, actions: (None, None, np.zeros(len(actions), bool)))
    assert start_phases.phase_of(np.zeros(16), 3.6) is None
    monkeypatch.setattr(Horses, "step", lambda self, actions: (None, None, np.ones(len(actions), bool)))
    with pytest.raises(HoofEnvError, match=r"3\.60 m/s: expected a phase"):
        start_phases.phase_of(np.zeros(16), 3.6)


@pytest.mark.parametrize("name", kinematic_speeds())
def test_gaits_that_ship_have_what_they_were_searched_with(name):
    """And what figures need to count; `docs/evidence/horse_gaits.md` has 1,000 starts."""
    envs = make_rows("hoof_env/Horse-v0", 32)
    speed = kinematic_speeds()[name]
    found = play(envs, make_policy(name, envs), speed, horse_gaits()[name].to_array())
    assert found["fell"] == 0.0
    for pair in ("fore", "hind"):
        assert found[f"slip_{pair}"] < 0.10
        assert 0.95 <= found[f"stances_per_turn_{pair}"] <= 1.05
    for figure, bars in searched_bars(name.removeprefix("kinematic-"), found["froude_reached"]).items():
        ours = found[figure]
        if figure == "lag":
            middle = sum(bars[0]) / 2
            ours = middle + (ours - middle + 0.25) % 0.5 - 0.25
        assert any(low <= ours <= high for low, high in bars), (figure, ours)

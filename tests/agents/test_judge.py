"""The judges' command: what it measures on forces that are known, and what it writes."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest

from agents import judge, judge_pictures, judges
from agents.gait_figures import WATCHED, Stance, forces_of, lag_of, play, stances_of, watch
from agents.judges import read_judges
from hoof_env.dynamics.layout import Features, stride_sums
from hoof_env.dynamics.memory import LIFT_OFF
from hoof_env.evaluation.episodes import make_rows
from hoof_env.tasks.horse_gaits import reference_gaits

TIME = np.arange(0.0, 6.0, 1e-3)
PUSHES = np.zeros((len(TIME), 4))


def forces(lag, duty=0.5, stride=0.8):
    """Of four legs with stances like half sines, fore hooves `lag` strides after the hind ones."""
    phases = [lag, lag + 0.5, 0.0, 0.5]
    parts = [(TIME / stride - phase) % 1.0 for phase in phases]
    return np.array([np.where(part < duty, 1e3 * np.sin(np.pi * part / duty), 0.0) for part in parts]).T


@pytest.mark.parametrize("lag", [0.0, 0.05, 0.17, 0.25, 0.4, 0.49])
def test_the_lag_is_that_of_the_footfall(lag):
    found = lag_of(stances_of(TIME, forces(lag), PUSHES, 50.0), 0.8)
    assert min((found - lag) % 0.5, (lag - found) % 0.5) < 0.005


def test_lags_of_a_trot_do_not_average_to_a_walk():
    """Just before and just after the hind hoof are both a trot."""
    found = [lag_of(stances_of(TIME, forces(lag), PUSHES, 50.0), 0.8) for lag in (0.01, 0.49)]
    assert all(min(one, 0.5 - one) < 0.02 for one in found)


def test_stances_are_whole_and_last_as_long_as_they_do():
    found = stances_of(TIME, forces(0.25, duty=0.4), PUSHES, 1.0)
    lasted = [one.ended - one.began for one in found]
    assert np.allclose(lasted, 0.4 * 0.8, atol=0.003)
    assert {one.leg for one in found} == {0, 1, 2, 3}


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        (lambda x: np.sin(np.pi * x), False),
        (lambda x: np.sin(np.pi * x) + 0.6 * np.sin(3 * np.pi * x), True),
        (lambda x: np.sin(np.pi * x) * (1 + 0.02 * np.sin(40 * np.pi * x)), False),
        (lambda x: np.where(x < 0.2, x, 0.2 + 0.5 * (x - 0.2)) * (x < 0.95), False),
        (lambda x: np.sin(np.pi * x) + 0.17 * np.sin(3 * np.pi * x), False),
        (lambda x: np.abs(np.sin(3 * np.pi * x)), False),
        (lambda x: 0.6 + 0.4 * np.cos(3 * np.pi * x), False),
    ],
    ids=[
        "half sine",
        "two peaks",
        "noise",
        "ramp",
        "a shallow dip",
        "three peaks",
        "one peak and one cut off",
    ],
)
def test_two_peaks_are_two_peaks(shape, expected):
    x = np.linspace(0, 1, 400)
    assert Stance(0, 0.0, 0.4, 1e3 * np.maximum(shape(x), 0), 0 * x).is_two_peaked is expected


def test_the_peaks_of_braking_and_propulsion_are_those_of_a_stance():
    stance = Stance(0, 0.0, 0.4, np.ones(3), np.array([-30.0, 10.0, 50.0]))
    assert (stance.peak_braking, stance.peak_propulsion) == (30.0, 50.0)
    forward = Stance(0, 0.0, 0.4, np.ones(2), np.array([20.0, 50.0]))
    assert forward.peak_braking == 0.0


def figures(**changes):
    """As `play` gives them, of a horse that is one."""
    one = {"speed": 1.85, "froude": 0.25, "froude_reached": 0.25, "fell": 0.0, "lag": 0.25}
    one |= {"two_peaked_fore": 1.0, "two_peaked_hind": 1.0, "stride_over_hip": 1.3}
    one |= {"duty_fore": 0.62, "duty_hind": 0.62, "peak_fore": 6.2, "peak_hind": 4.8}
    one |= {"slip_fore": 0.01, "slip_hind": 0.01, "stances_per_turn_fore": 1.0, "stances_per_turn_hind": 1.0}
    return {**one, "reached": one["speed"], **changes}


TROT = figures(
    speed=3.7, reached=3.7, froude=1.0, froude_reached=1.0, lag=0.49,
    duty_fore=0.39, duty_hind=0.38, peak_fore=11.5, peak_hind=10.0, two_peaked_fore=0.0, two_peaked_hind=0.0,
    stride_over_hip=1.66, net_fore=-0.1, net_hind=0.1,
)  # fmt: skip


def verdicts_of(*some):
    return {row[0]: row[5] for row in judge.verdicts([*some])}


def test_a_horse_meets_the_judges():
    rows = judge.verdicts([figures(), TROT])
    elsewhere = ("trot-like at 0.5: ", "trot-like at 0.75: ")  # where there is none
    assert {row[5] for row in rows if row[3] != "none" and not row[0].startswith(elsewhere)} == {"met"}
    reported = verdicts_of(figures(), {**TROT, "impulse_fore": 0.627})
    assert reported["impulse_fore"] == "off by +10%"
    assert reported["walk_to_trot"] == "off by +186%"  # the first gait that is trot-like, at 1 for 0.35
    assert verdicts_of(figures(peak_fore=9.0))["walk: peak_fore"] == "missed by +21%"
    assert judge.verdicts([{"speed": 1.0, "froude": 0.1, "fell": 1.0}]) == []


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"slip_hind": 0.12}, "hind hooves slip 0.12 m"),
        ({"stances_per_turn_hind": 1.2}, "1.20 hind stances a turn"),
        ({"stances_per_turn_hind": 0.9}, "0.90 hind stances a turn"),
    ],
)
def test_figures_of_hooves_that_slip_or_land_twice_do_not_count(changes, why):
    found = verdicts_of(figures(**changes))
    assert found["walk: lag"] == found["walk: peak_hind"] == f"does not count: {why}"
    assert found["walk: peak_fore"] == found["walk: duty_fore"] == found["walk: two_peaked_fore"] == "met"


def test_figures_of_a_policy_that_falls_or_does_not_keep_its_speed_do_not_count():
    falling = verdicts_of(figures(fell=0.97))
    assert falling["walk: lag"] == "does not count: fell in 97 % of episodes"
    assert falling["walk_to_trot"] == "there is no trot-like gait that counts"
    assert verdicts_of(figures(fell=0.1))["walk: lag"] == "met"
    late = verdicts_of(figures(speed=2.2))
    assert late["walk: peak_fore"] == "does not count: 0.84 of the commanded speed"
    assert verdicts_of(figures(speed=2.1))["walk: peak_fore"] == "met"


def test_a_gait_is_judged_at_the_speed_that_it_has():
    fast = judge.verdicts([TROT])
    assert {row[5] for row in fast if row[0].startswith("walk: ")} == {
        "does not count: no gait is near Froude number 0.25"
    }
    quicker = figures(froude=0.25, froude_reached=0.36, lag=0.1)  # nearer to the horse than its command says
    slower = figures(froude=0.2, froude_reached=0.24)
    rows = judge.verdicts([quicker, slower])
    assert rows[0][:2] == ("walk: lag", "0.24")
    assert rows[0][5] == "met"
    late = {**TROT, "froude_reached": 0.82, "reached": 3.35}
    assert {row[0]: row[1] for row in judge.verdicts([late])}["trot-like: peak_fore [N/kg]"] == "0.82"
    found = verdicts_of(late)
    assert found["trot-like: peak_fore [N/kg]"] == "met"  # nearest to 1 of what there is
    assert found["trot-like at 1.0: duty_fore"].startswith("does not count: no trot-like gait is near")
    assert found["trot-like at 0.75: duty_fore"] == "met"  # a horse's 0.38 or 0.44 there


def test_a_trot_is_looked_for_where_horses_trot():
    shuffle = figures(froude=0.1, froude_reached=0.1, lag=0.01, peak_fore=11.6)
    found = verdicts_of(shuffle)
    why = "there is no trot-like gait from Froude number 0.35 on"
    assert found["trot-like: peak_fore [N/kg]"] == why
    assert verdicts_of(figures())["trot-like at 0.5: duty_fore"] == "there is no trot-like gait"
    assert found["walk_to_trot"] == "no slower gait was played, from which it would change"
    slower = figures(froude=0.05, froude_reached=0.05)
    assert verdicts_of(slower, shuffle)["walk_to_trot"] == "off by -71%"


def test_what_was_not_measured_has_no_verdict():
    row = next(
        row for row in judge.verdicts([figures(two_peaked_fore=float("nan"))]) if "two_peaked" in row[0]
    )
    assert row[4:6] == ("-", "not measured")


def test_the_distance_of_a_figure_without_a_bar_has_its_conditions_too():
    found = verdicts_of({**TROT, "peak_braking_fore": 2.26, "slip_fore": 0.2})
    assert found["peak_braking_fore"] == "off by +100%, does not count: fore hooves slip 0.20 m"


def test_what_a_gait_was_searched_with_does_not_count_as_met():
    """Of the kinematic family; of any other the same rows judge."""
    walk, trot = figures(searched=True, duty_fore=0.5), {**TROT, "searched": True}
    rows = {row[0]: row[5] for row in judge.verdicts([walk, trot])}
    searched = {name for name, verdict in rows.items() if verdict.startswith("searched")}
    judges = read_judges()
    marked = {
        f"{title}: {name}"
        for kind, title in (("walk", "walk"), ("trot", "trot-like"))
        for name, one in judges[kind].items()
        if isinstance(one, dict) and one.get("searched") and name != "duty"
    }
    of_speed = {f"trot-like at 1.0: {name}" for name in ("duty_fore", "duty_hind", "stride_over_hip")}
    duties = {"walk: duty_fore", "walk: duty_hind"}
    assert searched == marked | of_speed | duties
    assert rows["walk: duty_fore"] == "searched, outside"
    assert rows["walk: duty_hind"] == "searched, inside"
    assert rows["walk: peak_fore"] == rows["trot-like: peak_hind [N/kg]"] == "met"
    assert "searched" not in " ".join(verdicts_of(figures(), TROT).values())


def test_no_search_is_given_a_force_of_a_horse():
    """Searches know a horse's kinematics; its peaks, impulses and loading judge what they find."""
    given = {name for kind in ("walk", "trot") for name in judges.searched_bars(kind, 0.5)}
    assert given == {
        "lag", "duty_fore", "duty_hind", "two_peaked_fore", "two_peaked_hind", "stride_over_hip"
    }  # fmt: skip


def test_a_trot_is_judged_by_both_sources_of_its_fore_peak():
    found = verdicts_of(TROT)
    assert found["trot-like: peak_fore [N/kg]"] == found["trot-like: peak_fore_2 [N/kg]"] == "met"
    found = verdicts_of({**TROT, "peak_fore": 9.9})  # 10.73 less 0.7 of its deviation
    assert found["trot-like: peak_fore [N/kg]"] == "missed by -5%"
    assert found["trot-like: peak_fore_2 [N/kg]"] == "met"


def test_foals_have_the_froude_number_that_was_reached():
    (row,) = [row for row in judge.verdicts([figures()]) if row[0] == "foals, walk: peak_fore [N/kg]"]
    assert row[2] == "6.72"  # 5.49 + 4.91 / 4
    assert row[5] == "off by -8%"


def test_pairs_that_pull_towards_each_other_miss_the_signs_of_a_trot():
    found = verdicts_of({**TROT, "net_fore": 1.2, "net_hind": -1.2})
    assert found["trot-like: net_fore [N/kg]"].startswith("missed")
    assert found["trot-like: net_hind [N/kg]"].startswith("missed")


def test_every_figure_of_a_horse_has_a_source_that_was_read():
    judges = read_judges()
    groups = [judges["walk"], judges["trot"], judges["reported"]]
    sources = [one["source"] for group in groups for one in group.values() if isinstance(one, dict)]
    assert len(sources) == sum(isinstance(one, dict) for group in groups for one in group.values())
    assert not [source for source in [*sources, judges["duty"]["source"]] if "memory" in source]
    bars = {name: judges["walk"][name]["bar"] for name in ("lag", "peak_fore", "peak_hind")}
    assert bars == {"lag": [0.2, 0.3], "peak_fore": [4.96, 7.44], "peak_hind": [3.84, 5.76]}  # as required
    assert [name for name in judges["reported"] if "braking" in name or "propulsion" in name] == [
        f"peak_{name}_{pair}" for pair in ("fore", "hind") for name in ("braking", "propulsion")
    ]


def test_of_all_policies_there_are_means_and_intervals():
    base = dict.fromkeys(judge.SHOWN, 0.5)
    each = [
        [figures(**{**base, "lag": lag, "duty_fore": duty, "two_peaked_fore": float("nan")})]
        for lag, duty in ((0.01, 0.6), (0.49, 0.64))
    ]
    (one,) = judge.pool([*each, [{"speed": 1.85, "froude": 0.25, "fell": 1.0}]])
    assert min(one["lag"], 0.5 - one["lag"]) < 1e-9  # between just before and just after, not a quarter
    assert one["duty_fore"] == pytest.approx(0.62)
    assert one["fell"] == pytest.approx((0.5 + 0.5 + 1.0) / 3)
    assert "two_peaked_fore" not in one  # of nobody's
    assert "0.620 [" in judge.table_of("all", [one])


def test_only_the_forces_of_one_policy_are_titled_with_its_duty_factors():
    curves = {"fore": [0.0] * 101, "hind": [0.0] * 101}
    one = {"speed": 1.85, "froude": 0.25, "duty_fore": 0.46, "duty_hind": 0.5, "curves": curves}
    for names, title in (("a", "Fr 0.25\nduty 0.46, 0.50"), ("ab", "Fr 0.25")):
        picture = judge_pictures.forces({name: [one] for name in names}, [one])
        assert picture.axes[0].get_title() == title


def letters_of(picture):
    """Sizes of all texts that are seen [pixels]."""
    picture.draw_without_rendering()
    texts = picture.findobj(lambda one: hasattr(one, "get_fontsize") and one.get_text().strip())
    return [one.get_fontsize() * picture.dpi / 72 for one in texts if one.get_visible()]


@pytest.mark.parametrize("count", [1, 2, 5])
def test_letters_of_pictures_are_large_enough_for_a_front_page(count):
    """12 pixels where the picture is shown 800 pixels wide."""
    flat = {"fore": [0.0] * 101, "hind": [0.0] * 101}
    shown = [
        {**one, "curves": flat, "pushes": flat, "footfall": [[0, 0.0, 0.3]], "transport": 1.0}
        for one in (figures(), TROT, *[figures()] * 3)[:count]
    ]
    for picture in (
        judge_pictures.forces({"a": shown}, shown),
        judge_pictures.footfall(shown),
        judge_pictures.speeds({"a": shown}),
    ):
        assert picture.get_figwidth() * picture.dpi == pytest.approx(800)
        assert min(letters_of(picture)) >= 12 - 1e-9


def test_peaks_of_horses_are_drawn_beside_a_walk_and_a_trot():
    flat = {"fore": [0.0] * 101, "hind": [0.0] * 101}
    shown = [{**one, "curves": flat, "pushes": flat} for one in (figures(), TROT)]
    picture = judge_pictures.forces({"a": shown}, shown)
    up, trot_up, _, trot_forward = picture.axes
    bands = [[patch.get_y(), patch.get_y() + patch.get_height()] for patch in up.patches]
    np.testing.assert_allclose(bands, [[4.96, 7.44], [3.84, 5.76]])
    assert len(trot_up.patches) == 3  # two sources of the fore peak, one of the hind one
    lines = sorted(line.get_ydata()[0] for line in trot_forward.lines if line.get_linestyle() == "--")
    assert lines == [-1.13, -0.79, 0.84, 1.17]


def test_the_command_writes_figures_a_table_and_pictures(tmp_path, capsys):
    judge.main(["reference", "--froude", "0.25", "--episodes", "3", "--out", str(tmp_path)])
    (one,) = json.loads((tmp_path / "figures.json").read_text())["figures"]["reference"]
    assert one["fell"] == 0.0
    assert one["reached"] == pytest.approx(1.853, rel=0.1)
    assert len(one["curves"]["fore"]) == 101
    share = one["mean_fore"] * one["duty_fore"] + one["mean_hind"] * one["duty_hind"]
    assert 2 * share == pytest.approx(9.81, rel=0.02)  # in the mean the legs bear the weight
    assert "| walk: lag |" in (tmp_path / "table.md").read_text()
    braking, propulsion = (
        sum(one[f"mean_{name}_{pair}"] * one[f"duty_{pair}"] for pair in ("fore", "hind"))
        for name in ("braking", "propulsion")
    )
    assert braking == pytest.approx(propulsion, rel=0.1)  # for the speed stays
    for name in ("braking_fore", "propulsion_fore", "braking_hind", "propulsion_hind"):
        assert one[f"peak_{name}"] > 1.2 * one[f"mean_{name}"]
    rate = reference_gaits(np.array([one["speed"]]))[0, 0]
    assert one["stride_over_hip"] == pytest.approx(2 * np.pi * one["reached"] / rate / 1.4, rel=0.03)
    assert {leg for leg, _, _ in one["footfall"]} == {0, 1, 2, 3}
    on_the_ground = sum(ended - began for _, began, ended in one["footfall"])
    duty = 2 * (one["duty_fore"] + one["duty_hind"])  # of all legs; two strides, but for stances cut off
    assert 0.5 * duty < on_the_ground / max(ended for *_, ended in one["footfall"]) <= 1.1 * duty
    assert (tmp_path / "forces.png").stat().st_size > 5000
    assert (tmp_path / "footfall.png").stat().st_size > 5000
    assert (tmp_path / "speeds.png").stat().st_size > 5000
    capsys.readouterr()


def test_a_policy_that_stands_nowhere_has_a_table_and_no_pictures(tmp_path, capsys):
    judge.main(["reference", "--froude", "9", "--episodes", "2", "--out", str(tmp_path)])
    assert "no pictures: the first policy falls at every speed" in capsys.readouterr().out
    (one,) = json.loads((tmp_path / "figures.json").read_text())["figures"]["reference"]
    assert one["fell"] == 1.0
    assert "| fell | 1 |" in (tmp_path / "table.md").read_text()
    assert not list(tmp_path.glob("*.png"))


# What is measured, on an animal whose every number is known


DT, KILOGRAMS, SPEED = 0.02, 400.0, 2.0
SUBSTEPS = 20
WEIGHT = KILOGRAMS * 9.81


class Toy:
    """Horses that travel at `SPEED` and turn their cranks once in 0.8 s, in as far as `play` looks at them.
    Fore hooves differ from hind ones, and every sum from every other."""

    dt = DT
    settings = SimpleNamespace(hoof_stiffness=1.0)
    body = SimpleNamespace(harmonics=2, height=1.4)
    unwrapped = property(lambda self: self)
    names = stride_sums(Features(2, True, True))
    legs = ("left_fore", "right_fore", "left_hind", "right_hind")

    def __init__(self, num_envs, fallen=()):
        self.num_envs, self.fallen, self.weight = num_envs, fallen, np.full(num_envs, WEIGHT)

    def reset(self, seed, options):
        self.k = 0
        return np.zeros((self.num_envs, 1)), {}

    def step(self, actions):
        self.k += 1
        one = np.ones(self.num_envs)
        measured = {"x": SPEED * DT * self.k * one}
        for leg, name in enumerate(self.legs):
            measured[f"{name}_crank_angle"] = 2 * np.pi / 0.8 * DT * self.k * one
            for place, of in enumerate(self.names):
                measured[f"{name}_{of}"] = self.sum_of(place, leg // 2) * one
        failed = np.isin(np.arange(self.num_envs), self.fallen)
        return np.zeros((self.num_envs, 1)), one, failed, ~failed, {"measured": measured}

    @staticmethod
    def sum_of(place, pair):
        """In each step."""
        return (1.0 + place) * (1.0 if pair == 0 else 0.6)

    def record(self, env):
        """Half of each 0.8 s in stance; between, a hoof bears a little less than what counts as load."""
        time = ((self.k - 1) * SUBSTEPS + np.arange(1, SUBSTEPS + 1)) * DT / SUBSTEPS
        phase = (time / 0.8)[:, None] + np.array([0.25, 0.75, 0.0, 0.5])
        part = phase % 1.0 / 0.5
        stance = part < 1
        normal = np.where(stance, 2e3 * np.sin(np.pi * part), 0.0) + 0.9 * LIFT_OFF * WEIGHT / 4
        size = np.array([1.0, 1.0, 2.0, 2.0]) * KILOGRAMS
        push = np.where(
            stance, np.where(part < 0.5, -0.3, 0.7) * np.abs(np.sin(2 * np.pi * part)) * size, 0.0
        )
        return {
            "time": time, "toe_normal": normal[..., None] / 4, "heel_normal": normal[..., None] * 3 / 4,
            "toe_friction": push[..., None] / 4, "heel_friction": push[..., None] * 3 / 4,
            "toe_deflection_normal": 1e-5 * normal[..., None],
            "heel_deflection_normal": 0 * normal[..., None],
        }  # fmt: skip


IDLE = SimpleNamespace(predict=lambda seen, **_: (np.zeros((len(seen), 16)), None))


def test_figures_are_of_the_steps_that_count():
    """Places and sums over the same steps: one more or less of either is a quarter of a per cent."""
    one = play(Toy(3), IDLE, SPEED)
    exactly = {"rel": 1e-9}
    assert one["reached"] == pytest.approx(SPEED, **exactly)
    assert one["froude_reached"] == pytest.approx(one["froude"], **exactly)
    assert one["stride_over_hip"] == pytest.approx(SPEED * 0.8 / 1.4, **exactly)
    of = {name: [Toy.sum_of(k, pair) for pair in (0, 1)] for k, name in enumerate(Toy.names)}
    for k, pair in enumerate(("fore", "hind")):
        loaded = of["loaded_time"][k]
        assert one[f"mean_braking_{pair}"] == pytest.approx(of["braking"][k] / loaded / KILOGRAMS, **exactly)
        assert one[f"mean_propulsion_{pair}"] == pytest.approx(
            of["propulsion"][k] / loaded / KILOGRAMS, **exactly
        )
        assert one[f"peak_{pair}"] == pytest.approx(
            of["peak_grf_increase"][k] / of["stances"][k] / KILOGRAMS, **exactly
        )
        assert one[f"duty_{pair}"] == pytest.approx(loaded / DT, **exactly)
        assert one[f"stances_per_turn_{pair}"] == pytest.approx(of["stances"][k] / DT * 0.8, **exactly)
        assert one[f"slip_{pair}"] == pytest.approx(of["slip"][k] / of["stances"][k], **exactly)
        rise = of["loading_rate_increase"][k] / of["stances"][k]
        assert one[f"loading_{pair}"] == pytest.approx(rise / KILOGRAMS, **exactly)
        both = 2 * (of["propulsion"][k] - of["braking"][k])
        assert one[f"net_{pair}"] == pytest.approx(both / DT / KILOGRAMS, **exactly)
    assert one["impulse_fore"] == pytest.approx(1 / 1.6, **exactly)
    work = 2 * sum(of["positive_work"]) / DT
    assert one["transport"] == pytest.approx(work / (WEIGHT * SPEED), **exactly)


def test_horizontal_forces_are_judged_by_their_peaks_in_a_stance():
    """Living horses' figures are peaks; the mean of a half sine is two thirds of one."""
    one = play(Toy(2), IDLE, SPEED)
    for pair, by in (("fore", 1.0), ("hind", 2.0)):
        assert one[f"peak_braking_{pair}"] == pytest.approx(0.3 * by, rel=1e-3)
        assert one[f"peak_propulsion_{pair}"] == pytest.approx(0.7 * by, rel=1e-3)
    assert one["lag"] == pytest.approx(0.25, abs=0.01)
    deepest = 1e-5 * (2e3 + 0.9 * LIFT_OFF * WEIGHT / 4)
    assert one["depth_fore"] == one["depth_hind"] == pytest.approx(deepest, rel=1e-3)
    assert len(one["footfall"]) >= 8  # with a higher load that counts, or a lower one, hooves never lift


def test_where_all_who_are_watched_fall_the_others_have_figures():
    one = play(Toy(WATCHED + 1, fallen=range(WATCHED)), IDLE, SPEED)
    assert one["fell"] == pytest.approx(WATCHED / (WATCHED + 1))
    assert np.isnan([one["lag"], one["two_peaked_fore"], one["peak_braking_fore"]]).all()
    assert one["reached"] == pytest.approx(SPEED)
    assert "fell in 88.9 % of episodes" in verdicts_of(one)["walk: duty_fore"]


def test_the_forces_that_are_watched_are_those_of_the_sums():
    """Signs, units and steps: the engine adds up the same forces at every substep."""
    envs = make_rows("hoof_env/Horse-v0", 1)
    assert envs is not None
    envs.reset(seed=[0])
    envs.record(0)  # from here on substeps are kept
    played = watch(envs, IDLE, 1.85)
    time, normal, push = forces_of(played.watched[0])
    h = np.diff(time).mean()
    assert len(time) * h == pytest.approx(played.seconds)
    for name, forces in (
        ("normal_impulse", normal), ("braking", np.maximum(-push, 0)), ("propulsion", np.maximum(push, 0)),
    ):  # fmt: skip
        np.testing.assert_allclose(h * forces.sum(0), played.sums[name][:, 0], rtol=1e-6)


def test_pictures_have_the_figures_of_the_judges(tmp_path, monkeypatch):
    other = read_judges()
    other["walk"] |= {"froude": 0.2, "duty": {"horse": 0.7}, "lag": {"horse": 0.21}}
    (tmp_path / "judges.json").write_text(json.dumps(other))
    monkeypatch.setattr(judges, "JUDGES", tmp_path / "judges.json")
    lag, duty, _ = judge_pictures.speeds({"one": [{**TROT, "transport": 1.0}]}).axes
    points = {(line.get_label(), *line.get_xydata()[0]) for panel in (lag, duty) for line in panel.lines}
    assert {("horses, walk", 0.2, 0.21), ("horses, walk", 0.2, 0.7)} <= points


def test_pooled_figures_of_a_searched_gait_do_not_count_as_met():
    walk = dict.fromkeys(judge.SHOWN, 1.0) | figures(searched=True)
    found = verdicts_of(*judge.pool([[walk], [walk]]))
    assert found["walk: lag"] == found["walk: duty_fore"] == "searched, inside"
    assert found["walk: peak_fore"] == "met"

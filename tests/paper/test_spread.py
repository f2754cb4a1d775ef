import dataclasses
import json
from itertools import combinations

import numpy as np
import pytest

from hoof_env.errors import DataFileError, HoofEnvError
from hoof_env.gait.parameters import load_gait
from hoof_env.ground.contact import Ground
from hoof_env.identify.ensemble import Ensemble, Member, load_ensemble, to_data, write_member
from hoof_env.leg.geometry import read_preset
from hoof_env.leg.linkage import LENGTHS
from hoof_env.paper import reproduce as reproduce_module
from hoof_env.paper.figure_spread import draw_spread
from hoof_env.paper.figure_style import PRINT, SOLVER
from hoof_env.paper.published import CONDITIONS
from hoof_env.paper.reproduce import GAITS, write_reproduction
from hoof_env.paper.spread import compare_pairs, measure_spread, summarise
from hoof_env.paper.spread_names import FOLLOWING, IDENTIFIED
from hoof_env.paper.spread_text import TITLE, markdown, with_spread

SCALES = (1.0, 1.01, 0.97)
"""Sizes of three similar legs; the first is the preset itself."""


def similar(geometry, scale, **changes):
    lengths = {name: scale * length for name, length in geometry.lengths.items()}
    pivot = tuple(scale * c for c in geometry.pivot)
    return geometry.replace(lengths=lengths, pivot=pivot, hip_height=scale * geometry.hip_height, **changes)


@pytest.fixture(scope="module")
def make(reproduction):
    """An ensemble of these legs under the preset's gaits."""
    preset = reproduction.geometry.name
    gaits = {gait: load_gait(gait, preset) for gait in GAITS}

    def make(*geometries, errors=(0.5, 0.75)):
        judged = dict(zip(("exact", "paper"), errors, strict=True))
        return Ensemble(
            preset,
            "made by hand",
            "walks",
            tuple(Member(g, gaits, judged, {}, reproduction.ground) for g in geometries),
        )

    return make


@pytest.fixture(scope="module")
def spread(reproduction, make):
    """Of three similar legs."""
    return measure_spread(make(*(similar(reproduction.geometry, scale) for scale in SCALES)))


def own_curve(reproduction, curves, column, gait, condition="elastic"):
    trace = reproduction.traces[gait, condition, SOLVER]
    return np.interp(curves.time, trace["t"], trace[column])


def test_a_summary_is_median_quartiles_and_range():
    expected = {"median": 3.0, "middle_half": [2.0, 4.0], "range": [1.0, 5.0], "relative": 4 / 3}
    assert summarise([5.0, 1.0, 4.0, 2.0, 3.0]) == expected
    assert summarise([5.0, 1.0], has_zero=False)["relative"] is None
    assert summarise([-1.0, 1.0])["relative"] is None


def test_pairs_are_compared_at_equal_times():
    rng = np.random.default_rng(3)
    curves = rng.normal(size=(5, 7)) + 1j * rng.normal(size=(5, 7))
    apart = [abs(a - b) for one, two in combinations(curves, 2) for a, b in zip(one, two, strict=True)]
    assert compare_pairs(curves) == pytest.approx((max(apart), np.sqrt(np.mean(np.square(apart)))))
    assert compare_pairs(curves[:1]) == (0.0, 0.0)


def test_the_first_similar_leg_is_the_reproduction(reproduction, spread):
    curves = spread.curves
    rows = {row["id"]: row["simulated"] for row in reproduction.rows if row["solver"] == SOLVER}
    for gait in GAITS:
        for condition in CONDITIONS:
            entry = spread.data["quantities"][f"{gait}.{condition}.peak"]
            assert entry["preset"] == pytest.approx(rows[f"{gait}.peak_{condition}"], rel=1e-12)
            for column, curve in (("normal", curves.normal), ("crank_torque", curves.crank_torque)):
                expected = own_curve(reproduction, curves, column, gait, condition)
                np.testing.assert_allclose(curve[gait, condition][0], expected, rtol=1e-9, atol=1e-9)
        sole = (own_curve(reproduction, curves, f"{name}_x", gait) for name in ("toe", "heel"))
        np.testing.assert_allclose(curves.path[gait][0].real, sum(sole) / 2, atol=1e-12)


def test_similar_legs_have_similar_lengths_and_paths(reproduction, spread):
    """Everything geometric is in proportion to the leg's size."""
    part = max(SCALES) - min(SCALES)
    quantities = spread.data["quantities"]
    sized = [
        key for key in (*IDENTIFIED, "mass") if key.startswith("length.") or key in ("hip_height", "mass")
    ]
    assert {key.removeprefix("length.") for key in sized} == {*LENGTHS, "OC", "hip_height", "mass"}
    for key in [*sized, *(f"{gait}.{name}" for gait in GAITS for name in ("step", "reach", "lift"))]:
        entry = quantities[key]
        assert entry["median"] == pytest.approx(entry["preset"], rel=1e-6), key
        assert entry["relative"] == pytest.approx(part, rel=1e-4), key
        assert entry["range"] == pytest.approx([entry["preset"] * s for s in (0.97, 1.01)], rel=1e-4), key
    for gait in GAITS:
        assert (
            quantities[f"{gait}.swing_sin"]["range"] == [load_gait(gait, spread.data["preset"]).swing_sin] * 2
        )
        sole = spread.curves.path[gait][0] + 1j * reproduction.geometry.hip_height
        start, end = (reproduction.published.row(f"{gait}.contact_{edge}").value for edge in ("start", "end"))
        stance = sole[(spread.curves.time >= start) & (spread.curves.time <= end)]
        gaps = np.sqrt(np.mean([(a - b) ** 2 for a, b in combinations(SCALES, 2)]))
        for name, path in (("", sole), ("_stance", stance), ("_stance_shape", stance - stance.real.mean())):
            found = spread.data["differences"][f"{gait}.path{name}"]
            assert found["largest"] == pytest.approx(part * np.abs(path).max(), rel=1e-6)
            assert found["rms"] == pytest.approx(gaps * np.sqrt(np.mean(np.abs(path) ** 2)), rel=1e-6)


def test_similar_legs_press_as_the_power_of_their_size(reproduction, spread):
    """K d**n without damping: the elastic force is in proportion to size**n, at equal times."""
    n = reproduction.ground.exponent
    quantities, normal = spread.data["quantities"], spread.curves.normal
    for gait in GAITS:
        curve = own_curve(reproduction, spread.curves, "normal", gait)
        for scale, member in zip(SCALES, normal[gait, "elastic"], strict=True):
            np.testing.assert_allclose(member, scale**n * curve, rtol=1e-6, atol=1e-6)
        for name in ("peak", "impulse"):
            entry = quantities[f"{gait}.elastic.{name}"]
            assert entry["range"] == pytest.approx([entry["preset"] * s**n for s in (0.97, 1.01)], rel=1e-6)
        assert np.ptp(quantities[f"{gait}.elastic.peak_time"]["range"]) < 1e-9
        found = spread.data["differences"][f"{gait}.elastic.normal"]
        mean = reproduction.published.row(f"{gait}.mean_elastic").value
        assert found["relative"] == pytest.approx(found["rms"] / mean)
        assert found["largest"] == pytest.approx((1.01**n - 0.97**n) * curve.max(), rel=1e-6)


def test_crank_torque_is_linear_in_the_masses_and_nothing_else_knows_them(reproduction, make):
    legs = [reproduction.geometry.replace(linear_density=density) for density in (1.0, 2.0, 3.0)]
    spread = measure_spread(make(*legs))
    for key, torque in spread.curves.crank_torque.items():
        np.testing.assert_allclose(torque[2] - torque[1], torque[1] - torque[0], atol=1e-6)
        assert np.abs(torque[1] - torque[0]).max() > 1
        entry = spread.data["quantities"][f"{'.'.join(key)}.crank_rms"]
        assert max(entry["range"]) == pytest.approx(
            max(np.sqrt(np.mean(torque[:, 1:] ** 2, axis=1))), rel=0.01
        )
        peaks = np.abs(torque).max(axis=1)
        largest = spread.data["quantities"][f"{'.'.join(key)}.crank_peak"]["range"]
        assert largest == pytest.approx([peaks.min(), peaks.max()], rel=0.02)
    for key, entry in spread.data["differences"].items():
        assert (entry["largest"] > 1) == ("crank" in key), key
    assert spread.data["linear_density"] == [1.0, 2.0, 3.0]


def test_data_is_plain_and_counts_what_members_share(reproduction, spread):
    data = json.loads(json.dumps(spread.data, allow_nan=False))
    assert data == spread.data
    assert (data["members"], data["bar"], data["short"]) == (3, {"exact": 0.5, "paper": 0.75}, 0)
    assert data["assemblies"] == [
        {
            "assembly": dict(reproduction.geometry.assembly),
            "toe": reproduction.geometry.toe,
            "travel": reproduction.geometry.travel,
            "members": 3,
        }
    ]


def test_a_member_that_never_touches_the_ground_is_named(reproduction, make):
    leg = reproduction.geometry
    with pytest.raises(HoofEnvError, match=r"member 2: .*contact"):
        measure_spread(make(leg, leg.replace(hip_height=2 * leg.hip_height)))


def test_members_stand_on_the_ground_of_their_ensemble(reproduction, tmp_path):
    """K d**n without damping, on the depths of the preset's own run."""
    ground = Ground(stiffness=3e4, exponent=1.25)
    member = write_member(read_preset(reproduction.geometry.name), {"exact": 0.5, "paper": 0.5}, {})
    file = tmp_path / "legs.json"
    file.write_text(json.dumps(to_data([member], "made by hand", "walks", ground)), encoding="utf-8")
    ensemble = load_ensemble(file)
    assert ensemble.members[0].ground == ground
    spread = measure_spread(ensemble, reproduction.geometry.name)
    for gait in GAITS:
        trace = reproduction.traces[gait, "elastic", SOLVER]
        force = sum(3e4 * trace[f"{point}_penetration"].clip(0) ** 1.25 for point in ("toe", "heel"))
        entry = spread.data["quantities"][f"{gait}.elastic.peak"]
        assert entry["median"] == pytest.approx(force.max(), rel=1e-9)
        assert entry["preset"] == pytest.approx(trace["normal"].max(), rel=1e-9)


def test_an_ensembles_ground_that_is_none_is_refused(reproduction, tmp_path):
    member = write_member(read_preset(reproduction.geometry.name), {"exact": 0.5, "paper": 0.5}, {})
    data = to_data([member], "", "walks")
    (tmp_path / "bad.json").write_text(json.dumps({**data, "ground": {"n": 1}}), encoding="utf-8")
    with pytest.raises(DataFileError, match=r"bad\.json: ground: .*'n'"):
        load_ensemble(tmp_path / "bad.json")
    del data["ground"]
    (tmp_path / "old.json").write_text(json.dumps(data), encoding="utf-8")
    assert load_ensemble(tmp_path / "old.json").members[0].ground == Ground()


def test_progress_tells_when_it_is_done(make, reproduction):
    lines = []
    measure_spread(make(reproduction.geometry), progress=lines.append)
    assert lines == ["ensemble: 1 legs simulated in the four conditions"]


def test_the_text_gives_every_value_with_its_spread_and_says_what_that_is_not(spread):
    text = markdown(spread.data, "spread")
    for name, unit in (IDENTIFIED | FOLLOWING).values():
        assert f"| {name} | {unit} |" in text
    hip = spread.data["quantities"]["hip_height"]
    low, high = hip["range"]
    assert f"| {hip['preset']:.3f} | {hip['median']:.3f} |" in text
    assert with_spread(spread.data, "hip_height") == f"{hip['preset']:.3f} m ({low:.3f} to {high:.3f})"
    assert f"{low:.3f} to {high:.3f} | 4.0 % |" in text
    for claim in ("not a posterior", "lower bound", "began near", "made by hand", "1 kg/m, which is assumed"):
        assert claim in text
    assert "![" not in markdown(spread.data)


def test_the_text_says_which_bar_is_met(reproduction, make, spread):
    assert "within its bar. The worst row of any of them is 0.50 bars off" in markdown(spread.data)
    looser = {**spread.data, "bar": {"exact": 1.3, "paper": 0.9}, "short": 2}
    assert "meet a looser bar" in markdown(looser)
    assert "is 1.30 bars off" in markdown(looser)
    assert "2 of them miss a demand" in markdown(looser)


def test_the_figure_shows_every_member(reproduction, spread):
    figure_module = pytest.importorskip("matplotlib.figure")
    from matplotlib import style

    figure = figure_module.Figure()
    with style.context(["default", PRINT]):
        draw_spread(figure, reproduction, spread.curves)
        figure.draw_without_rendering()
    lengths, *rest = figure.axes
    dots = [line.get_ydata() for line in lengths.lines if line.get_marker() == "o"]
    assert len(dots) == len(LENGTHS) + 1
    np.testing.assert_allclose([sorted(values) for values in dots], [sorted(SCALES)] * len(dots), rtol=1e-6)
    for gait, (paths, torque, force) in zip(GAITS, (rest[:3], rest[3:]), strict=True):
        drawn = [line.get_xdata() for line in paths.lines if line.get_label().startswith("path")]
        np.testing.assert_array_equal(drawn, spread.curves.path[gait].real)
        for ax, curves in ((torque, spread.curves.crank_torque), (force, spread.curves.normal)):
            for band, condition in zip(ax.collections, CONDITIONS, strict=False):
                heights = band.get_paths()[0].vertices[:, 1]
                assert heights.max() == pytest.approx(curves[gait, condition].max())
                assert heights.min() == pytest.approx(curves[gait, condition].min())


def test_curves_that_do_not_fit_the_members_are_refused(spread):
    torque = {("walk", "elastic"): np.zeros((2, 5))}
    with pytest.raises(HoofEnvError, match="crank_torque"):
        dataclasses.replace(spread.curves, crank_torque=torque)
    with pytest.raises(HoofEnvError, match="lengths"):
        dataclasses.replace(spread.curves, lengths={"OP": np.zeros(2)})


def test_the_report_of_a_preset_with_an_ensemble_has_its_spread(reproduction, spread, tmp_path):
    without = dataclasses.replace(reproduction, conditions=dict, spread=lambda: None)
    names = {path.name for path in write_reproduction(without, tmp_path / "without")}
    within = dataclasses.replace(without, spread=lambda: spread)
    paths = write_reproduction(within, tmp_path / "with")
    assert {path.name for path in paths} - names == {"spread.json", "spread.png", "spread.svg"}
    assert json.loads((tmp_path / "with" / "spread.json").read_text(encoding="utf-8")) == spread.data
    page = (tmp_path / "with" / "reproduction.md").read_text(encoding="utf-8")
    assert markdown(spread.data, "spread") in page
    assert TITLE not in (tmp_path / "without" / "reproduction.md").read_text(encoding="utf-8")


def test_reproduce_finds_the_ensemble_of_its_preset(monkeypatch, reproduction, tmp_path):
    """By the preset's name; a preset in a file has none."""
    preset = reproduction.geometry.name
    members = [write_member(read_preset(preset), {"exact": 0.5, "paper": 0.5}, {}) for _ in range(2)]
    members[1]["geometry"] = {**members[1]["geometry"], "linear_density": 2.0}
    file = tmp_path / "legs.json"
    file.write_text(json.dumps(to_data(members, "made by hand", "walks")), encoding="utf-8")
    assert reproduce_module._spread(str(tmp_path / f"{preset}.json"), None) is None
    monkeypatch.setattr("hoof_env.identify.ensemble._file_of", {preset: file}.__getitem__)
    lines = []
    spread = reproduce_module._spread(preset, lines.append)
    assert (spread.data["preset"], spread.data["members"]) == (preset, 2)
    assert lines == ["ensemble: 2 legs simulated in the four conditions"]

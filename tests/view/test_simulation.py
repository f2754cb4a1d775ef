"""What the page draws is what `export` writes; a touch acts at once; a refusal changes nothing."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from hoof_env import records
from hoof_env.dynamics.observables import StanceCounter
from hoof_env.errors import HoofEnvError, ParameterError
from hoof_env.gait import PARAMETERS
from hoof_env.ground.laws import FACTORS
from hoof_env.lab.forces import THRESHOLD, above_threshold
from hoof_env.record.instant import instants
from hoof_env.render.outline import ARROW_M, MIN_FORCE_SHARE
from hoof_env.view import history
from hoof_env.view.history import RESOLUTION, thinned
from hoof_env.view.other_ground import OtherGround
from hoof_env.view.player import Player
from hoof_env.view.recording import Recording
from hoof_env.view.simulation import Simulation

LEG, HORSE, TERRAIN = "hoof_env/HorseLeg-v0", "hoof_env/Horse-v0", "hoof_env/HorseLegTerrain-v0"
FIXED = "hoof_env/HorseLegFixed-v0"
KEPT_SECONDS = 4.0  # in place of half a minute


def played(simulation, seconds, speed=1.0):
    player = Player(simulation)
    player.reset(simulation.reset())
    drawn = [player.curves()]
    while player.shown < seconds - 1e-6:
        player.go(0.04 * speed)
        drawn.append(player.curves())
    return player, {name: np.concatenate([part[name] for part in drawn if part]) for name in drawn[0]}


def exported(env_id, seconds, seed=0, **arguments):
    """The record of `hoof-env export` with its defaults."""
    with records.make_env(env_id, arguments) as env:
        player = records.find_policy(None, env, env_id, seed)
        record = records.record_episode(env, player, seed, seconds)
        return above_threshold(record, THRESHOLD, records.surroundings(env).terrain)


@pytest.mark.parametrize(("env_id", "speed"), [(LEG, 1.0), (LEG, 0.05), (HORSE, 2.0), (TERRAIN, 0.3)])
def test_drawn_numbers_equal_exported_numbers_to_the_digit(env_id, speed):
    seconds = 0.2 if speed < 0.1 else 0.8
    player, drawn = played(Simulation(env_id), seconds, speed)
    record = exported(env_id, 1.0)
    rows = np.searchsorted(record["time"], drawn["time"])
    np.testing.assert_array_equal(record["time"][rows], drawn["time"])
    for leg in player.legs:
        normal = record[f"{leg}toe_normal"] + record[f"{leg}heel_normal"]
        grf = np.hypot(record[f"{leg}force_x"], record[f"{leg}force_y"])
        np.testing.assert_array_equal(drawn[f"{leg}normal"], normal[rows])
        np.testing.assert_array_equal(drawn[f"{leg}grf"], grf[rows])
        np.testing.assert_array_equal(drawn[f"{leg}crank_speed"], record[f"{leg}crank_angle_rate"][rows])
        # The highest force of all substeps is among the rows that are drawn.
        until = record["time"] <= drawn["time"][-1] + RESOLUTION / 2
        if len(player.legs) == 1:
            assert drawn["normal"].max() == normal[until].max()
    assert np.diff(drawn["time"]).max() < 2 * RESOLUTION


@pytest.mark.parametrize("env_id", [LEG, HORSE])
def test_a_recording_is_the_file_of_export(env_id, tmp_path):
    simulation = Simulation(env_id, seed=3)
    said = []
    recording = Recording(simulation, tmp_path, ".csv", lambda *what: said.append(what))
    recording.add(simulation.reset())
    for _ in range(20):
        recording.add(simulation.step())
    recording.write().join()
    records.export_episode(tmp_path / "export.csv", None, env_id, (), 3, 0.4)
    assert recording.path.read_bytes() == (tmp_path / "export.csv").read_bytes()
    assert said[0][1] == "note"


@pytest.mark.parametrize(
    ("env_id", "arguments", "tolerance"),
    [
        (LEG, {}, 1e-9),
        (TERRAIN, {}, 1e-9),
        (FIXED, {"solver": "paper"}, 1e-9),
        # A sole without mass is followed from the leg's motion; over elastic ground steps of the engine go
        # beyond its balance.
        (HORSE, {}, 1e-4),
        (HORSE, {"restitution": 1.0}, 2e-2),
        (HORSE, {"restitution": 0.0, "normal_law": "lankarani-nikravesh"}, 1e-4),
    ],
)
def test_the_law_gives_the_simulated_force_for_the_simulated_ground(env_id, arguments, tolerance):
    """Curves of other ground are Eq. 14 along the motion: at the ground's own restitution it is the force of
    the engine."""
    arguments = {"restitution": 0.4, "normal_law": "hunt-crossley"} | arguments
    simulation = Simulation(env_id, arguments)
    simulation.reset()
    env = simulation.env.unwrapped
    same = OtherGround(env, (arguments["restitution"],))
    same.begin(env.record())
    worst, most, seen = 0.0, 0.0, 0
    for _ in range(60):
        chunk = simulation.step()
        if chunk is None:
            break
        record = env.record()
        normal = (record["toe_normal"] + record["heel_normal"])[..., 0]
        (by_law,) = same.forces(record)
        known = np.isfinite(by_law)
        worst = max(worst, np.abs(by_law - normal)[known].max(initial=0.0))
        most = max(most, normal[known].max(initial=0.0))
        for k, leg in enumerate(simulation.legs):
            loaded = (normal[:, k] > 0) & known[:, k]
            seen += np.any(chunk.normals[f"{leg}elastic"] != chunk.normals[f"{leg}inelastic"], where=loaded)
    assert most > 100
    assert worst < tolerance * most
    assert seen > len(simulation.legs)
    assert FACTORS["hunt-crossley"](1.0) == 0


def test_a_law_from_outside_has_no_such_curve_and_the_page_says_so():
    leg = Simulation(LEG).env.unwrapped
    task = replace(leg.task, contact_law=max)
    others = SimpleNamespace(task=task, resolved_settings=leg.resolved_settings, body=leg.body)
    assert "outside the package" in OtherGround(others).refusal
    assert OtherGround(leg).refusal == ""


def test_a_touch_acts_at_once_as_an_environment_made_so_would():
    """The state after a touch goes on with the bits of an environment with these arguments and this state."""
    simulation = Simulation(LEG, seed=2)
    simulation.reset()
    for _ in range(30):
        simulation.step()
    assert simulation.touch("restitution", 0.9)
    assert simulation.touch("stiffness", 30000)
    state = simulation.env.unwrapped.get_state()
    other = Simulation(LEG, {}, seed=2)
    other.reset()
    other.env.unwrapped.set_state(state)
    changed = 0
    before = exported(LEG, 2.0, 2)
    for _ in range(40):
        chunk = simulation.step()
        here = simulation.env.unwrapped
        measured = here.engine.report
        # What was recorded ends where the engine is.
        assert chunk.columns["toe_normal"][-1] == measured["toe_normal"][0, 0]
        same = np.isin(chunk.columns["time"], before["time"])
        rows = np.searchsorted(before["time"], chunk.columns["time"][same])
        changed += np.any(chunk.columns["toe_normal"][same] != before["toe_normal"][rows])
    assert changed
    record = simulation.env.unwrapped.record()
    same = OtherGround(simulation.env.unwrapped, (0.9,))
    same.set_ground(simulation.parameters)
    np.testing.assert_allclose(
        same.forces(record)[0], (record["toe_normal"] + record["heel_normal"])[..., 0], atol=1e-6
    )
    # The next episode keeps them.
    simulation.reset()
    made = Simulation(LEG, {"restitution": 0.9, "stiffness": 30000.0}, seed=2)
    made.reset()
    for _ in range(30):
        one, two = simulation.step(), made.step()
        np.testing.assert_array_equal(one.columns["toe_normal"], two.columns["toe_normal"])


def test_ground_that_needs_shorter_steps_is_left_to_a_new_environment():
    simulation = Simulation(LEG)
    simulation.reset()
    assert not simulation.touch("stiffness", 1e9)
    assert not simulation.touch("exponent", 2.0)
    assert simulation.parameters == {}


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("restitution", 1.5),
        ("friction", float("nan")),
        ("trunk_mass", "heavy"),
        ("setting", 1.0),
    ],
)
def test_a_refused_touch_changes_nothing(name, value):
    simulation = Simulation(LEG)
    simulation.reset()
    untouched = Simulation(LEG)
    untouched.reset()
    with pytest.raises(ParameterError, match=name):
        simulation.touch(name, value)
    for _ in range(5):
        one, two = simulation.step(), untouched.step()
        np.testing.assert_array_equal(one.columns["toe_y"], two.columns["toe_y"])


def test_by_hand_the_leg_goes_to_the_gait_that_is_asked_for():
    simulation = Simulation(LEG)
    simulation.reset()
    simulation.drive("swing_offset", 0.5)
    for _ in range(150):
        simulation.step()
    now = simulation.gait_now()
    assert now["swing_offset"] == pytest.approx(0.5, abs=1e-3)
    simulation.reset(policy="walk")
    assert simulation.hand is None
    assert simulation.policy == "walk"
    with pytest.raises(ParameterError, match="swing_offset"):
        simulation.drive("swing_offset", 9.0)
    assert tuple(simulation.gait_limits) == PARAMETERS
    with pytest.raises(ParameterError, match="gait"):
        Simulation(HORSE).drive("crank_speed", 3.0)


def test_a_policy_that_returns_nan_is_refused_and_the_episode_goes_on():
    simulation = Simulation(LEG)
    player = Player(simulation)
    player.reset(simulation.reset())
    player.go(0.1)
    good = simulation._actor.policy
    simulation._actor.policy = type("Broken", (), {"predict": lambda *_, **__: (np.full(4, np.nan), None)})()
    shown = player.clock
    with pytest.raises(ParameterError, match="finite actions"):
        player.go(0.1)
    assert player.clock == shown
    simulation._actor.policy = good
    player.go(0.1)
    assert player.shown == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("CartPole-v1",), "of this package"),
        (("hoof_env/HorseLeg-v0", {}, "no_such_folder/"), "model no_such_folder"),
        (("hoof_env/HorseLeg-v0", {}, "tests"), "model"),
        (("hoof_env/HorseLeg-v0", {"preset": "mule"}), "preset"),
        (("hoof_env/HorseLeg-v0", {"friction": -1}), "friction"),
        (("hoof_env/HorseLeg-v0", {}, None, -1), "seed"),
    ],
)
def test_a_wrong_set_up_is_refused_with_words(arguments, message):
    with pytest.raises(HoofEnvError, match=message):
        Simulation(*arguments)


def test_one_episode_follows_the_other_and_memory_is_bounded(monkeypatch):
    monkeypatch.setattr(history, "KEPT_SECONDS", KEPT_SECONDS)
    simulation = Simulation(LEG, {"episode_seconds": 0.5})
    player = Player(simulation)
    player.reset(simulation.reset())
    ends, sizes = 0, []
    while player.shown < 2.2 * KEPT_SECONDS:
        ends += player.go(0.25) == "time is up"
        player.curves()
        player.steps()
        player.row()
        kept = player.history
        columns = sum(len(part) * len(part["time"]) for part in (*kept._curves, *kept._steps))
        sizes.append(columns + sum(len(row) for row in kept._rows))
    assert ends == pytest.approx(2.2 * KEPT_SECONDS / 0.5, abs=2)
    assert simulation.seed == ends
    assert player.history.span[0] > player.shown - KEPT_SECONDS - 0.5
    assert max(sizes) < 1.15 * sizes[len(sizes) // 2]
    at = player.history.row_at(player.shown - 2.0)
    assert abs(at[0] - player.shown + 2.0) < 0.26
    shown, _ = player.history.between(player.shown - 3.0, player.shown)
    assert np.all(np.diff(shown["time"]) >= 0)
    assert shown["time"][0] < player.shown - 2.99


@pytest.mark.parametrize("env_id", [LEG, HORSE])
def test_numbers_of_a_stance_agree_with_the_record(env_id):
    simulation = Simulation(env_id)
    player, _ = played(simulation, 2.0)
    record = exported(env_id, 2.0)
    names = [name for name, _ in player.numbers]
    row = player.row()[3:]
    for k, leg in enumerate(player.legs):
        normal = record[f"{leg}toe_normal"] + record[f"{leg}heel_normal"]
        grf = np.hypot(record[f"{leg}force_x"], record[f"{leg}force_y"])
        counter = StanceCounter(simulation.setting.lift_off_n)
        peak = 0.0
        stances = []
        for i in range(len(normal)):
            before = counter.count
            h = record["time"][i] - record["time"][i - 1] if i else np.inf
            counter.add(record[f"{leg}crank_angle"][i], normal[i], grf[i], h)
            if counter.is_open:
                steepest = counter.steepest
                if counter.count > before:
                    stances.append([])
                stances[-1].append(i)
                peak = counter.peak
        assert row[names.index(f"peak {k}")] == peak
        assert row[names.index(f"loading rate {k}")] == pytest.approx(steepest / 1000)  # [kN/s]
        last = stances[-1]
        lasted = record["time"][last[-1]] - record["time"][last[0]]
        impulse = float(normal[last].sum() * 1e-3)
        assert row[names.index(f"impulse {k}")] == pytest.approx(impulse, rel=0.02, abs=1.0)
        assert row[names.index(f"mean {k}")] == pytest.approx(impulse / lasted, rel=0.03)
        assert 0.1 < row[names.index(f"duty {k}")] < 0.9
        # The part of the last whole stride in which the hoof stood.
        before, now = stances[-2:]
        stood, stride = (record["time"][end] - record["time"][before[0]] for end in (before[-1], now[0]))
        assert row[names.index(f"duty {k}")] == pytest.approx(stood / stride, rel=1e-9)


def test_the_return_is_the_sum_of_all_terms_of_all_steps():
    player, _ = played(Simulation(LEG), 0.5)
    steps = player.steps()
    sums = {name: sum(values) for name, values in steps.items() if name != "time"}
    assert len(steps["time"]) >= 25
    names = [name for name, _ in player.numbers]
    row = player.row()[3:]
    assert row[names.index("return")] == pytest.approx(sum(sums.values()))
    for name, total in sums.items():
        assert row[names.index(name)] == pytest.approx(total)


@pytest.mark.parametrize("env_id", [LEG, HORSE])
def test_arrows_are_the_forces_at_the_scale_that_the_page_states(env_id):
    simulation = Simulation(env_id)
    player = Player(simulation)
    player.reset(simulation.reset())
    drawing = player.drawing
    newtons = drawing.full_scale / (ARROW_M * drawing.size)  # of a metre, as the page states it
    seen = 0
    for _ in range(60):
        player.go(0.02)
        row = player.row()
        (now,) = instants(player._now, simulation.legs)
        x, y = (
            row[place.start :][: place.pieces * place.length].reshape(-1, 3, place.length)
            for place in drawing.places
            if place.source == "arrows"
        )
        outlines = x + 1j * y
        tips = outlines[..., 3]
        tails = (outlines[..., 0] + outlines[..., 6]) / 2
        for k, leg in enumerate(now.legs):
            if leg.grf < 2 * MIN_FORCE_SHARE * drawing.full_scale:
                continue
            seen += 1
            forces = [
                complex(leg.toe_force_x, leg.toe_force_y),
                complex(leg.heel_force_x, leg.heel_force_y),
                complex(leg.force_x, leg.force_y),
            ]
            np.testing.assert_allclose(newtons * (tips - tails)[k], forces, atol=1e-6 * newtons)
            for name, tail in zip(("toe", "heel", "cop"), tails[k], strict=True):
                if name == "cop" or abs(forces[("toe", "heel").index(name)]) > 0:
                    assert tail == pytest.approx(
                        complex(getattr(leg, f"{name}_x"), getattr(leg, f"{name}_y")), abs=1e-9
                    )
    assert seen > 10


def test_elastic_and_inelastic_are_the_forces_of_the_papers_restitutions():
    simulation = Simulation(LEG)
    simulation.reset()
    loaded = 0
    for _ in range(60):
        chunk = simulation.step()
        env = simulation.env.unwrapped
        by_law = OtherGround(env, (1.0, 0.0)).forces(env.record())[..., 0]
        np.testing.assert_array_equal([chunk.normals["elastic"], chunk.normals["inelastic"]], by_law)
        # Elastic ground is a spring: K depth^n, without a loss.
        depth = np.array([chunk.columns[f"{point}_depth"] for point in ("toe", "heel")])
        settings = env.resolved_settings
        spring = settings.stiffness * np.maximum(depth, 0.0) ** settings.exponent
        np.testing.assert_allclose(chunk.normals["elastic"], spring.sum(axis=0), atol=1e-6)
        loaded += chunk.normals["elastic"].max() > 100
    assert loaded > 5


def test_thinning_keeps_the_largest_force_of_each_slot():
    generator = np.random.default_rng(0)
    curves = {"time": np.arange(1000) * 1e-4, "normal": generator.random(1000)}
    rows = thinned(curves, ("",), 0.002)
    assert len(rows) == 50
    np.testing.assert_array_equal(curves["normal"][rows], curves["normal"].reshape(50, 20).max(axis=1))
    assert (np.diff(rows) > 0).all()

"""CMA-ES over open-loop gaits: it finds what is known, files are whole, searches go on where they ended."""

import json
import warnings
from dataclasses import replace

import numpy as np
import pytest

from agents import open_loop
from agents.open_loop import Args, Search, main, optimise, search_once, stalled
from agents.runs import make_env
from hoof_env import records
from hoof_env.envs import open_loop as families
from hoof_env.envs.open_loop import GAITS, load_open_loop, open_loop_record
from hoof_env.errors import DataFileError
from hoof_env.evaluation.episodes import play, score_vector
from hoof_env.policies.find import find_policy
from hoof_env.tasks.observation import HIGH, LOW
from tests.agents.conftest import ENV_ID, KWARGS, SHORT


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Generations of 16 candidates with 4 starts."""
    monkeypatch.setattr(open_loop, "POPULATION", 16)
    monkeypatch.setattr(open_loop, "STARTS", 4)
    monkeypatch.setattr(open_loop, "ROWS", 64)


def arguments(path, **changes):
    return replace(
        Args(
            env_kwargs=SHORT,
            restarts=2,
            episodes=64 * 4,
            most=64 * 6,
            easier=(),
            test_episodes=8,
            out=path / "gait.json",
        ),
        **changes,
    )


class Bowl:
    """An objective where the distance to a point costs, and starts add noise that all candidates share."""

    def __init__(self, interrupt_after=None):
        self.family = open_loop.Family(np.zeros(4), np.ones(4))
        self.middle, self.met, self.left = np.array([0.3, -0.5, 0.9, 0.0]), [], interrupt_after
        self.spent = 0

    def zero(self, seeds):
        return -4.0

    def costs(self, x, seeds):
        if self.left is not None:
            self.left -= 1
            if self.left == 0:
                raise KeyboardInterrupt
        self.spent += len(x) * len(seeds)
        if seeds[0] < open_loop.LOOK_SEED:
            self.met.append(set(seeds))
        noise = np.random.default_rng(seeds[0]).normal()
        return [float(((one - self.middle) ** 2).sum() + noise) for one in x]


def searched(objective, seed, least, start=None, tick=lambda *_: None):
    search = Search(objective, seed, least, open_loop.MOST * least, tick)
    return search, search.run(start)[0]


def test_a_search_finds_the_bottom_of_a_bowl_and_never_meets_a_start_twice():
    objective, ticks = Bowl(), []
    search, x = searched(objective, 0, 64 * 40, tick=lambda count, best: ticks.append(count))
    np.testing.assert_allclose(x, objective.middle, atol=0.05)
    assert not search.interrupted
    assert sum(map(len, objective.met)) == len(set.union(*objective.met))
    assert min(set.union(*objective.met)) > open_loop.TEST_SEED + 1_000_000
    assert 64 * 40 <= sum(ticks) <= 64 * 40 * open_loop.MOST + 64 * 2
    other = Bowl()
    searched(other, 1, 64 * 40)
    assert not set.union(*objective.met) & set.union(*other.met)


def test_a_search_ends_when_its_last_quarter_gains_too_little_and_not_before():
    search, _ = searched(Bowl(), 0, 64 * 40)
    assert search.stalled
    assert stalled(search.looks, -4.0)
    late = [(count, value) for count, value in search.looks if count >= 64 * 40]
    assert not any(stalled(search.looks[: search.looks.index(look) + 1], -4.0) for look in late[:-1])
    assert not stalled([(100, 1.0), (200, 1.5), (300, 2.0), (400, 3.0)], 0.0)
    assert stalled([(100, 1.0), (200, 2.0), (300, 3.0), (400, 3.02)], 0.0)


def test_an_interrupted_search_keeps_the_best_so_far():
    objective = Bowl(interrupt_after=12)
    search, x = searched(objective, 0, 64 * 40)
    assert search.interrupted
    assert ((x - objective.middle) ** 2).sum() < 0.5
    with pytest.raises(KeyboardInterrupt):
        searched(Bowl(interrupt_after=1), 0, 64 * 40)


def test_a_start_is_the_first_point():
    objective = Bowl()
    _, x = searched(objective, 0, 64 * 3, start=objective.middle)
    assert ((x - objective.middle) ** 2).sum() < 0.1


BOX = open_loop.Family((HIGH + LOW) / 2, (HIGH - LOW) / 2)


def test_the_box_is_the_range_of_the_gait_parameters():
    for end, limits in ((-1.0, LOW), (1.0, HIGH)):
        np.testing.assert_allclose(BOX.decode(np.full(4, end))["constant"], limits, atol=1e-12)
        phase = BOX._replace(harmonics=2, powers=2)
        found = phase.decode(np.full(phase.size, end))["coefficients"]
        assert found.shape == (2, 5, 4)
        np.testing.assert_allclose(found[0, 0], limits, atol=1e-12)
        np.testing.assert_allclose(found[0, 1:], np.tile(end * BOX.half, (4, 1)))
        np.testing.assert_allclose(found[1], np.tile(end * BOX.half, (5, 1)))


@pytest.mark.parametrize("clock", [False, True])
def test_the_way_back_is_the_same_and_ends_at_the_box(clock):
    rng = np.random.default_rng(0)
    for family in (BOX, BOX._replace(harmonics=1), BOX._replace(powers=2, harmonics=2)):
        family = family._replace(clock=clock and family.harmonics > 0)
        x = rng.uniform(-1, 1, family.size)
        np.testing.assert_allclose(family.encode(family.decode(x)), x)
    np.testing.assert_array_equal(BOX.encode({"constant": HIGH + 1.0}), np.ones(4))
    # A constant gait is one of the larger family, whose other numbers are 0
    larger = BOX._replace(harmonics=2)
    again = larger.decode(larger.encode({"constant": HIGH}))["coefficients"]
    np.testing.assert_allclose(again[0, 0], HIGH)
    assert not again[0, 1:].any()


def test_decoding_reaches_all_frequencies():
    family = BOX._replace(harmonics=1, clock=True)
    for end, frequency in ((-1.0, open_loop.SLOWEST), (1.0, open_loop.FASTEST)):
        found = family.decode(np.r_[np.zeros(family.size - 1), end])
        assert found["frequency_hz"] == pytest.approx(frequency)
        assert set(found) == {"coefficients", "frequency_hz"}


def test_a_cost_is_minus_the_mean_return():
    points, seeds = np.random.default_rng(0).uniform(-1, 1, (16, 4)), range(7, 11)
    objective = open_loop.Objective(ENV_ID, KWARGS, "constant")
    costs = objective.costs(points, seeds)
    for point, cost in zip(points[:3], costs, strict=False):
        policy = families.open_loop(objective.family.decode(point), objective.env)
        episodes = score_vector(policy, ENV_ID, seeds, **KWARGS)
        assert cost == pytest.approx(-np.mean([one["return"] for one in episodes]), abs=1e-6)


@pytest.mark.parametrize("family", families.FAMILIES)
def test_a_file_is_whole_and_its_gait_gets_the_score_it_names(tmp_path, env, family):
    args = arguments(tmp_path, family=family)
    found = optimise(args)
    assert json.loads(args.out.read_text()) == found
    assert [path.name for path in tmp_path.iterdir()] == ["gait.json"]
    assert [one["seed"] for one in found["restarts"]] == [0, 1]
    best = min(found["restarts"], key=lambda one: one["cost"])
    assert found["parameters"] == best["parameters"]
    assert found["score"]["mean"] == best["mean"]
    low, high = found["score"]["interval95"]["return"]
    assert low < found["score"]["mean"]["return"] < high
    assert found["form"] == families.GAIT
    assert "observation_scales" not in found  # no command
    assert ("gait" in found) == (family == "constant")
    assert list(found.get("gait", {}).values()) == found["parameters"].get("constant", [])
    assert found["command"].startswith("python")
    assert {"cma", "numpy", "python"} <= set(found["versions"])
    episodes = play(env, find_policy(str(args.out), env, ENV_ID), range(1000, 1008))
    assert np.mean([one["return"] for one in episodes]) == pytest.approx(found["score"]["mean"]["return"])
    assert score_vector(load_open_loop(args.out, env), ENV_ID, range(1000, 1008), **KWARGS) == episodes


def test_searches_that_are_there_are_not_made_again(tmp_path, monkeypatch):
    first = optimise(arguments(tmp_path, restarts=1))
    monkeypatch.setattr(
        open_loop,
        "search_once",
        lambda objective, seed, *rest: (
            (seed == 1 or pytest.fail("again")) and search_once(objective, seed, *rest)
        ),
    )
    both = optimise(arguments(tmp_path, restarts=2))
    assert both["restarts"][0] == first["restarts"][0]
    assert optimise(arguments(tmp_path, restarts=2))["restarts"] == both["restarts"]
    with pytest.raises(DataFileError, match="name another --out"):
        optimise(arguments(tmp_path, test_episodes=9))


def test_ctrl_c_writes_the_best_so_far_and_the_next_call_searches_that_again(tmp_path, monkeypatch):
    args = arguments(tmp_path, restarts=1)
    monkeypatch.setattr(open_loop, "search_once", lambda *given: search_once(*given) | {"interrupted": True})
    with pytest.raises(KeyboardInterrupt):
        optimise(args)
    kept = json.loads(args.out.read_text())
    assert kept["restarts"][0]["interrupted"]
    monkeypatch.setattr(open_loop, "search_once", search_once)
    found = optimise(args)
    assert len(found["restarts"]) == 1
    assert "interrupted" not in found["restarts"][0]
    assert found["parameters"] == kept["parameters"]  # the same seed finds the same


def test_the_command_prints_scores(tmp_path, capsys):
    out = tmp_path / "gait.json"
    small = ("--restarts", "1", "--episodes", "192", "--test-episodes", "4")
    main(["--env-kwargs", *SHORT, *small, "--out", str(out)])
    printed = capsys.readouterr().out
    assert "stance_peak_n" in printed
    assert str(out) in printed


@pytest.mark.parametrize("path", sorted(GAITS.glob("*.json")), ids=lambda path: path.stem)
def test_stored_gaits_get_their_scores(path):
    found = open_loop_record(path)
    with make_env(found["env_id"], **found["env_kwargs"]) as env:
        policy = load_open_loop(path, env)
    episodes = score_vector(policy, found["env_id"], range(1000, 1008), **found["env_kwargs"])
    for name in ("return", "speed_m_s", "stance_peak_n"):
        mean, (low, high) = found["score"]["mean"][name], found["score"]["interval95"][name]
        # Three standard errors of 8 episodes, where the interval is of 512; on a fixed trunk all are alike
        bound = 6 * (high - low) or 1e-6
        assert np.mean([one[name] for one in episodes]) == pytest.approx(mean, abs=bound)


@pytest.mark.parametrize("env_id", [ENV_ID, "hoof_env/HorseLegMO-v0"])
def test_an_id_names_its_best_stored_gait(env_id):
    best = max(
        map(open_loop_record, GAITS.glob("HorseLeg-v0-*.json")),
        key=lambda one: one["score"]["mean"]["return"],
    )
    with make_env(env_id) as env, warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        for policy in (find_policy("open-loop", env, env_id), records.find_policy("open-loop", env, env_id)):
            same = families.open_loop(best["parameters"], env)
            seen, _ = env.reset(seed=0)
            for _ in range(3):
                action, _ = policy.predict(seen)
                np.testing.assert_array_equal(action, same.predict(seen)[0])
                seen = env.step(action)[0]


def test_a_held_gait_is_the_zero_action_in_its_own_gait():
    with make_env(ENV_ID) as env:
        policy = find_policy("constant", env, ENV_ID)
        gait = open_loop_record(GAITS / "HorseLeg-v0-constant.json")["gait"]
        seen, _ = env.reset(seed=0, options={"gait": gait})
        assert np.abs(policy.predict(seen)[0]).max() < 1e-3

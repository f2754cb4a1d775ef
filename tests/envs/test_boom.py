"""A leg that carries itself: a trunk on a boom, over hooves with springs that have a length."""

import gymnasium as gym
import numpy as np
import pytest

import hoof_env
from hoof_env.dynamics.parts import ONE_LEG
from hoof_env.errors import ParameterError
from hoof_env.tasks.registry import HOP, TASKS

PASTERN = {"hoof_stiffness": 1e4, "hoof_damping": 200.0, "hoof_length": 0.3}
BOOM = {"trunk": "boom", "stiffness": 2e6, "exponent": 1.5, **PASTERN}


@pytest.mark.parametrize("drive", ["motor", "prescribed"])
def test_nothing_but_the_ground_holds_the_trunk_and_the_hoof_stands_on_it(drive):
    """Momentum changes by the impulse of the ground less the impulse of the weight, and by nothing else."""
    env = gym.make("hoof_env/HorseLeg-v0", drive=drive, **BOOM).unwrapped
    env.reset(seed=0)
    engine = env.engine
    momentum, impulse, time = engine.state["momentum_y"][0], 0.0, 0.0
    points, deepest = [], 0.0
    for _ in range(40):
        _, _, terminated, _, info = env.step(np.zeros(4, np.float32))
        assert not terminated
        time += env.dt
        measured = info["measured"]
        impulse += measured["normal_impulse"]
        points += [measured["toe_y"], measured["heel_y"]]
        deepest = max(deepest, measured["toe_penetration"], measured["heel_penetration"])
    assert impulse > 0.2 * env.weight * time  # it has landed
    gained = engine.state["momentum_y"][0] - momentum
    assert gained == pytest.approx(impulse - env.weight * time, abs=0.002 * impulse)  # a sum over substeps
    assert min(points) > 0.0  # of the leg's points: the soles are below
    assert 0.0 < deepest < 0.02  # of the soles


def test_pictures_and_records_have_the_soles():
    env = gym.make("hoof_env/HorseLeg-v0", **BOOM).unwrapped
    env.reset(seed=0)
    for _ in range(40):
        *_, info = env.step(np.zeros(4, np.float32))
    record = env.record()
    assert info["measured"]["toe_y"] - 0.3 <= record["toe_y"][-1] <= info["measured"]["toe_y"]
    assert record["toe_y"].min() > -0.02


def test_a_leg_that_bears_all_does_not_observe_its_share():
    names = gym.make("hoof_env/HorseLeg-v0", observation=("context",), **BOOM).unwrapped.observation_names
    assert names == ("stiffness of the ground", "friction", "weight")


@pytest.mark.parametrize(
    ("env_id", "kwargs", "message"),
    [
        ("HorseLeg-v0", {"trunk": "boom", "trunk_stiffness": 5.0}, "trunk_stiffness: .*suspended.*boom"),
        ("HorseLeg-v0", {"trunk": "boom", "trunk_share": 0.5}, "trunk_share: .*suspended.*boom"),
        ("HorseLeg-v0", {"hoof_length": 0.1}, "hoof_length: expected a hoof_stiffness"),
        ("HorseLeg-v0", {"hoof_stiffness": 1e4, "hoof_length": -1.0}, r"hoof_length: .*\[0, 1\], got -1"),
        ("HorseLeg-v0", {"trunk": "boom", "terrain": {"kind": "slope", "angle": 0.05}}, "under a boom trunk"),
        ("Horse-v0", {"hoof_length": 0.1}, "hoof_length: expected 0 for a horse"),
        ("Horse-v0", {"trunk": "boom"}, 'trunk: expected "free"'),
    ],
)
def test_contradictions_are_refused_by_name(env_id, kwargs, message):
    with pytest.raises(ParameterError, match=message):
        gym.make(f"hoof_env/{env_id}", **kwargs)


def test_starts_are_drawn_between_two_values_and_numbers_stay_the_same():
    env = gym.make_vec("hoof_env/HorseLeg-v0", num_envs=64, **BOOM)
    ranges = {"crank_angle": (3.0, 3.5), "speed": (1.0, 4.0), "height": (1.9, 2.2), "x": (-2.0, 2.0)}
    _, drawn = env.reset(seed=3, options=ranges)
    for name, (low, high) in ranges.items():
        assert low <= drawn[name].min() < low + 0.1 * (high - low)
        assert high - 0.1 * (high - low) < drawn[name].max() <= high
    assert np.abs(np.corrcoef([drawn[name] for name in ranges]) - np.eye(4)).max() < 0.4
    _, again = env.reset(seed=3, options=ranges)
    assert all((again[name] == drawn[name]).all() for name in ranges)
    # a number in place of a range leaves the other draws of a seed alone
    _, other = env.reset(seed=3, options={**ranges, "crank_angle": 3.2})
    assert (other["speed"] == drawn["speed"]).all()
    assert (other["crank_angle"] == 3.2).all()


def test_a_drawn_crank_angle_on_a_rail_leaves_the_hoof_above_the_ground():
    env = gym.make_vec("hoof_env/HorseLegRail-v0", num_envs=64)
    _, info = env.reset(seed=3, options={"crank_angle": (0.0, 4.0)})
    assert info["measured"]["toe_penetration"].max() <= 0.0
    assert info["crank_angle"].min() >= 0.0
    assert 2.0 < info["crank_angle"].max() <= 4.0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"height": (1.0, 2.0)}, r"options\['height'\]: expected 0.6 to 2 times 1.9975 m, .*got 1"),
        ({"speed": (4.0, 1.0)}, r"options\['speed'\]\[1\]: expected .*got 1.0"),
        ({"speed": (1.0, 2.0, 3.0)}, r"options\['speed'\]: expected two numbers"),
        ({"strength": (0.0, 1.0)}, r"options\['strength'\]: expected .*got"),
    ],
)
def test_ranges_that_no_start_can_have_are_refused(options, message):
    env = gym.make("hoof_env/HorseLeg-v0", **BOOM)
    with pytest.raises(ParameterError, match=message):
        env.reset(options=options)


HIGH = {"gait": "run", "crank_angle": (3.0, 3.7), "height": (1.95, 2.15), "speed": (2.0, 4.0)}


@pytest.fixture(scope="module", autouse=True)
def own_ids():
    """A task of one's own with starts, and one that is made from it."""
    hoof_env.register("test/Hop-v0", base="leg", start=HIGH, **BOOM)
    hoof_env.register("test/SlowHop-v0", base="test/Hop-v0", crank_rate=5.0)


def test_a_task_of_ones_own_has_starts_of_its_own():
    env = gym.make_vec("test/Hop-v0", num_envs=32)
    _, info = env.reset(seed=0)
    assert info["speed"].min() > 2.0
    assert (info["gait"] == hoof_env.load_gait("run").to_array()).all()
    _, info = env.reset(seed=0, options={"speed": 1.0})
    assert (info["speed"] == 1.0).all()
    assert info["height"].min() > 1.95
    # an id that is made from this one has its starts, too
    assert gym.make("test/SlowHop-v0").reset(seed=0)[1]["speed"] > 2.0


@pytest.mark.parametrize("trunk", ONE_LEG)
@pytest.mark.parametrize("base", ["hop", "balance", "test/SlowHop-v0"])
def test_an_inherited_start_loses_what_another_trunk_cannot_have(base, trunk):
    name = f"test/{base.removeprefix('test/').removesuffix('-v0')}-{trunk}-v0"
    hoof_env.register(name, base=base, trunk=trunk)
    env = gym.make(name)
    info = env.reset(seed=0)[1]
    if trunk in ("rail", "fixed"):
        assert info["height"] == env.unwrapped.engine.trunk.height
    if trunk == "fixed":
        assert info["speed"] == 0.0
    same = gym.make(base, trunk=trunk) if "/" in base else gym.make(TASKS[base].id, trunk=trunk)
    assert same.unwrapped.batch.usual_start == env.unwrapped.batch.usual_start


@pytest.mark.parametrize(
    ("name", "start", "message"),
    [
        ("Down", {"speed": (4.0, 1.0)}, r"test/Down-v0: start: options\['speed'\]\[1\]: expected"),
        ("Trot", {"gait": "trot"}, r"test/Trot-v0: start: options\['gait'\]: expected"),
        (
            "Far",
            {"gait": HOP, "crank_angle": (3.0, 3.7), "height": (1.9, 2.0)},
            "below a height of 3.995 m.*got",
        ),
        ("Wings", {"wings": 2}, "test/Wings-v0: start: options: expected a mapping with some of gait"),
    ],
)
def test_starts_that_no_episode_can_have_are_refused_with_the_id(name, start, message):
    preset = "klann" if name == "Far" else "identified"
    hoof_env.register(f"test/{name}-v0", base="leg", preset=preset, start=start, **BOOM)
    with pytest.raises(ParameterError, match=message):
        gym.make(f"test/{name}-v0")


def test_a_start_other_than_a_mapping_is_refused_at_once():
    with pytest.raises(ParameterError, match="test/List-v0: start: expected a mapping of reset options, got"):
        hoof_env.register("test/List-v0", base="leg", start=[1.0], **BOOM)
    assert "test/List-v0" not in gym.registry


def test_a_range_of_heights_that_is_asked_for_is_kept():
    """Also where a hoof starts inside the ground; only a task's own range is raised."""
    env = gym.make("hoof_env/HorseLeg-v0")
    heights = [env.reset(seed=seed, options={"height": (1.2, 1.3)})[1]["height"] for seed in range(6)]
    assert 1.2 <= min(heights) < max(heights) <= 1.3

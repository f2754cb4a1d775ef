"""What makes environments refuses: settings, presets, numbers of environments, by the words of each error.

One table for `gymnasium.make` and `make_vec`, one for what many have besides, one for presets, which come as
an argument or a file, one for the other doors. A new setting adds its rows here.
"""

from __future__ import annotations

import json
from decimal import Decimal

import gymnasium as gym
import numpy as np
import pytest
from family import HORSE

from hoof_env import RandomizeParameters, Sb3VecEnv, read_preset
from hoof_env.errors import DataFileError, ParameterError
from hoof_env.ground.terrain import Terrain
from hoof_env.simd import threads

LEG, RAIL, FIXED, SPEED, MO = (f"hoof_env/HorseLeg{name}-v0" for name in ("", "Rail", "Fixed", "Speed", "MO"))
NAN = float("nan")
SOFT = {"hoof_stiffness": 4e4}
PAPER = {"solver": "paper"}
CONTENT = read_preset("identified")


def step_up(height, length=30.0):
    """Level, then a ramp to another level, which goes on."""
    return Terrain.ramp(height / length, 5.0, length).to_dict()


DRIFTS = [
    {"kind": "slope", "angle": 0.02}, {"kind": "slope", "angle": -1e-3}, step_up(0.3), step_up(-0.3),
    {"height": [0.1]}, Terrain.slope(0.01).to_dict(), Terrain.through([0, 400], [0, 4]).to_dict(),
    {"kind": "hills", "rise": 1.0},
]  # fmt: skip
"""Ground that drifts away from a trunk that keeps its height. On a slope of 0.02 rad the run used to go
farther uphill than on the level, with a weight share of 4.5, and of 37 under a rail."""

SETTINGS = {
    LEG: [
        (
            {"trunk_mas": 80.0},
            "HorseLeg-v0: unexpected keyword argument 'trunk_mas'; did you mean trunk_mass?",
        ),
        ({"wings": 2}, r"unexpected keyword argument 'wings' \(known: preset, gait, trunk, "),
        ({"task": "fly"}, "task: expected .*fixed, .*hop, horse, .*leg, .*got 'fly'"),
        (
            {"preset": "no_such_leg"},
            "preset: expected .*, klann, got 'no_such_leg'",
        ),
        ({"trunk": "hovering"}, "trunk: expected .*fixed, floating, rail, suspended, got 'hovering'"),
        ({"trunk": "free"}, "trunk: expected .*fixed, floating, rail, suspended, got 'free'"),
        ({"trunk": 3}, "trunk: expected .*fixed, floating, rail, suspended, got 3"),
        ({"gait": "trot"}, "gait: expected .*carrying_walk, run, walk, got 'trot'"),
        ({"solver": "fast"}, "solver: expected .*exact, paper, got 'fast'"),
        ({"solver": "paper", "integrator": "euler"}, "trunk: expected 'fixed' with solver=\"paper\""),
        (
            {"observation": ["crank", "target"], "target_speed": None},
            "observation: 'target' is constant without target_speed",
        ),
        ({"observation": ["crank", "ground"]}, "observation: 'ground' is constant without terrain"),
        *(
            ({name: value}, rf"{name}: expected .*\(0, {bound}\].*got {value!r}")
            for name, bound in (("crank_rate", 20), ("swing_rate", 6))
            for value in (0.0, -1.0, NAN, float("inf"), 1.001 * bound, "fast", None)
        ),
        ({"drive": "belt"}, "drive: expected .*motor, prescribed, got 'belt'"),
        ({"normal_law": "hertz"}, "normal_law: expected .*lankarani-nikravesh.*got 'hertz'"),
        ({"friction_law": "stick"}, "friction_law: expected .*ambrosio.*got 'stick'"),
        ({"integrator": "leapfrog"}, "integrator: expected .*midpoint.*got 'leapfrog'"),
        ({"render_mode": "ansi"}, "render_mode: expected .*rgb_array, got 'ansi'"),
        ({"dt": 0.0205}, "dt: expected .*multiple of sim_dt = 0.001 s, got 0.0205 s"),
        ({"dt": 0.0005}, "dt: expected .*multiple"),
        ({"dt": 1e300, "sim_dt": 1e-9}, "dt: expected.* got 1e.300 s .ratio inf; .*100000"),
        ({"sim_dt": 1e-300}, "sim_dt: expected 1e-12 .*got 1e-300"),
        ({"dt": NAN}, "dt: expected.*got nan"),
        ({"sim_dt": 0.0}, "sim_dt: expected"),
        ({"sim_dt": 0.2, "dt": 0.2}, "sim_dt: expected.*got 0.2"),
        ({"trunk_mass": -80.0}, "trunk_mass: expected.*got -80.0"),
        ({"trunk_mass": "heavy"}, "trunk_mass: expected.*got 'heavy'"),
        ({"trunk_share": 1.5}, "trunk_share: expected.*got 1.5"),
        ({"trunk_stiffness": -1.0}, "trunk_stiffness: expected.*got -1.0"),
        ({"hip_height": 0.0}, "hip_height: expected.*got 0.0"),
        ({"hip_height": "low"}, "hip_height: expected.*got 'low'"),
        ({"stiffness": float("inf")}, "stiffness: expected.*got inf"),
        ({"restitution": 1.1}, "restitution: expected.*got 1.1"),
        ({"restitution": 0.0, "normal_law": "flores"}, "restitution: expected .*.0.01, 1."),
        ({"exponent": 0.0}, "exponent: expected.*got 0.0"),
        ({"exponent": 1.51}, "exponent: expected a multiple of 1/8, .*, got 1.51"),
        ({"friction": -0.1}, "friction: expected.*got -0.1"),
        ({"friction_fast": 1e-4}, "friction_fast: expected .*friction_slow"),
        ({"drive": "motor", "motor_gain": -1.0}, "motor_gain: expected.*got -1.0"),
        ({"drive": "motor", "motor_torque": "strong"}, "motor_torque: expected.*got 'strong'"),
        ({"approach_floor": 1e300}, "approach_floor: expected.*got 1e.300"),
        ({"episode_seconds": -1.0}, "episode_seconds: expected.*got -1.0"),
        ({"episode_seconds": 1e308}, "episode_seconds: expected.*got 1e.308"),
        ({"episode_seconds": 10.0, "dt": 20.0}, r"episode_seconds: expected.*\[20, .*got 10.0"),
        ({"target_speed": "fast"}, "target_speed.*: expected.*got 'fast'"),
        ({"target_speed": [3.0, 1.0]}, r"target_speed\[1\]: expected.*\[3, .*got 1.0"),
        ({"target_speed": [1.0, 2.0, 3.0]}, r"target_speed: expected .*got \[1.0, 2.0, 3.0\]"),
        ({"target_speed": (1.0, 2.0), "target_seconds": 0.0}, r"target_seconds\[0\]: expected.*got 0.0"),
        ({"observation": ["tail"]}, r"observation: expected .*crank, .*got \['tail'\]"),
        ({"observation": []}, r"observation: expected .*crank, .*got \[\]"),
        ({"observation": ["hoof", "hoof"]}, "observation: expected a list"),
        ({"observation": "hoof"}, "observation: expected .*crank, .*got 'hoof'"),
        ({"observation": [["hoof"]]}, "observation: expected .*crank"),
        ({"reward_weights": {"speed": 1.0}}, "reward_weights: expected .*progress.*got"),
        ({"reward_weights": {"peak": NAN}}, "reward_weights.'peak'.: expected.*got nan"),
        ({"reward_weights": 3}, "reward_weights: expected a mapping"),
        ({"trunk_mass": 1e300}, r"^trunk_mass: expected .*1e\+06\], got 1e\+300"),
        ({"trunk_drag": 1e308}, r"^trunk_drag: expected .*1e\+12\], got 1e\+308"),
        ({"trunk_stiffness": 1e308}, r"^trunk_stiffness: expected .*got 1e\+308"),
        ({"hoof_stiffness": 1e-9}, r"^hoof_stiffness: expected .*got 1e-09"),
        ({"hoof_damping": 1e300, "hoof_stiffness": 1e5}, r"^hoof_damping: expected .*got 1e\+300"),
        ({"randomize": {"trunk_mass": (50.0, 1e300)}}, r"^randomize: trunk_mass: expected .*got 1e\+300"),
        ({"terrain": 3}, "terrain: expected None.*Terrain.*got 3"),
        ({"terrain": {"kind": "moon"}}, r"terrain\['kind'\]: expected .*ditches, hills, slope, got 'moon'"),
        ({"terrain": {"kind": "hills", "steep": 1}}, "terrain: hills .*steep; expected .*seed"),
        ({"terrain": {"kind": "hills", "rise": -1}}, r"terrain\['rise'\]: expected.*got -1"),
        (
            {"terrain": {"kind": "hills", "stiffness": 2}},
            r"terrain\['stiffness'\]: expected .*got 2",
        ),
        ({"terrain": {"kind": "ditches", "rise": 1}}, "terrain: ditches has no rise; expected .*depth"),
        ({"terrain": {"kind": "ditches", "depth": -1}}, r"terrain\['depth'\]: expected .*got -1"),
        ({"terrain": {"kind": "ditches", "width": 0.05}}, r"terrain\['width'\]: expected .*got 0.05"),
        ({"terrain": {"kind": "ditches", "gap": [2, 1]}}, r"terrain\['gap'\]\[1\]: expected .*got 1"),
        ({"terrain": {"kind": "ditches", "depth": 1.0}}, "terrain: expected shallower .*mean height"),
        ({"terrain": {"kind": "ditches", "length": 1e5}}, r"terrain\['length'\]: expected .*got 100000"),
        ({"terrain": {"kind": "slope", "angle": 2}}, "angle.*: expected.*got 2"),
        ({"terrain": {"bumps": 1}}, "terrain.*"),
        (
            {"terrain": {"kind": "slope", "angle": 0.001}},
            "terrain: expected ground whose mean height.*suspended",
        ),
        (
            {"terrain": {"kind": "hills", "rise": 0.5}},
            r"terrain\['rise'\]: expected .*0.339 m.*got 0.5 m",
        ),
        ({"terrain": np.zeros(2)}, r"terrain: expected None.*Terrain.*got \[0.0, 0.0\]"),
        ({"friction": Decimal("0.5")}, "friction: expected .*Python or NumPy.*Decimal"),
        ({"randomize": 3}, "randomize: expected .*trunk_mass.*got 3"),
        ({"randomize": []}, r"randomize: expected .*trunk_mass.*got \[\]"),
        ({"randomize": np.zeros(2)}, r"randomize: expected .*trunk_mass.*got \[0.0"),
        ({"observation": ["ground"], "terrain": {}}, "'ground' is constant without terrain, got terrain={}"),
        ({"randomize": {"preset": "x"}}, "randomize: expected .*trunk_mass"),
        ({"randomize": {"friction": (0.1, 0.2, 0.3)}}, r"randomize\['friction'\]: expected .*two"),
        ({"randomize": {"friction": (0.3, 0.1)}}, r"randomize\['friction'\]: expected .*first"),
        ({"randomize": {"friction": (0.3, NAN)}}, r"randomize\['friction'\]\[1\]: expected.*got nan"),
        ({"randomize": {"trunk_mass": (-1.0, 80.0)}}, "^randomize: trunk_mass: expected.*got -1.0"),
        ({"randomize": {"friction_slow": (0.0, 0.1)}}, "^randomize: friction_fast: expected more than"),
        ({"schedule": {"friction": [0.5, -2.0, 100]}}, "^schedule: friction: expected.*got -2.0"),
        ({"hoof_stiffness": 0.0}, "hoof_stiffness: expected .*got 0.0"),
        ({"hoof_stiffness": "soft"}, "hoof_stiffness: expected .*got 'soft'"),
        ({**SOFT, "hoof_damping": 0.0}, "hoof_damping: expected .*got 0.0"),
        ({"hoof_damping": 300.0}, "hoof_damping: expected a hoof_stiffness .*got 300.0"),
        ({**SOFT, "friction_fast": 0.1}, "friction_fast: expected none .*hoof_stiffness"),
        ({**SOFT, "randomize": {"friction_slow": 0.01}}, "randomize: 'friction_slow': expected none with"),
        *(({"terrain": each}, "terrain.*under a suspended trunk.*hoof_env/Horse-v0.*got") for each in DRIFTS),
    ],
    RAIL: [
        *(({"terrain": each}, "terrain.*under a rail trunk.*hoof_env/Horse-v0.*got") for each in DRIFTS),
    ],
    FIXED: [
        ({"gait": "trot"}, "gait: expected .*carrying_walk, run, walk, got 'trot'"),
        ({"integrator": "leapfrog", "solver": "paper"}, "integrator: expected .*euler.*got 'leapfrog'"),
        ({"integrator": "euler"}, "integrator: expected .*midpoint.*got 'euler'"),
        ({"baumgarte_beta": -1.0, "solver": "paper"}, "baumgarte_beta: expected.*got -1.0"),
        ({"baumgarte_alpha": "a", "solver": "paper"}, "baumgarte_alpha: expected.*got 'a'"),
        ({"trunk": "rail", "solver": "paper"}, "trunk: expected 'fixed' with solver=\"paper\", got 'rail'"),
        ({"drive": "motor", "solver": "paper"}, "drive: expected 'prescribed' with"),
        ({"terrain": {"kind": "slope", "angle": 0.1}, "solver": "paper"}, "terrain: expected None with"),
        ({"randomize": {"friction": 0.3}, "solver": "paper"}, "randomize: expected None with"),
        ({**PAPER, **SOFT}, r'hoof_stiffness: expected None with solver="paper", got 4000'),
        ({"stiffness": -1}, r"stiffness: expected .*got -1"),
        ({**PAPER, "baumgarte_beta": 1e200}, r"baumgarte_beta: expected .*1e\+06\], got 1e\+200"),
        ({"observation": ["trunk"]}, r"observation: nothing of \['trunk'\] is observed on a fixed"),
    ],
    HORSE: [
        ({"trunk": "rail"}, 'trunk: expected "free" .*horse, got'),
        ({"size": 3.0}, "size: expected"),
        ({"harmonics": 3}, "harmonics: expected"),
        ({"filters": "fast"}, "filters: expected .*quick, slow, got 'fast'"),
        ({"footfall": "loose"}, "footfall: expected .*fixed, free, got 'loose'"),
        ({"gait": "canter"}, "gait: expected one of"),
        ({"hoof_stiffness": None, "hoof_damping": 100.0}, "hoof_damping: expected a hoof_stiffness"),
        ({"trunk_share": 0.5}, "trunk_share: expected none .*horse"),
        ({"solver": "paper"}, "solver|trunk"),
        ({"hip_height": 1.5}, "hip_height: expected .*size.* horse"),
        ({"harmonics": 0}, "harmonics: expected .*number"),
        ({"harmonics": 1.5}, "harmonics: expected .*number"),
        ({"filters": ""}, "filters: expected one of"),
        ({"hoof_stiffness": 0.0}, "hoof_stiffness: expected"),
        ({"hoof_stiffness": "soft"}, "hoof_stiffness: expected"),
        ({"target_speed": "fast"}, r"target_speed\[0\]: expected"),
        ({"size": "small"}, "size: expected"),
        ({"target_speed": 2.0, "target_seconds": (1.0, 2.0)}, "target_seconds: expected .*target"),
        ({"target_speed": -2.0}, r"target_speed\[0\]: expected"),
        ({"target_speed": (1.0, 21.0)}, r"target_speed\[1\]: expected .*\[1, 20\], got 21"),
        ({"target_speed": (0.0, 2.0)}, r"target_speed\[0\]: expected"),
    ],
}
"""Arguments that an id refuses, with words of the error."""

EFFECTS = [
    (LEG, {"motor_gain": 30.0}, "motor_gain: expected drive='motor'.*got drive='prescribed'"),
    (LEG, {"motor_torque": "strong"}, "motor_torque: expected drive='motor'"),
    (LEG, {"motor_inertia": 1.0, "drive": "prescribed"}, "motor_inertia: expected drive='motor'"),
    (RAIL, {"trunk_share": 0.5}, "trunk_share: expected trunk='suspended'.*got trunk='rail'"),
    (LEG, {"trunk": "fixed", "trunk_drag": 1.0}, "trunk_drag: .* or trunk='rail'"),
    (HORSE, {"trunk_drag": 1.0}, "trunk_drag: expected none .*horse"),
    (LEG, {"size": 0.7}, "size: expected none .*leg"),
    (FIXED, {"trunk_stiffness": 1.0}, "trunk_stiffness: expected.*got trunk='fixed'"),
    (LEG, {"target_seconds": (1.0, 2.0)}, r"target_seconds: .* a range of target_speed.*=\(2.5, 2.5\)"),
    (LEG, {"target_seconds": (1.0, 2.0), "target_speed": 2.0}, "a range of target_speed.*=2.0"),
    (RAIL, {"target_seconds": (1.0, 2.0)}, "target_seconds: expected .*target_speed.*=None"),
    (LEG, {"friction_slow": 1e-4, "friction_law": "tanh"}, "friction_slow: .* friction_law='ambrosio'"),
    (FIXED, {"baumgarte_alpha": 5.0}, "baumgarte_alpha: expected solver='paper'.*got solver='exact'"),
    (RAIL, {"randomize": {"trunk_share": 0.5}}, "randomize: 'trunk_share': expected trunk='suspended'"),
]
"""Arguments without effect: id, arguments, words."""

SIZES = [
    (env_id, *row)
    for env_id in (LEG, HORSE)
    for row in (
        ({"width": 100}, "width: expected .*480 .*got 100"),
        ({"height": 10_000}, "height: expected .*8192, got 10000"),
    )
]
"""Sizes of pictures."""

DISTURBANCES = [
    (LEG, {"noise": {"target": 0.1}}, "noise: expected .*groups .*observed"),
    (LEG, {"noise": 0.1}, "noise: expected a mapping"),
    (LEG, {"bias": {"trunk": -0.1}}, r"bias\['trunk'\]: expected .*number"),
    (LEG, {"noise": {"trunk": NAN}}, r"noise\['trunk'\]: expected"),
    *((LEG, {"strength": value}, "strength: expected") for value in (11.0, True, np.array(True), "1", 1j)),
    (LEG, {"push_seconds": (1.0, 2.0)}, "push_seconds: expected a push_impulse"),
    (LEG, {"push_impulse": 10.0, "push_seconds": 0.001}, r"push_seconds\[0\]: expected"),
    (LEG, {"push_impulse": (3.0, -3.0)}, r"push_impulse\[1\]: expected"),
    (LEG, {"push_impulse": 3.0, "pushes": [[1.0, 2.0, 0.0]]}, "pushes: expected none .*push_impulse"),
    (LEG, {"pushes": [[1.0, 2.0]]}, r"pushes\[0\]: expected \[s, N s forward, N s upward\]"),
    (LEG, {"pushes": [[10.0, 2.0, 0.0]]}, r"pushes\[0\], time: expected"),
    (RAIL, {"pushes": [[1.0, 2.0, 1.0]]}, "pushes: expected no impulse upward .*rail"),
    (LEG, {"push_impulse": 2e5}, r"push_impulse\[0\]: expected .*\[-100000, 100000\]"),
    (
        LEG,
        {"pushes": [[1.0, 9e4, 0.0], [1.0, 9e4, 0.0]]},
        r"pushes\[1\], impulse: expected .*in",
    ),
    (FIXED, {"noise": {"trunk": 0.1}}, "noise: nothing of 'trunk' is observed on a fixed trunk"),
    (FIXED, {"bias": {"trunk": 0.1}}, "bias: nothing of 'trunk' is observed on a fixed trunk"),
    (FIXED, {"push_impulse": 3.0}, "push_impulse: expected"),
    (FIXED, {"pushes": [[0.5, 2.0, 0.0]]}, "pushes: expected"),
    (FIXED, {"solver": "paper", "pushes": [[0.5, 2.0, 0.0]]}, "pushes: expected"),
]
"""Noise, pushes and how strong they are."""

DELAYS = [
    *(
        (LEG, given, words)
        for given, words in (
            ({"action_delay": 500.0}, r"action_delay: expected .*\[0, 499\]"),
            ({"observation_delay": -1}, "observation_delay: expected"),
            (
                {"observation_delay": 0.51},
                "observation_delay: expected a whole number of substeps, .*control step has 20",
            ),
            ({"action_delay": (0.5, 1)}, "action_delay: expected .*range"),
            ({"action_delay": (2, 1)}, r"action_delay\[1\]: expected"),
            ({"observation_history": 0}, "observation_history: expected .*1 or more"),
            ({"last_actions": 1.5}, "last_actions: expected .*number"),
            ({"privileged": ["nothing"]}, "privileged: expected .*of"),
            ({"privileged": "trunk"}, "privileged: expected .*of"),
            ({"privileged": 3}, "privileged: expected .*of"),
            ({"privileged": None}, "privileged: expected .*of"),
            (
                {"privileged": ["target"], "target_speed": None},
                "privileged: 'target' is constant without target_speed",
            ),
            ({"privileged": ["ground"]}, "privileged: 'ground' is constant without terrain"),
            ({"episode_seconds": 0.02, "action_delay": 1}, "action_delay: expected"),
        )
    ),
    (FIXED, {"privileged": ["trunk"]}, "privileged: nothing of 'trunk' is observed on a fixed trunk"),
    (FIXED, {**PAPER, "last_actions": 1, "action_delay": 0.5}, "whole steps"),
]
"""Delays, and what is observed besides."""

SCHEDULES = [
    (
        LEG,
        {"schedule": {"dt": [1, 2, 3]}},
        r"schedule: expected .*strength, .*, got \{'dt'",
    ),
    (LEG, {"schedule": [1, 2]}, r"schedule: expected a mapping"),
    (
        LEG,
        {"schedule": {"strength": [0, 1]}},
        r"schedule\['strength'\]: expected \[first, last, control steps\], got",
    ),
    (LEG, {"schedule": {"strength": [0, 11, 5]}}, r"schedule\['strength'\], last: expected .*10.*, got 11"),
    (
        LEG,
        {"schedule": {"strength": [0, 1, 0]}},
        r"schedule\['strength'\], control steps: expected .*, got 0",
    ),
    (
        LEG,
        {"schedule": {"strength": [0, 1, 2.5]}},
        r"schedule\['strength'\], control steps: expected .*, got 2.5",
    ),
    (LEG, {"schedule": {"friction": [0.5, -0.1, 5]}}, r"friction: expected .*, got -0.1"),
    (LEG, {"schedule": {"friction": [NAN, 0.1, 5]}}, r"schedule\['friction'\], first.*expected .*, got nan"),
    (
        LEG,
        {"schedule": {"target_speed": [1.0, [3.0, 2.0], 5]}},
        r"schedule\['target_speed'\], last: target_speed",
    ),
    (
        LEG,
        {"schedule": {"target_speed": [1.0, 21.0, 5]}},
        r"schedule\['target_speed'\], last: target_speed\[0\]: expected .*\[-20, 20\], got 21",
    ),
    (
        LEG,
        {"schedule": {"motor_gain": [50.0, 90.0, 5]}},
        r"schedule\['motor_gain'\], first.*expected drive='motor'",
    ),
    (
        LEG,
        {"schedule": {"friction": [0.1, 0.2, 5]}, "randomize": {"friction": (0.2, 0.3)}},
        r"schedule\['friction'\]: expected none together with randomize",
    ),
    (
        RAIL,
        {"schedule": {"target_speed": [1.0, 2.0, 5]}},
        r"schedule.*expected a target_speed .*got None",
    ),
]
"""Changes of settings over control steps."""

LEGS = [(HORSE, {"preset": "klann"}, "preset: expected a leg .*paper's mechanism .*got preset klann")]
ROWS = [
    *((env_id, *row) for env_id, rows in SETTINGS.items() for row in rows),
    *(row for rows in (EFFECTS, SIZES, DISTURBANCES, DELAYS, SCHEDULES, LEGS) for row in rows),
]
NAMES = [f"{row[0][9:]}-{row[1]}"[:90] for row in ROWS]


@pytest.mark.parametrize("make", [gym.make, gym.make_vec], ids=["single", "vector"])
@pytest.mark.parametrize(("env_id", "kwargs", "words"), ROWS, ids=NAMES)
def test_settings(make, env_id, kwargs, words):
    with pytest.raises(ParameterError, match=words):
        make(env_id, **kwargs)


MANY = [
    *(({"num_envs": n}, "num_envs: expected .*1 .*got") for n in (0, -1, 1.5, True)),
    ({"num_envs": 10**9}, "num_envs: expected .*1e.06, got 1000000000"),
    ({"autoreset_mode": "LATER"}, "autoreset_mode: expected .*NEXT_STEP, SAME_STEP, DISABLED, got"),
    (
        {"autoreset_mode": None},
        "autoreset_mode: expected .*NEXT_STEP, SAME_STEP, DISABLED, got None",
    ),
    ({"autoreset_mode": []}, r"autoreset_mode: expected .*got \[\]"),
    ({"max_episode_steps": 0}, "max_episode_steps: expected .*1 .*got 0"),
    ({"max_episode_steps": 2.5}, "max_episode_steps: expected .*1 .*got 2.5"),
    ({"render_mode": "human"}, "render_mode: expected .*rgb_array, got 'human'"),
    ({"render_mode": "rgb_array", "rendered": 0}, "rendered: expected .*1 .*got 0"),
    ({"render_mode": "rgb_array", "rendered": 3}, "rendered: expected .*num_envs=2, got 3"),
    (
        {"render_mode": "rgb_array", "num_envs": 17},
        "rendered: expected .*17 environments to draw, .*record_first_only=True",
    ),
    *(({"num_threads": k, "num_envs": 40}, "num_threads: expected.*got") for k in (0, 9, 2.0)),
]
"""Arguments that many at once have besides."""


@pytest.mark.parametrize(("kwargs", "words"), MANY, ids=str)
def test_settings_of_many_at_once(kwargs, words, monkeypatch):
    monkeypatch.setattr(threads, "available", lambda: 8)
    with pytest.raises(ParameterError, match=words):
        gym.make_vec(LEG, **{"num_envs": 2, **kwargs})


def without(name):
    return {key: value for key, value in CONTENT.items() if key != name}


PRESETS = [
    (without("provenance"), "expected an entry 'provenance' .*where"),
    (
        without("geometry"),
        "expected an entry 'geometry' .*found provenance, ",
    ),
    (without("gaits"), "expected .*'gaits' .*gait, got None"),
    (without("ground"), "expected an entry 'ground' .*stiffness .*exponent .*gaits"),
    ({**CONTENT, "gait": {}}, "unknown entries gait; expected .*provenance, units, geometry"),
    ({**CONTENT, "geometry": {**CONTENT["geometry"], "colour": "bay"}}, "geometry: .*; unknown colour"),
    ({**CONTENT, "gaits": {"trot": {"speed": 1.0}}}, "gait 'trot': expected crank_speed.*'speed'"),
    (
        {**CONTENT, "gaits": {"trot": {**CONTENT["gaits"]["walk"], "higher": [0.1, 0.05]}}},
        "gait 'trot': expected the four parameters .*harmonic, .*, got HarmonicGait",
    ),
    ({**CONTENT, "ground": {"softness": 1.0}}, "ground: .* only the entries stiffness, exponent"),
    ({**CONTENT, "geometry": {**CONTENT["geometry"], "lengths": {"OP": 1.0}}}, "lengths: .*missing AJ, "),
]
"""Contents of presets."""


@pytest.mark.parametrize(("content", "words"), PRESETS)
def test_presets(tmp_path, content, words):
    """The error is of the argument, or of the file."""
    with pytest.raises(ParameterError, match=words):
        gym.make(LEG, preset=content, stiffness=None)
    path = tmp_path / "mine.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises((DataFileError, ParameterError), match=words) as caught:
        gym.make(LEG, preset=path, stiffness=None)
    assert "mine.json" in str(caught.value) or "lengths" in words


def made(env_id, **settings):
    return lambda: gym.make(env_id, **settings)


OTHER_DOORS = [
    *(
        (
            lambda env_id=env_id: Sb3VecEnv(env_id, 2),
            "env_id: expected an id .*once",
        )
        for env_id in ("CartPole-v1", "Nobodys-v0", "no_such_module:Leg-v0")
    ),
    (lambda: Sb3VecEnv(MO, 2), "env_id: expected an id with one number for a reward, got .*MO-v0"),
    (lambda: Sb3VecEnv(LEG, 2, trunck="rail"), "unexpected keyword argument 'trunck'; did you mean trunk"),
    (
        lambda: Sb3VecEnv(LEG, 2, autoreset_mode="NEXT_STEP"),
        "autoreset_mode: expected SAME_STEP, got 'NEXT_STEP'",
    ),
    (made(MO, width=100), "width: expected .*480 .*got 100"),
    (made(MO, height=10_000), "height: expected .*8192, got 10000"),
    (
        lambda: RandomizeParameters(gym.make("Pendulum-v1"), {}),
        "env: expected a leg .*got Pendulum",
    ),
    *(
        (lambda env_id=env_id, ranges=ranges: RandomizeParameters(gym.make(env_id), ranges), words)
        for env_id, ranges, words in (
            (LEG, {"wings": 2}, r"options\['parameters'\]: expected .*trunk_mass"),
            (LEG, {"trunk_mass": (-5.0, 10.0)}, r"trunk_mass: expected.*got -5.0"),
            (
                RAIL,
                {"trunk_damping": (1.0, 2.0)},
                r"options\['parameters'\]: 'trunk_damping': expected trunk='suspended', without",
            ),
        )
    ),
    (
        lambda: RandomizeParameters(gym.make(LEG), {}, enabled="no"),
        "enabled: expected True or False, got 'no'",
    ),
]
"""Calls of the adapter for Stable-Baselines3, of the wrapper, and of the id with a vector reward."""


@pytest.mark.parametrize(("call", "words"), OTHER_DOORS, ids=[words for _, words in OTHER_DOORS])
def test_other_doors(call, words):
    with pytest.raises(ParameterError, match=words):
        call()

"""What an environment finds has the same bits however it is run: alone, as a row of few or many, on any
number of threads, as a copy, and from a state that was put back or elsewhere.

A matrix: what is run (`CASES`), how episodes begin again, and the way of running it (`Way`). Each cell goes
through the same episodes with the same actions as single environments do under Gymnasium's own vector
environment, and must find in each row what they find. A new id or feature is a row of `CASES`.
"""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from family import FALLS, HORSE, HORSES, IDS, LEGS, MODES, actions, same, same_rows
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from hoof_env.simd import threads

LEG, FIXED, OWN = "hoof_env/HorseLeg-v0", "hoof_env/HorseLegFixed-v0", "own/Everything-v0"
HOPS = tuple(f"hoof_env/HorseLeg{name}-v0" for name in ("Hop", "Balance", "BalanceSpeed"))


@dataclass(frozen=True)
class Case:
    """Case that is run.

    Attributes:
        env_id: id.
        settings: arguments of `gymnasium.make`; episodes end within the steps.
        options: options of the first reset.
        steps: control steps.
        alone: number of single environments that the rows are compared with.
        sizes: numbers of rows and threads; rows beyond the single ones are compared with those on one thread.
        ends: least number of episodes of the single ones that end.
        halves: ways how episodes begin again with which copies are made half-way and states are put back.
    """

    env_id: str
    settings: dict[str, Any]
    options: dict[str, Any] | None = None
    steps: int = 40
    alone: int = 9
    sizes: tuple[tuple[int, int], ...] = ((1, 1), (7, 1), (65, 1), (65, 3))
    ends: int = 18
    halves: tuple[AutoresetMode, ...] = ()

    @property
    def most(self) -> int:
        """The largest number of rows."""
        return max(rows for rows, _ in self.sizes)


def short(**settings: Any) -> dict[str, Any]:
    """Settings with episodes of 15 steps."""
    return {"episode_seconds": 0.3, **settings}


def drawn(mass: float) -> dict[str, Any]:
    """Settings of which each episode draws some."""
    return short(randomize={"trunk_mass": (0.8 * mass, 1.2 * mass), "friction": (0.2, 0.8)})


HILLS = {"kind": "hills", "seed": 3, "stiffness": [0.25, 2.0]}
GROUPS = ["crank", "gait", "trunk", "hoof", "target", "ground"]
COMMANDS = {"target_speed": (0.5, 3.0), "target_seconds": (0.02, 0.1)}
PAPER = {"solver": "paper", "gait": "run", "episode_seconds": 0.22}
ALL = tuple((rows, threads) for rows in (1, 3, 7, 8, 9, 65, 100, 200) for threads in (1, 2, 3, 8))
"""One by one up to 8, then in groups of lanes with idle ones among them."""

FEW = tuple((65, threads) for threads in (1, 2, 3, 8))
AGAIN = tuple(MODES[:2])
"""The ways how episodes begin again by themselves."""

COPIED: dict[str, Any] = {"halves": AGAIN, "steps": 26, "ends": 9}

UNTIL_STANCE = short(episode_seconds=0.9)
"""Episodes of a leg that starts near the apex of a hop."""

CASES = {
    **{env_id: Case(env_id, short(), sizes=ALL if env_id == LEG else FEW) for env_id in IDS},
    **{
        f"{env_id} drawn": Case(env_id, drawn(80.0), sizes=((1, 1),), **COPIED)
        for env_id in LEGS[1:]
        if env_id not in HOPS
    },
    **{
        f"{env_id} drawn": Case(env_id, drawn(80.0) | UNTIL_STANCE, sizes=((1, 1),), **COPIED | {"steps": 80})
        for env_id in HOPS
    },
    f"{LEG} drawn": Case(LEG, drawn(80.0), sizes=((40, 1),), **COPIED),
    f"{HORSE} drawn": Case(HORSE, drawn(400.0), sizes=((1, 1),), **COPIED),
    "falls": Case(LEG, FALLS, steps=80, ends=4),
    "commands": Case(LEG, short(**COMMANDS, observation=("crank", "hoof", "target"))),
    "motor": Case(LEG, short(drive="motor")),
    **{env_id: Case(env_id, UNTIL_STANCE, steps=110, sizes=FEW) for env_id in HOPS},
    "fixed trunk": Case(LEG, short(trunk="fixed")),
    "air walk": Case(FIXED, short(gait="walk")),
    "time limit": Case(LEG, {"max_episode_steps": 6}, steps=30),
    "all groups": Case(
        LEG, {**drawn(80.0), "target_speed": (0.5, 3.0), "terrain": {"kind": "hills"}, "observation": GROUPS}
    ),
    "soft hoof": Case(LEG, short(hoof_stiffness=4e4), halves=AGAIN),
    "own task": Case(OWN, short(), halves=AGAIN),
    "own task on hills": Case(OWN, short(terrain=HILLS, observation=["trunk", "feel", "watch"])),
    "paper's solver": Case(
        FIXED,
        PAPER,
        {"crank_angle": 1.5},
        steps=13,
        alone=3,
        sizes=((9, 2),),
        ends=3,
        halves=(AutoresetMode.DISABLED,),
    ),
}


@dataclass(frozen=True)
class Way:
    """How it is run.

    Attributes:
        rows: number of environments.
        threads: number of threads; 0 for single environments under Gymnasium's.
        half: what becomes of it half-way, a key of `HALVES`; empty for nothing.
    """

    rows: int
    threads: int = 1
    half: str = ""

    def __str__(self) -> str:
        on = {0: " alone", 1: ""}.get(self.threads, f" on {self.threads} threads")
        return f"{self.rows}{on}{', ' * bool(self.half)}{self.half}"


@pytest.fixture(autouse=True)
def many_processors(monkeypatch, own):
    """Threads are not bounded by the processors; and the own task is there."""
    monkeypatch.setattr(threads, "available", lambda: 8)


class Run:
    """Environments on their way through the steps of a case.

    Args:
        case: what is run.
        mode: how episodes begin again.
        way: how it is run.
    """

    def __init__(self, case: Case, mode: AutoresetMode, way: Way) -> None:
        self.case, self.mode, self.way = case, mode, way
        self.envs = self.made(way.threads)
        self.first = self.envs.reset(seed=3, options=case.options)
        self.steps = 0

    def made(self, num_threads: int) -> Any:
        """Environments that have not begun."""
        case = self.case
        if num_threads:
            more = {"num_threads": num_threads, "autoreset_mode": self.mode, **case.settings}
            return gym.make_vec(case.env_id, num_envs=self.way.rows, **more)
        makers = [lambda: gym.make(case.env_id, **case.settings)] * self.way.rows
        return SyncVectorEnv(makers, autoreset_mode=self.mode)

    def step(self) -> Found:
        """Go on by one step, with a reset by hand where there is no other, and ask the rows now and then."""
        k, n = self.steps, self.way.rows
        own_id = self.case.env_id if self.case.env_id in IDS else LEG
        taken = actions(k, 200, env_id=own_id)[:n]
        step, reset = self.envs.step(taken), None
        done = step[2] | step[3]
        if self.mode == AutoresetMode.DISABLED and done.any():
            seeds = None if k % 2 else [7 * k + row for row in range(n)]
            reset = self.envs.reset(seed=seeds, options={"reset_mask": done, "x": 0.25})
        self.steps += 1
        return Found(step, reset, self.answers() if k % 10 == 9 else {}, done)

    def answers(self) -> dict[str, tuple[Any, ...]]:
        """Answers of each row, and the record of the first one."""
        asked: list[tuple[str, ...]] = [("weight",), ("episode_summary",), ("raw_observation",)]
        if self.case.env_id not in HORSES:
            asked.append(("action_for", "run"))
        found = {question[0]: self.envs.call(*question) for question in asked}
        if not self.way.half:
            record = self.envs.record(0) if self.way.threads else self.envs.envs[0].unwrapped.record()
            found["record"] = (record,)
        return found

    def rest(self) -> list[Found]:
        """All steps up to the last."""
        return [self.step() for _ in range(self.case.steps - self.steps)]

    def check_rest(self, expected: list[Found]) -> None:
        """Go on to the end; raise unless the rows find what is expected."""
        for one, other in zip(self.rest(), expected, strict=True):
            one.check(other, self.way.rows)


@dataclass(frozen=True)
class Found:
    """Results of a step, the reset by hand after it or None, answers of rows, and the episodes that ended."""

    step: tuple[Any, ...]
    reset: tuple[Any, ...] | None
    answers: dict[str, tuple[Any, ...]]
    done: np.ndarray

    def check(self, expected: Found, rows: int) -> None:
        """Raise unless the first rows equal the expected ones."""
        same_rows(self.step, expected.step, rows)
        if self.reset and expected.reset and expected.done[:rows].any():
            same_rows(self.reset, expected.reset, rows)
        for name, answers in self.answers.items():
            same([*answers[:rows]], [*expected.answers[name][:rows]])


@lru_cache(maxsize=3)
def alone(name: str, mode: AutoresetMode) -> tuple[Any, list[Found]]:
    """Results of single environments, at the first reset and in each step."""
    case = CASES[name]
    run = Run(case, mode, Way(case.alone, 0))
    found = run.rest()
    assert sum(each.done.sum() for each in found) >= case.ends
    if case.env_id == FIXED and case.settings is not PAPER:
        return run.first, found  # whose episodes are too short to be sure of a contact
    told = [summary for each in found for summary in each.answers.get("episode_summary", ())]
    assert max(summary["duty_factor"] for summary in told) > 0
    return run.first, found


@lru_cache(maxsize=3)
def together(name: str, mode: AutoresetMode) -> tuple[Any, list[Found]]:
    """Results of the most rows on one thread, of which the first equal single environments'."""
    case = CASES[name]
    run = Run(case, mode, Way(case.most))
    found = run.first, run.rest()
    first, expected = alone(name, mode)
    same_rows(run.first, first, case.alone)
    for one, other in zip(found[1], expected, strict=True):
        one.check(other, case.alone)
    return found


def members(envs: Any) -> list[Any]:
    """Environments with a state: the vector one, or the single ones under Gymnasium's."""
    return list(envs.envs) if isinstance(envs, SyncVectorEnv) else [envs]


def observed(one: Any) -> np.ndarray:
    """The last observations, whatever called for them."""
    shape = one.observation_space.shape
    return one.unwrapped.batch.rows.observations[: shape[0] if len(shape) > 1 else 1].reshape(shape).copy()


def assembled(frame: Any, new: list[Any]) -> Any:
    """Other members, under a copy of Gymnasium's vector environment if they were under it."""
    if not isinstance(frame, SyncVectorEnv):
        return new[0]
    frame.envs = new
    return frame


Half = Callable[[Run], Callable[[], Any]]
"""Something that is done half-way, and gives environments that go on from there, once the others went on."""


def copied(again: Callable[[Any], Any]) -> Half:
    """Copies that are made half-way."""

    def half(run: Run) -> Callable[[], Any]:
        twins = [again(one) for one in members(run.envs)]
        frame = copy.deepcopy(run.envs)
        kept = [one.unwrapped.get_state() for one in members(run.envs)]

        def found() -> Any:
            same([twin.unwrapped.get_state() for twin in twins], kept)
            return assembled(frame, twins)

        return found

    return half


def put_back(others: Callable[[Run], Any]) -> Half:
    """States of half-way, which are put back into some environments."""

    def half(run: Run) -> Callable[[], Any]:
        frame = copy.deepcopy(run.envs)
        states = [one.unwrapped.get_state() for one in members(run.envs)]
        kept = [pickle.dumps(state) for state in states]
        seen = [observed(one) for one in members(run.envs)]

        def again() -> Any:
            assert [pickle.dumps(state) for state in states] == kept
            new = members(others(run))
            for one, state, before in zip(new, kept, seen, strict=True):
                same(one.unwrapped.set_state(pickle.loads(state)), before)
            return assembled(frame, new)

        return again

    return half


def others_of(run: Run) -> Any:
    """Environments on another number of threads, in another episode."""
    envs = run.made(num_threads=run.way.threads + (run.way.threads > 0))
    envs.reset(seed=9)
    return envs


HALVES: dict[str, Half] = {
    "deepcopy": copied(copy.deepcopy),
    "pickle": copied(lambda env: pickle.loads(pickle.dumps(env))),
    "state put back": put_back(lambda run: run.envs),
    "state elsewhere": put_back(others_of),
}


def ways_of(case: Case, mode: AutoresetMode) -> Iterator[Way]:
    """The ways of a case: as many rows as there are single environments, all other sizes, and each half."""
    yield Way(case.alone)
    if mode in AGAIN:
        yield from (Way(n, k) for n, k in case.sizes if (n, k) != (case.alone, 1))
    if mode in case.halves:
        kinds = [(3, 0), (3, 1)]
        if case.settings is not PAPER:
            kinds += [(9, 1), *([(40, 4)] if case.env_id == LEG else [])]
        yield from (Way(n, k, half) for n, k in kinds for half in HALVES)


def cells() -> Iterator[Any]:
    """The cells as parameters of pytest."""
    for name, case in CASES.items():
        for mode in MODES:
            for way in ways_of(case, mode):
                short_name = name.removeprefix("hoof_env/").replace("-v0", "")
                yield pytest.param(name, mode, way, id=f"{short_name}-{mode.name}-{way}")


@pytest.mark.parametrize(("name", "mode", "way"), [*cells()])
def test_each_row_is_a_single_environment(name, mode, way):
    case = CASES[name]
    first, expected = (together if way.rows > case.alone else alone)(name, mode)
    run = Run(case, mode, way)
    same_rows(run.first, first, way.rows)
    half = min(15, case.steps // 2) if way.half else 0  # after 15 steps, NEXT_STEP is about to begin again
    for k in range(half):
        run.step().check(expected[k], way.rows)
    again = HALVES[way.half](run) if way.half else None
    run.check_rest(expected[half:])
    if again:
        run.envs, run.steps = again(), half
        run.check_rest(expected[half:])

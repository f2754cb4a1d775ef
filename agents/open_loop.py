"""Gaits without feedback, optimised by CMA-ES: the strongest policies that need no learning and see nothing.

    python -m agents.open_loop                                             mean return on hoof_env/HorseLeg-v0
    python -m agents.open_loop --env-id hoof_env/HorseLegRail-v0 --family constant
    hoof-env evaluate run runs/open_loop/HorseLeg-v0-phase.json

Families (`hoof_env/envs/open_loop.py`): "constant", the paper's gaits, four numbers that are held; "phase",
gaits with harmonics of the crank angle, and of the command where there is one. An episode starts in a gait of
its own, and goes from there to the one that was found as fast as is allowed. With `drive=motor` a clock takes
the crank's place.

A search goes on until its last quarter gains less than a hundredth of what it gained over the zero action.
Searches start in turn from random points, from a gait that is known, and from that gait through easier
settings (`--easier`). The best of them is chosen by starts that none has met and scored with yet others, the
starts of `hoof-env evaluate`. The file is written after every search; searches in it are not repeated.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agents import runs
from agents.command import parse, parse_pairs, run
from agents.evolution import generations, make_strategy, mean_costs, require
from hoof_env._output import check_folder
from hoof_env.envs.open_loop import COMMAND, GAIT, SCALES, gait_file, open_loop, open_loop_record
from hoof_env.errors import DataFileError, HoofEnvError, ParameterError, check_number, parse_json
from hoof_env.evaluation.episodes import make_rows, play_rows
from hoof_env.evaluation.statistics import estimate
from hoof_env.gait import PARAMETERS

Floats = NDArray[np.float64]
Episodes = list[dict[str, float]]

# Frequencies of the clock [Hz]; the crank turns at 2 Hz at most
SLOWEST = 0.2
FASTEST = 4.0
# Candidates of a generation and random starts that each meets
POPULATION = 32
STARTS = 8
ROWS = POPULATION * STARTS
FINALISTS = 4  # candidates of a search that meet more starts at its end

STEP = 0.3
HARMONIC = 0.3
"""First standard deviation, and largest harmonic of the screening; the box of every number is 2 wide."""

EVERY = 8
"""Generations between two looks at the gain of a search."""

STALLED = 0.01
"""Share of the gain over the zero action below which the last quarter of a search ends it."""

TEST_SEED = 1000
SEARCH_SEED = 10_000_000
LOOK_SEED = 900_000_000
"""First seeds of the final score (as in `hoof-env evaluate`), of the searches, and of their progress."""

TOLERANCES = {"tolx": 1e-4, "tolfun": 0, "tolfunhist": 0, "tolstagnation": 10**9}
"""Options of CMA-ES that end a search when its steps are small, and for no other reason."""

EPISODES = {"constant": 10_240, "phase": 20_480}
MOST = 10
"""Least episodes of a search, by family, and the most of them in that unit by default."""

KEPT = (
    "return",
    "speed_m_s",
    "stance_peak_n",
    "loading_rate_n_s",
    "cost_of_transport",
    "highest_grf_n",
    "weight_share",
    "stances",
    "failed",
)
"""Figures of an episode that the file has the means of."""


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    env_id: str = "hoof_env/HorseLeg-v0"
    """registered environment of this package with many at once"""
    env_kwargs: tuple[str, ...] = ()
    """its arguments: key=value ..., or one JSON object; with reward_weights returns weigh otherwise"""
    family: Literal["constant", "phase"] = "phase"
    """of gaits"""
    harmonics: int | None = None
    """harmonics of the crank angle, for "phase"; otherwise 2 of a leg, 1 of a horse"""
    restarts: int = 3
    """searches, of seeds 0, 1, ..."""
    episodes: int | None = None
    """least of each search; otherwise 10240, or 20480 for "phase\""""
    most: int | None = None
    """most of each search; otherwise ten times the least"""
    easier: tuple[str, ...] = ("drive=motor",)
    """arguments of the environment in which every third search begins"""
    test_episodes: int = 512
    """of the final score, from seed 1000 on"""
    start: Path | None = None
    """file of a gait, where the second and third searches begin; otherwise the stored constant gait of the
    id, or the zero action of a horse"""
    step: float = STEP / 3
    """first standard deviation of a search from a gait that is known, where the box of every number is 2
    wide; a good gait in a narrow valley is lost by a large one"""
    out: Path | None = None
    """file; otherwise runs/open_loop/ENV-FAMILY.json"""


class Family(NamedTuple):
    """Layout of the numbers of a gait.

    Attributes:
        middle, half: middle and half range of g, shape (numbers,).
        powers: powers of the command, 1 without a command.
        harmonics: harmonics of the crank angle, 0 of constant gaits.
        clock: True if a frequency is searched as well.
    """

    middle: Floats
    half: Floats
    powers: int = 1
    harmonics: int = 0
    clock: bool = False

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape of the coefficients."""
        return self.powers, 1 + 2 * self.harmonics, len(self.half)

    @property
    def size(self) -> int:
        """Count of numbers of a gait."""
        return math.prod(self.shape) + self.clock

    def decode(self, x: Floats) -> dict[str, Floats]:
        """Convert points of [-1, 1], shape (..., size), to parameters of `open_loop`; the unit of every
        coefficient is half the range of its number."""
        coefficients = self.half * x[..., : math.prod(self.shape)].reshape(*x.shape[:-1], *self.shape)
        coefficients[..., 0, 0, :] += self.middle
        if self.shape[:2] == (1, 1):
            return {"constant": coefficients[..., 0, 0, :]}
        if not self.clock:
            return {"coefficients": coefficients}
        frequency = SLOWEST * (FASTEST / SLOWEST) ** ((x[..., -1] + 1) / 2)
        return {"coefficients": coefficients, "frequency_hz": frequency}

    def encode(self, parameters: dict[str, Any]) -> Floats:
        """Convert parameters of this family, or of a smaller one, to a point within the box; `ParameterError`
        if they are of another body."""
        given = np.asarray(parameters.get("coefficients", parameters.get("constant")), float)
        given = given.reshape(1, 1, -1) if given.ndim == 1 else given
        if given.shape[-1] != len(self.half):
            raise ParameterError(
                f"start: expected a gait of {len(self.half)} numbers, got {given.shape[-1]}, another body"
            )
        coefficients = np.zeros(self.shape)
        powers, rows, _ = np.minimum(self.shape, given.shape)
        coefficients[:powers, :rows] = given[:powers, :rows]
        coefficients[0, 0] -= self.middle
        point = (coefficients / self.half).ravel()
        if self.clock:
            # Of a gait without a clock, the frequency of its crank
            hertz = np.clip(parameters.get("frequency_hz", given[0, 0, 0] / (2 * math.pi)), SLOWEST, FASTEST)
            point = np.append(point, 2 * math.log(hertz / SLOWEST) / math.log(FASTEST / SLOWEST) - 1)
        return np.clip(point, -1.0, 1.0)


def family_of(env: Any, family: str, harmonics: int | None = None) -> Family:
    """Return the layout of a family for an environment, single and unwrapped."""
    body = env.unwrapped.body
    is_leg = env.action_form == "rates"
    middle, half = (body.middle, body.half) if is_leg else (np.zeros(8), np.ones(8))
    if family == "constant":
        if not is_leg:
            raise ParameterError(f"family: expected 'phase' for a horse, got {family!r}")
        return Family(middle, half)
    powers = 2 if COMMAND in env.observation_names else 1
    clock = env.settings.drive != "prescribed"
    return Family(middle, half, powers, (2 if is_leg else 1) if harmonics is None else harmonics, clock)


class Objective:
    """Costs of candidates of a family, from episodes in the rows of one vector environment.

    Attributes:
        env: a single environment with the same settings, unwrapped.
        envs: the vector environment.
        family: layout of the candidates.
        spent: episodes so far.
        blind: False where a gait may follow the crank of a motor, on the way to a blind one.

    Raises:
        ParameterError: there is no such environment, it has no native vector environment, or its actions are
            a map of the user's own.
    """

    def __init__(
        self, env_id: str, env_kwargs: dict[str, Any], family: str, harmonics: int | None = None
    ) -> None:
        env: Any = runs.make_env(env_id, **env_kwargs).unwrapped
        self.env = env
        # Before the batch, whose kernels would have to be compiled
        form = getattr(env, "action_form", None)
        if form is None or env.task.action_map:
            raise ParameterError(f"env_id: expected an id of this package with many at once, got {env_id!r}")
        self.family = family_of(self.env, family, harmonics)
        self.form = GAIT if form == "rates" else form
        envs = make_rows(env_id, ROWS, **env_kwargs)
        if envs is None:
            raise ParameterError(f"env_id: expected an id of this package with many at once, got {env_id!r}")
        self.envs = envs
        self.blind = True
        self.spent = 0

    def costs(self, x: Floats, seeds: Sequence[int]) -> list[float]:
        """Return minus the mean returns of candidates, shape (n, size), that meet the same starts; n *
        len(seeds) is `ROWS`."""
        parameters = self.family.decode(np.repeat(x, len(seeds), axis=0))
        episodes = self._play(parameters, [*seeds] * len(x))
        return mean_costs(np.array([episode["return"] for episode in episodes]), len(seeds))

    def zero(self, seeds: Sequence[int]) -> float:
        """Return the mean return of the zero action, the gait in which an episode starts."""
        from hoof_env.envs.policies import Scripted

        count = len(self.env.action_names)
        idle = Scripted(lambda observation, time: np.zeros(count, np.float32), self.env.dt)
        return float(np.mean([episode["return"] for episode in play_rows(self.envs, idle, seeds)]))

    def test(self, parameters: dict[str, Any], count: int) -> Episodes:
        """Return `count` episodes of the final score."""
        episodes: Episodes = []
        while len(episodes) < count:
            first = TEST_SEED + len(episodes)
            episodes += self._play(parameters, range(first, first + ROWS))
        return episodes[:count]

    def _play(self, parameters: dict[str, Any], seeds: Sequence[int]) -> Episodes:
        """Play an episode for each seed."""
        self.spent += len(seeds)
        return play_rows(self.envs, open_loop(parameters, self.env, self.blind), seeds)


@dataclass
class Search:
    """One search by CMA-ES.

    Candidates of a generation meet the same starts; the next generation and other searches meet others. At
    the end the distribution's mean, the luckiest candidate and the best of the last generation meet more.

    Attributes:
        objective: costs of candidates.
        seed: seed of the search and of its starts.
        least: episodes before it may end.
        most: episodes that end it.
        tick: called with a number of episodes and the lowest cost in them.
        step: first standard deviation of a search from a point.
        looks: episodes spent and mean return of the distribution's mean, over the same starts at each look.
        interrupted: True once Ctrl-C has ended it.
        stalled: True once its last quarter has gained too little.
    """

    objective: Objective
    seed: int
    least: int
    most: int
    tick: Callable[[int, float], Any]
    step: float = STEP / 3

    def __post_init__(self) -> None:
        self._generator = np.random.default_rng([self.seed, 6])
        self._fresh = SEARCH_SEED * (self.seed + 1)
        self._looked = range(LOOK_SEED, LOOK_SEED + ROWS)
        self.looks: list[tuple[int, float]] = []
        self.interrupted = False
        self.stalled = False

    def run(self, start: Floats | None = None) -> tuple[Floats, float]:
        """Search from a point of the box, or from the best of random points; return the best point and its
        cost over starts that the search had not met.

        Raises:
            KeyboardInterrupt: Ctrl-C came before anything was found.
        """
        step = STEP
        if start is None:
            start = self._screened()
        else:
            # A start that was found before needs a search around it only
            step = self.step
        floor = self.objective.zero(self._looked)
        strategy = make_strategy(
            start, step, POPULATION, int(self._generator.integers(1, 2**31)), **TOLERANCES
        )
        best = [start]
        first = self.objective.spent
        try:
            count = self.most // ROWS
            costs = lambda points: self._costs(points, STARTS)  # noqa: E731
            for k, (candidates, values) in enumerate(generations(strategy, costs, count)):
                lowest = [candidates[i] for i in np.argsort(values)[: FINALISTS - 2]]
                best = [strategy.result.xfavorite, strategy.result.xbest, *lowest]
                if k % EVERY == EVERY - 1:
                    self._look(strategy.result.xfavorite, first)
                    if self.looks[-1][0] >= self.least and stalled(self.looks, floor):
                        self.stalled = True
                        break
                if strategy.stop():
                    self.stalled = True
                    break
        except KeyboardInterrupt:
            self.interrupted = True
        # Rounded before the last score, so that the score belongs to the numbers in the file
        finalists = np.clip(np.round((best * FINALISTS)[:FINALISTS], 5), -1.0, 1.0)
        final = self._costs(finalists, ROWS // FINALISTS)
        return finalists[np.argmin(final)], min(final)

    def _costs(self, x: Any, starts: int) -> list[float]:
        """Return the costs of points over starts that nothing has met."""
        values = self.objective.costs(np.array(x), range(self._fresh, self._fresh + starts))
        self._fresh += starts
        self.tick(ROWS, min(values))
        return values

    def _screened(self) -> Floats:
        """Return the best of random points."""
        family = self.objective.family
        # A quarter of the starts for each point: many poor points are told from good ones by few episodes
        points = self._generator.uniform(-1, 1, (ROWS // 2, family.size))
        points[:, len(family.half) : math.prod(family.shape)] *= HARMONIC
        return points[np.argmin(self._costs(points, 2))]

    def _look(self, x: Floats, first: int) -> None:
        """Note the mean return of a point over starts that are the same at each look."""
        spent = self.objective.spent - first
        value = -self.objective.costs(np.clip(x, -1.0, 1.0)[None], self._looked)[0]
        self.looks.append((spent, value))


def stalled(looks: Sequence[tuple[int, float]], floor: float) -> bool:
    """True if the last quarter of a search has gained less than `STALLED` of its gain over `floor`."""
    spent = looks[-1][0]
    before = [value for count, value in looks if count <= 0.75 * spent]
    best = max(value for _, value in looks)
    return bool(before) and best - max(before) < STALLED * max(best - floor, 0.0)


def optimise(args: Args) -> dict[str, Any]:
    """Search, and write the file after every search; return its content.

    Raises:
        HoofEnvError: no CMA-ES is installed.
        DataFileError: the file is of something else.
        KeyboardInterrupt: Ctrl-C; the results so far are in the file.
    """
    episodes = check(args)
    from tqdm import tqdm

    path = place(args)
    kwargs = parse_pairs("--env-kwargs", args.env_kwargs)
    objective = Objective(args.env_id, kwargs, args.family, args.harmonics)
    about: dict[str, Any] = {
        "env_id": args.env_id,
        "env_kwargs": kwargs,
        "form": objective.form,
        "family": args.family,
        "harmonics": objective.family.harmonics,
        "objective": "return",
        "least_episodes_of_a_search": episodes,
        "most_episodes_of_a_search": args.most or MOST * episodes,
        "test_episodes": args.test_episodes,
        "easier": parse_pairs("--easier", args.easier),
        "start": known_gait(args),
        # Left out where it is usual, so that searches of earlier commits go on
        **({} if args.step == Args.step else {"step": args.step}),
    }
    restarts = earlier(path, about)
    check_folder(path.parent)
    done = {restart["seed"] for restart in restarts}
    left = [seed for seed in range(args.restarts) if seed not in done]
    with tqdm(total=episodes * len(left), unit=" episodes", leave=False, disable=None) as bar:
        for k, seed in enumerate(left):
            bar.set_description(f"{path.stem}, search {seed}")
            restarts.append(search_once(objective, seed, about, bar))
            write(path, about, objective, restarts)
            if restarts[-1].get("interrupted"):
                raise KeyboardInterrupt
            bar.n = (k + 1) * episodes  # it may have taken more, or converged before
    return write(path, about, objective, restarts)


def check(args: Args) -> int:
    """Check the arguments and return the least episodes of a search."""
    require("agents.open_loop", "cma", "tqdm")
    check_number("restarts", args.restarts, low=1, high=1000)
    check_number("step", args.step, low=0.0, high=1.0, exclusive_low=True)
    check_number("test_episodes", args.test_episodes, low=2, high=1e6)
    if args.harmonics is not None:
        check_number("harmonics", args.harmonics, low=1, high=8)
    episodes = args.episodes or EPISODES[args.family]
    check_number("episodes", episodes, low=3 * ROWS, high=1e7)
    if args.most is not None:
        check_number("most", args.most, low=episodes, high=1e8)
    return episodes


def known_gait(args: Args) -> dict[str, Any] | None:
    """Return the parameters where the second and third searches begin; None for no gait that is known."""
    if args.start:
        parameters: dict[str, Any] = open_loop_record(args.start)["parameters"]
        return parameters
    with suppress(DataFileError):
        if args.family != "constant":
            return open_loop_record(gait_file(args.env_id, "constant"))["parameters"]
    return None


def search_once(objective: Objective, seed: int, about: dict[str, Any], bar: Any) -> dict[str, Any]:
    """Search with one seed and return its entry of the file."""
    began = time.monotonic()
    used = time.process_time()
    objective.spent = 0
    family = objective.family
    is_horse = objective.form != GAIT

    def tick(count: int, lowest: float) -> None:
        bar.update(count)
        bar.set_postfix(cost=f"{lowest:.3f}")

    # The first of three from anywhere: a gait that is known may lie in a valley without the best
    start = None
    origin = "random"
    known = family.encode(about["start"]) if about["start"] else np.zeros(family.size)
    if seed % 3 or is_horse:
        start = known
        origin = "known gait" if about["start"] else "zero action" if is_horse else "middle"
    spent_before = 0
    if seed % 3 == 2 and about["easier"]:
        with suppress(HoofEnvError):  # settings that the id refuses are no way
            kwargs = about["env_kwargs"] | about["easier"]
            easier = Objective(about["env_id"], kwargs, about["family"], about["harmonics"] or None)
            easier.family = family
            easier.blind = family.clock  # a gait locked to the crank stays so: it is only a start
            least = about["least_episodes_of_a_search"]
            way = Search(easier, seed + 1000, least // MOST, least, tick)
            start, _ = way.run(start)
            origin += ", through easier settings"
            spent_before = easier.spent
    bounds = about["least_episodes_of_a_search"], about["most_episodes_of_a_search"]
    search = Search(objective, seed, *bounds, tick, about.get("step", Args.step))
    x, cost = search.run(start)
    parameters = {key: value.tolist() for key, value in family.decode(x).items()}
    return {
        "seed": seed,
        "origin": origin,
        "cost": cost,
        "parameters": parameters,
        "episodes": objective.spent + spent_before,
        "stalled": search.stalled,
        "looks": [[count, round(value, 3)] for count, value in search.looks],
        "wall_s": round(time.monotonic() - began, 1),
        "cpu_s": round(time.process_time() - used, 1),
        "mean": means(objective.test(parameters, about["test_episodes"])),
        **({"interrupted": True} if search.interrupted else {}),
    }


def means(episodes: Episodes) -> dict[str, float | None]:
    """Return the means of `KEPT`, None for one that is infinite."""
    keys = [key for key in KEPT if key in episodes[0]]
    figures = {key: float(np.mean([episode[key] for episode in episodes])) for key in keys}
    return {key: value if math.isfinite(value) else None for key, value in figures.items()}


def write(
    path: Path, about: dict[str, Any], objective: Objective, restarts: list[dict[str, Any]]
) -> dict[str, Any]:
    """Write the best of the searches, scored, and all of them; return the content of the file."""
    best = min(restarts, key=lambda restart: restart["cost"])
    episodes = objective.test(best["parameters"], about["test_episodes"])
    score: dict[str, Any] = {"first_seed": TEST_SEED, "mean": means(episodes), "interval95": {}}
    for key, mean in score["mean"].items():
        interval = estimate([restart[key] for restart in episodes]) if mean is not None else None
        score["interval95"][key] = [interval.low, interval.high] if interval else None
    gait = {}
    if "constant" in best["parameters"]:
        gait = {"gait": dict(zip(PARAMETERS, best["parameters"]["constant"], strict=True))}
    scales = objective.env.observation_scales
    content = {
        **about,
        "parameters": best["parameters"],
        **gait,
        "dt": objective.env.dt,
        **({SCALES: {COMMAND: scales[COMMAND]}} if objective.family.powers > 1 else {}),
        "score": score,
        "episodes": sum(restart["episodes"] for restart in restarts),
        **{key: round(sum(restart[key] for restart in restarts), 1) for key in ("wall_s", "cpu_s")},
        "command": runs.command(),
        "versions": {**runs.versions(), "cma": version("cma")},
        "restarts": restarts,
    }
    runs.write_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n")
    return content


def earlier(path: Path, about: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the searches of a file that were not interrupted, an empty list if there is no file;
    `DataFileError` if the file is of something else."""
    if not path.is_file():
        return []
    with suppress(OSError, ValueError, KeyError, TypeError, AttributeError):
        content = parse_json(path.read_text(encoding="utf-8"))
        if all(content.get(key) == value for key, value in about.items()):
            return [restart for restart in content["restarts"] if not restart.get("interrupted")]
    raise DataFileError(f"{path}: expected searches with {about} to go on with; name another --out")


def place(args: Args) -> Path:
    """Return the path of the file."""
    name = f"{args.env_id.rpartition('/')[2]}-{args.family}.json"
    return args.out or Path("runs/open_loop", name)


def main(argv: list[str] | None = None) -> None:
    """Search, and print the searches and the score."""
    args = parse(Args, argv, "python -m agents.open_loop", __doc__)
    content = optimise(args)
    for restart in content["restarts"]:
        end = "stalled" if restart["stalled"] else "most episodes spent"
        spent = f"{restart['episodes']} episodes, {restart['wall_s']:.0f} s, {end}"
        print(f"search {restart['seed']} from {restart['origin']}: cost {restart['cost']:.3f}, {spent}")
    for key, mean in content["score"]["mean"].items():
        bounds = content["score"]["interval95"][key]
        print(f"{key:18} " + (f"{mean:.3f} [{bounds[0]:.3f}, {bounds[1]:.3f}]" if bounds else "infinite"))
    print(f"written: {place(args)}")


if __name__ == "__main__":
    run(main)

"""Order of gaits by their return: does it prefer a gait with small forces, at a given speed?

    python -m agents.order                                    1,024 gaits of hoof_env/HorseLegHop-v0

Gaits are drawn about the gait in which an episode starts and the best constant gait of the id, with
harmonics of the crank angle. A gait counts if it lasts, travels at half a metre a second or more, and slides
for less than a tenth of the distance, so that it travels on its hoof. Of two gaits of the same speed a
biomechanist prefers the one with the smaller peak and the slower rise of the force: the partial rank
correlations of the return with both, at given speed, should be well below 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata

from agents.command import parse, run
from agents.open_loop import family_of
from agents.runs import make_env
from hoof_env.envs.open_loop import gait_file, open_loop, open_loop_record
from hoof_env.errors import ParameterError, check_number
from hoof_env.evaluation.episodes import make_rows, play_rows

Floats = NDArray[np.float64]

ROWS = 512
"""Gaits that are played at once."""

SPREADS = (0.01, 0.025, 0.05, 0.1, 0.175)
"""Standard deviations of the draws, in half ranges of a number."""

SLOWEST = 0.5
"""Least speed of a gait that travels [m/s]."""

SLIDING = 0.1
"""Largest share of the way for which it slides."""

FIGURES = ("stance_peak_n", "loading_rate_n_s", "slip_m", "cost_of_transport", "duty_factor")
"""Figures of an episode with which its return is correlated."""


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    env_id: str = "hoof_env/HorseLegHop-v0"
    """id of one leg whose episodes start in a gait of the task's own"""
    gaits: int = 1024
    """gaits that travel"""
    seed: int = 0
    """of the draws"""


def partial_rank_correlation(one: Floats, other: Floats, given: Floats) -> float:
    """Return the correlation of the ranks of two figures, shape (n,), without what the ranks of a third one
    explain of each."""
    ranks = [rankdata(values) for values in (one, other, given)]
    known = np.column_stack([np.ones(len(given)), ranks[2]])
    rest = [values - known @ np.linalg.lstsq(known, values, rcond=None)[0] for values in ranks[:2]]
    return float(np.corrcoef(*rest)[0, 1])


def travelling_gaits(env_id: str, count: int, seed: int, sliding: float = SLIDING) -> list[dict[str, float]]:
    """Draw gaits until `count` travel and slide for less than a share of their way; return the figures of
    their episodes.

    Raises:
        ParameterError: the task has no gait of its own to start in, or hardly any gait travels.
    """
    env: Any = make_env(env_id).unwrapped
    if "gait" not in getattr(getattr(env, "task", None), "start", ()):
        raise ParameterError(f"env_id: expected an id whose task starts in a gait of its own, got {env_id}")
    envs: Any = make_rows(env_id, ROWS)
    family = family_of(env, "phase", 2)._replace(clock=False)
    best = open_loop_record(gait_file(env_id, "constant"))["parameters"]
    known = np.array([family.encode({"constant": env.task.start["gait"].to_array()}), family.encode(best)])
    generator = np.random.default_rng(seed)
    found: list[dict[str, float]] = []
    for batch in range(100):
        share = generator.random((ROWS, 1))
        noise = generator.normal(size=(ROWS, family.size)) * generator.choice(SPREADS, (ROWS, 1))
        points = np.clip(share * known[0] + (1 - share) * known[1] + noise, -1.0, 1.0)
        policy = open_loop(family.decode(points), env, blind=False)
        episodes = play_rows(envs, policy, [seed + batch] * ROWS)
        found += [each for each in episodes if travels(each, sliding)]
        if len(found) >= count:
            return found[:count]
    raise ParameterError(f"env_id: expected an id on which gaits travel, got {len(found)} of {100 * ROWS}")


def travels(episode: dict[str, float], sliding: float = SLIDING) -> bool:
    """True for an episode that lasted, with travel of which less than a share slides."""
    slid = episode["slip_m"] * episode["stances"]
    fast = episode["speed_m_s"] >= SLOWEST
    return not episode["failed"] and fast and slid < sliding * episode["distance_m"]


def correlations(episodes: list[dict[str, float]]) -> dict[str, float]:
    """Return the partial rank correlation of the return with each of `FIGURES`, at given speed."""

    def column(name: str) -> Floats:
        return np.array([episode[name] for episode in episodes])

    speed = column("speed_m_s")
    return {name: partial_rank_correlation(column("return"), column(name), speed) for name in FIGURES}


def main(argv: list[str] | None = None) -> None:
    """Print the correlations."""
    args = parse(Args, argv, "python -m agents.order", __doc__)
    check_number("gaits", args.gaits, low=16, high=1e6)
    check_number("seed", args.seed, low=0)
    for name, value in correlations(travelling_gaits(args.env_id, args.gaits, args.seed)).items():
        print(f"{name:20} {value:6.2f}")


if __name__ == "__main__":
    run(main)

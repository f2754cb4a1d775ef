"""Open-loop gaits of a horse of four legs, found by CMA-ES: `python -m agents.open_loop --family four-legs`.

The horse is planar: two fore and two hind legs on a free trunk, with cited masses, springs at the hoofs and
prescribed cranks. A gait has one crank rate, how far the fore pair is ahead of the hind pair, and for each
pair the swing's coefficients and a first harmonic of the crank's speed over its angle; left and right are
half a stride apart. A candidate meets several perturbed starts. It pays for missing the speed, for stance
peaks, slip, work and pitch, and most for falling, the more the sooner.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.observables import stance_figures
from hoof_env.dynamics.parts import GRAVITY, HoofSpring, Limb, Limits, Prescribed, Trunk
from hoof_env.errors import HoofEnvError, check_number
from hoof_env.gait import QUICK
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.limb_masses import trunk_mass, with_limb_masses

Floats = NDArray[np.float64]

HIP_HEIGHT, MASS, GYRATION = 1.4, 475.0, 0.5  # [m], [kg], of the trunk about its centre [m]
HIPS = (1.0, -0.2)  # crank centres of the pairs, from the trunk's centre [m]
"""The leg stands half a metre behind its crank centre, so that the feet are 0.5 m before and 0.7 m behind."""

PITCH, HEIGHT, CLEARANCE = 0.5, (0.75, 1.8), 0.02  # where it has fallen: +-[rad], [m], of a joint [m]
DT, STEP, SECONDS, SETTLED = 0.02, 1e-3, 5.0, 1.0  # control and engine step, an episode, of that no part [s]
POPULATION, STARTS = 32, 4  # candidates of a generation, starts that all of them meet
GENERATIONS = 150
PEAK, SLIP, WORK, TILT, FALL, MISS = 0.35, 1.0, 0.5, 4.0, 10.0, 4.0
"""What costs: stance peaks [10 N/kg s], slip [m/s], work over weight and distance, pitch^2 [rad^2], a fall,
missing the speed over that speed."""

SLOWEST, FASTEST, MODULATION = 3.0, 9.0, 0.5  # of the crank's mean rate [rad/s]; of its harmonic over that
CENTRE = (1.05, 0.45, -0.7)  # swing: offset, sine, cosine, about which a search begins [rad]
SPANS = (0.5, 0.4, 0.4)  # of them [rad]
HIGHER = 0.3  # of the higher harmonics [rad]


def froude_speed(froude: float) -> float:
    """Speed [m/s] of a Froude number, v^2 / (g hip height). `ParameterError`: it is out of range."""
    check_number("froude", froude, low=0.003, high=7.0)
    return round(float(np.sqrt(froude * GRAVITY * HIP_HEIGHT)), 3)


def modulated(harmonic: Floats, theta: Floats) -> Floats:
    """Crank speed over its mean [-] with this first harmonic, cosine and sine on axis 1."""
    return np.asarray(1 + harmonic[:, 0] * np.cos(theta) + harmonic[:, 1] * np.sin(theta))


class Horse:
    """Many horses at once, which play gaits.

    Args:
        num_envs: how many.
        speed: that is asked for [m/s].
        harmonics: of the swing.
        spring: stiffness of the hoofs' springs [N/m].
        stiffness: of the ground, K [N/m^1.5].
    """

    def __init__(
        self, num_envs: int, speed: float, harmonics: int = 2, spring: float = 4e4, stiffness: float = 2e6
    ) -> None:
        leg = load_geometry()
        leg = leg.scaled(HIP_HEIGHT / leg.hip_height)
        springs = HoofSpring.with_ratio(spring, MASS / 4)
        limbs = [
            Limb(with_limb_masses(leg, limb, MASS), (hip, 0.0), Prescribed(), springs)
            for limb, hip in zip(("fore", "hind"), HIPS, strict=True)
            for _ in ("left", "right")
        ]
        mass = trunk_mass(MASS)
        trunk = Trunk("free", mass, drag=0.0, height=HIP_HEIGHT, pitch_inertia=mass * GYRATION**2)
        ground = Ground(stiffness=stiffness, restitution=0.5, approach_floor=0.1, friction=0.6)
        limits = Limits((-PITCH, PITCH), HEIGHT, CLEARANCE)
        self.engine = TrunkEngine(
            limbs, trunk, ground, sim_dt=STEP, num_envs=num_envs, num_threads=2, harmonics=harmonics,
            filters=QUICK, limits=limits, strides=True,
        )  # fmt: skip
        self.speed, self.harmonics = speed, harmonics

    @property
    def size(self) -> int:
        """Numbers of a gait: rate, lead, and of each pair a harmonic of the speed and the swing."""
        return 2 + 2 * (3 + 2 * self.harmonics)

    def decode(self, x: Floats) -> dict[str, Floats]:
        """Gaits from points of the box [-1, 1], shape (n, size): crank rate [rad/s] and lead of the fore pair
        [strides], shape (n,), the speed's harmonic (n, 2, 2) [-] and the swing's coefficients (n, 2, 1 + 2
        harmonics) [rad]."""
        pairs = x[:, 2:].reshape(len(x), 2, -1)
        spans = [*SPANS, *[HIGHER] * (2 * self.harmonics - 2)]
        centre = [*CENTRE, *[0.0] * (2 * self.harmonics - 2)]
        return {
            "rate": SLOWEST + (FASTEST - SLOWEST) * (x[:, 0] + 1) / 2,
            "lead": x[:, 1] / 2,
            "modulation": MODULATION * pairs[:, :, :2],
            "swing": centre + np.array(spans) * pairs[:, :, 2:],
        }

    def command(self, gaits: dict[str, Floats], theta: Floats) -> Floats:
        """Of all legs at these crank angles, shape (4, n); shape (4, 2 + 2 harmonics, n)."""
        found = np.empty((4, 2 + 2 * self.harmonics, theta.shape[1]))
        part = np.repeat(gaits["modulation"].transpose(1, 2, 0), 2, axis=0)
        even = 1 / np.sqrt(1 - np.minimum((part**2).sum(1), 0.9))  # so that a turn takes as long as without
        found[:, 0] = np.clip(gaits["rate"] * even * modulated(part, theta), 0.5, 4 * np.pi)
        found[:, 1:] = np.repeat(gaits["swing"].transpose(1, 2, 0), 2, axis=0)
        return found

    def angles(self, gaits: dict[str, Floats], phase: Floats) -> Floats:
        """Crank angles [rad] of legs so far through their turns in time, both of shape (4, n)."""
        part = np.repeat(gaits["modulation"].transpose(1, 2, 0), 2, axis=0)
        grid = np.linspace(0, 2 * np.pi, 257)
        slowness = 1 / modulated(part[..., None], grid)
        passed = np.cumsum(slowness[..., 1:] + slowness[..., :-1], axis=-1)
        found, at = np.empty_like(phase), np.concatenate([0 * passed[..., :1], passed], axis=-1)
        for leg, env in np.ndindex(*phase.shape):
            whole = at[leg, env]
            found[leg, env] = np.interp(phase[leg, env] % 1.0, whole / whole[-1], grid)
        return found

    def play(self, x: Floats, seed: int, starts: int = STARTS) -> dict[str, Floats]:
        """Episodes of the gaits x, shape (n, size), one an environment: the "cost" and figures by name, shape
        (n,); of the pairs shape (n, 2). `seed` perturbs so many starts, which come again and again."""
        rng, gaits, n = np.random.default_rng(seed), self.decode(x), len(x)
        noise = np.tile(rng.uniform(-1, 1, (7, starts)), -(-n // starts))[:, :n]
        whole, half = 0 * gaits["lead"], 0 * gaits["lead"] + 0.5
        phase = np.array([gaits["lead"], gaits["lead"] + half, whole, half]) + noise[0] / 2 + noise[1:5] / 60
        theta = self.angles(gaits, phase)
        command, engine = self.command(gaits, theta), self.engine
        start = {"vx": self.speed * (1 + 0.1 * noise[5]), "pitch": 0.03 * noise[6]}
        engine.reset(command, theta, y=5.0, **start)
        low = np.minimum(engine.report["toe_y"], engine.report["heel_y"]).min(0)
        engine.reset(command, theta, y=5.0 - low + 0.01, **start)
        fell, sums = np.full(n, SECONDS), dict.fromkeys(engine.strides, np.zeros((4, n)))
        tilt, began = np.zeros(n), np.zeros((5, n))
        settled = round(SETTLED / DT)
        for k in range(round(SECONDS / DT)):
            if k == settled:
                began = np.vstack([engine.report["x"], engine.state["theta"]])
            results = engine.advance(
                self.command(gaits, engine.state["theta"]), round(DT / STEP), account=False
            )
            fell = np.where((results != 0) & (fell == SECONDS), k * DT, fell)
            if k >= settled:
                sums = {name: total + engine.strides[name] for name, total in sums.items()}
                tilt += engine.state["pitch"] ** 2 * DT
            if (fell < SECONDS).all():
                break
        return self.figures(sums, tilt, fell, began)

    def figures(
        self, sums: dict[str, Floats], tilt: Floats, fell: Floats, began: Floats
    ) -> dict[str, Floats]:
        """See `play`. Of horses that fell only the cost says something."""
        seconds, state = SECONDS - SETTLED, self.engine.state
        speed = (self.engine.report["x"] - began[0]) / seconds
        turns = (state["theta"] - began[1:]) / (2 * np.pi)
        found = stance_figures(sums, seconds, turns)
        weight = MASS * GRAVITY
        work = sums["positive_work"].sum(0)
        peaks = sums["peak_increase"].sum(0) / MASS / 10 / seconds
        cost = MISS * np.abs(speed - self.speed) / self.speed + PEAK * peaks
        cost = cost + SLIP * sums["slip"].sum(0) / seconds + WORK * work / (weight * self.speed * seconds)
        cost = cost + TILT * tilt / seconds
        cost = np.where(
            fell < SECONDS, FALL * (2 - fell / SECONDS), np.minimum(np.nan_to_num(cost, nan=FALL), FALL)
        )
        pairs = {name: values.reshape(2, 2, -1).mean(1).T for name, values in found.items()}
        pairs["peak"], pairs["mean"] = pairs["peak"] / MASS, pairs["mean"] / MASS
        transport = work / (weight * np.maximum(np.abs(speed) * seconds, 1e-9))
        return {
            "cost": cost,
            "fell": (fell < SECONDS).astype(float),
            "speed": speed,
            "transport": transport,
        } | pairs


def search(
    horse: Horse, seed: int, generations: int, tick: Callable[[float], Any]
) -> tuple[Floats, float, int]:
    """One CMA-ES; returns the mean of its last distribution, its cost over starts that it had not met, and
    how many generations it had: fewer than asked for if Ctrl-C ended it. `KeyboardInterrupt`: before the
    first was over. `horse` has POPULATION * STARTS environments; `tick` takes the lowest cost."""
    try:
        import cma
    except ModuleNotFoundError:
        raise HoofEnvError('agents.open_loop needs cma: pip install "hoof-env[train,identify]"') from None
    options = {"bounds": [-1, 1], "popsize": POPULATION, "seed": seed + 1, "verbose": -9, "verb_log": 0}
    strategy, fresh, done = cma.CMAEvolutionStrategy(np.zeros(horse.size), 0.4, options), 0, 0

    def costs(points: Sequence[Floats]) -> list[float]:
        nonlocal fresh
        fresh += 1
        each = horse.play(np.repeat(points, STARTS, axis=0), 1000 * seed + fresh)["cost"]
        return [float(cost) for cost in each.reshape(len(points), STARTS).mean(1)]

    best = np.zeros(horse.size)
    try:
        for _ in range(generations):
            points = strategy.ask()
            values = costs(points)
            strategy.tell(points, values)
            best = np.clip(strategy.result.xfavorite, -1, 1)
            done += 1
            tick(min(values))
    except KeyboardInterrupt:
        if not done:
            raise
    rounded, each = np.round(best, 5), POPULATION * STARTS
    final = horse.play(np.tile(rounded, (each, 1)), 1000 * seed, each)["cost"]
    return rounded, float(np.mean(final)), done


def asked(
    speed: float, harmonics: int, spring: float, stiffness: float, episodes: int | None = None
) -> dict[str, Any]:
    """What searches are about, checked; `episodes` are of one search. `ParameterError`: out of range."""
    each = POPULATION * STARTS
    generations = int(check_number("episodes", episodes or GENERATIONS * each, low=each, high=1e8)) // each
    check_number("speed", speed, low=0.2, high=10.0)
    Horse(1, speed, harmonics, spring, stiffness)  # refuses what is no horse
    return {
        "family": "four-legs", "speed": speed, "harmonics": harmonics, "spring": spring,
        "stiffness": stiffness, "generations": generations,
    }  # fmt: skip


def optimise(
    about: dict[str, Any], restarts: int, found: list[dict[str, Any]], keep: Callable[[dict[str, Any]], Any]
) -> dict[str, Any]:
    """Search, with seeds that are not among those `found` already, and `keep` what there is after each.

    Returns:
        What was kept last: `about`, the searches, the best gait, and its figures over starts that none has
        met, pairs fore first: of those that did not fall, peak and mean force in stance [N/kg], duty, stances
        a turn, slip of a stance [m], braking and propulsion [N], speed [m/s] and cost of transport.

    Raises:
        ParameterError: `restarts` is out of range.
        HoofEnvError: no CMA-ES or no tqdm is installed.
        KeyboardInterrupt: Ctrl-C; a search that had begun is kept as "interrupted".
    """
    try:
        from tqdm import tqdm
    except ModuleNotFoundError:
        raise HoofEnvError('agents.open_loop needs tqdm: pip install "hoof-env[train,identify]"') from None
    check_number("restarts", restarts, low=1, high=1000)
    settings = (about[name] for name in ("speed", "harmonics", "spring", "stiffness"))
    horse, generations = Horse(POPULATION * STARTS, *settings), about["generations"]
    for seed in [seed for seed in range(restarts) if seed not in [one["seed"] for one in found]]:
        began = time.monotonic()
        with tqdm(total=generations, unit=" generations", leave=False, disable=None) as bar:

            def tick(lowest: float, bar: Any = bar) -> None:
                bar.update()
                bar.set_postfix(cost=f"{lowest:.2f}")

            x, cost, done = search(horse, seed, generations, tick)
        interrupted = {"interrupted": True} if done < generations else {}
        found.append(
            {"seed": seed, "cost": cost, "x": x.tolist(), "generations": done,
             "wall_s": round(time.monotonic() - began, 1), **interrupted}
        )  # fmt: skip
        keep(summary(horse, about, found))
        if interrupted:
            raise KeyboardInterrupt
    return summary(horse, about, found)


def summary(horse: Horse, about: dict[str, Any], found: list[dict[str, Any]]) -> dict[str, Any]:
    """See `optimise`."""
    each, best = POPULATION * STARTS, min(found, key=lambda one: one["cost"])
    test = horse.play(np.tile(best["x"], (each, 1)), 10**6, each)
    stood = test["fell"] == 0
    figures = {
        name: np.mean(values[stood], 0).round(4).tolist() for name, values in test.items() if stood.any()
    }
    figures["fell"] = float(test["fell"].mean())
    gait = {
        name: np.asarray(value[0]).round(5).tolist()
        for name, value in horse.decode(np.array([best["x"]])).items()
    }
    return {**about, "gait": gait, "figures": figures, "restarts": found}

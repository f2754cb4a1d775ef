"""How many harmonics a swing law needs for a horse's strokes.

    phi = offset + sum over k of A_k sin(k theta) + B_k cos(k theta),   theta the crank angle.

For each leg, number of harmonics, stroke and Froude number, the coefficients and the stance are fitted
together: in stance the hoof keeps level and moves back at the horse's speed, in swing it clears the ground.
What touches the ground is the lower one of toe and heel; where they change over, at one height, both have the
same horizontal speed. The stroke is how far the hip travels in stance. There the crank's speed follows from
the horse's, in swing from its bounds and the duty factor.
"""

from __future__ import annotations

import csv
import json
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares

from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.profile import by_name, leg_profile
from research.identify.leg import FIRST_FIT

Vector = NDArray[np.float64]

COEFFICIENTS = ("offset", "A1", "B1", "A2", "B2", "A3", "B3")  # [rad]

LEGS = {"first_fit": FIRST_FIT, "identified": "identified"}
HIP_HEIGHT, GRAVITY = 1.4, 9.81  # L [m], g [m/s^2]
STROKES = (0.95, 1.09)  # [m]
DUTY = {0.25: 0.62, 0.5: 0.47, 1.0: 0.39}  # of a horse, by Froude number v^2 / (g L) [-]
SPEED, SLOWEST, ACCELERATION, SWING_RATE = 4 * np.pi, 1.0, 100.0, 15.0  # crank and phi [rad/s], [rad/s^2]
LEVEL, DEVIATION, CLEARANCE = 0.03, 0.05, 0.03  # the bar: peak to peak [m], +-[-], [m]
STANCE, SWING = np.linspace(0, 1, 61), np.linspace(0, 1, 81)[1:-1]  # where a fit looks, in parts of either
ENTRIES, STARTS = 128, 40  # of the table of crank speeds; random starts of a case


class Leg:
    """Toe and heel of a leg scaled to the horse's hip height, by crank angle [rad]."""

    def __init__(self, preset: str) -> None:
        leg = load_geometry(preset)
        scale = HIP_HEIGHT / leg.hip_height
        leg = leg.replace(
            lengths={name: scale * length for name, length in leg.lengths.items()},
            pivot=tuple(scale * c for c in leg.pivot),
            hip_height=HIP_HEIGHT,
        )
        theta = np.linspace(0, 2 * np.pi, 1025)
        rows = by_name(leg_profile(leg)(theta)[0])
        z = np.stack([rows[f"{end}_x"] + 1j * rows[f"{end}_y"] for end in ("toe", "heel")], 1)
        z[-1] = z[0]
        self.place, self.side = CubicSpline(theta, z, bc_type="periodic"), leg.travel
        self.slope = self.place.derivative()

    def path(self, swing: Vector, theta: Vector) -> tuple[NDArray[np.complex128], Vector, Vector]:
        """The point of contact relative to the hip [m], its horizontal slope [m/rad] and phi's [-]."""
        k = np.arange(1, len(swing) // 2 + 1)
        sine, cosine = np.sin(np.outer(theta, k)), np.cos(np.outer(theta, k))
        phi = swing[0] + sine @ swing[1::2] + cosine @ swing[2::2]
        phi_slope = cosine @ (k * swing[1::2]) - sine @ (k * swing[2::2])
        turn, z = np.exp(1j * self.side * phi)[:, None], self.place(theta)
        slope = turn * (self.slope(theta) + 1j * self.side * phi_slope[:, None] * z)
        z = turn * z
        lower = (np.arange(len(theta)), z.imag.argmin(1))
        return z[lower], slope[lower].real, phi_slope


@dataclass(frozen=True)
class Case:
    """What is asked: stroke [m] and Froude number [-]. Without `clears` the swing may go into the ground, and
    the stance is to lie under the hip."""

    leg: Leg
    harmonics: int
    stroke: float
    froude: float
    clears: bool = True

    @property
    def speed(self) -> float:
        """The horse's speed [m/s]."""
        return float(np.sqrt(self.froude * GRAVITY * HIP_HEIGHT))

    def residuals(self, x: Vector, power: int) -> Vector:
        """What a fit keeps small; x: coefficients, crank angles of touch-down and of stance, height of O."""
        swing, (start, angle, height) = x[:-3], x[-3:]
        z, slope, _ = self.leg.path(swing, start + angle * STANCE)
        bend = np.diff(slope) / (angle * STANCE[1])
        back = np.maximum((-slope[1:] - slope[:-1]) / 2, 0.03)
        lift = self.leg.path(swing, start + angle + (2 * np.pi - angle) * SWING)[0].imag + height
        ramp = np.minimum(1, 20 * np.minimum(SWING, 1 - SWING))
        low = np.maximum(0, 0.43 * LEVEL * (2 * ramp - 1) + 1.2 * CLEARANCE * ramp - lift)
        off = np.concatenate([z.imag + height, self.clears * low]) / (0.4 * LEVEL)
        swing_time = self.stroke / self.speed * (1 / DUTY[self.froude] - 1)
        must = [
            [300 * (angle * np.trapezoid(-slope, STANCE) - self.stroke)],
            20 * np.maximum(0, 1.03 * self.speed / SPEED + slope),
            30 * np.maximum(0, self.speed**2 * np.abs(bend) / (0.95 * ACCELERATION) - back**3),
        ]
        wishes = [
            (0.5 if self.clears else 5) * (z[0] + z[-1]).real / 2,  # a stance under the hip
            0.3 * max(0, lift.max() - 0.3),
            0.3 * max(0, 2 * np.pi - 0.8 * SPEED * swing_time - angle),  # else the crank is late
            *(0.05 * swing[1:]),
        ]
        level = off * np.abs(off) ** (power - 1) / len(STANCE) ** 0.5
        return np.concatenate([level, *(each * 10 ** (power - 1) for each in must), wishes])

    def fit(self, known: list[Vector]) -> Vector:
        """The best of many starts: random ones and solutions of other cases."""
        rest = 2 * self.harmonics - 2
        low = np.array([-0.3, -0.9, -0.9, *[-0.4] * rest, -7.0, 0.6, 0.8])
        high = np.array([1.5, 0.9, 0.9, *[0.4] * rest, 14.0, 4.5, 1.6])
        rng, found = np.random.default_rng(0), []
        starts = [np.r_[x[:-3], np.zeros(len(low) - len(x)), x[-3:]] for x in known]
        spread = np.array([0.5, 0.5, 0.5, *[0.1] * rest])
        for _ in range(STARTS):
            swing = rng.uniform(-spread, spread) + 0.5 * (np.arange(len(spread)) == 0)
            starts.append(np.r_[swing, rng.uniform([0, 1.8, 1.0], [2 * np.pi, 3.5, 1.4])])
        for power, steps in ((1, 50), (3, 200)):  # the second weighs what is worst
            found = [
                least_squares(
                    self.residuals, np.clip(x, low, high), bounds=(low, high), args=(power,), max_nfev=steps
                )
                for x in starts
            ]
            starts = [each.x for each in sorted(found, key=lambda each: float(each.cost))[:6]]
        return starts[0]


def crank_speeds(case: Case, x: Vector) -> Vector:
    """Crank speed [rad/s] at `ENTRIES` equally spaced crank angles; between them its square is linear.

    The square changes by at most 2 `ACCELERATION` a radian. Within floors and caps there are a greatest and a
    least course of that slope; of their mixtures, the one nearest to the horse's duty factor is taken.
    """
    swing, (start, angle, _) = x[:-3], x[-3:]
    theta = np.linspace(0, 2 * np.pi, ENTRIES, endpoint=False)
    cell = theta[1]
    _, slope, phi_slope = case.leg.path(swing, theta)
    stands = (theta - start + cell) % (2 * np.pi) < angle + 2 * cell
    wanted = (case.speed / np.maximum(-slope, 0.02)) ** 2
    bound = np.minimum(SPEED, 0.99 * SWING_RATE / np.maximum(np.abs(phi_slope), 1e-9)) ** 2
    apart = np.abs(theta[:, None] - theta)
    reach = 1.999 * ACCELERATION * np.minimum(apart, 2 * np.pi - apart)
    for deviation in np.linspace(0, 0.5, 501):
        cap = np.where(stands, np.minimum(bound, wanted * (1 + deviation) ** 2), bound)
        floor = np.where(stands, np.minimum(bound, wanted * (1 - deviation) ** 2), SLOWEST**2)
        most, least = (cap + reach).min(1), (floor - reach).max(1)
        if (least <= most + 1e-9).all():
            break
    low, high, period = 0.0, 1.0, case.stroke / case.speed / DUTY[case.froude]
    for _ in range(40):
        share = (low + high) / 2
        rate = np.sqrt(most * share + least * (1 - share))
        if (2 * cell / (rate + np.roll(rate, -1))).sum() > period:
            low = share
        else:
            high = share
    return rate


def judge(case: Case, x: Vector, rate: Vector) -> dict[str, Any]:
    """The figures of a gait, from its coefficients and its table of crank speeds alone."""
    swing, (start, angle, _) = x[:-3], x[-3:]
    nodes = np.arange(ENTRIES + 1) * (2 * np.pi / ENTRIES)

    def speed(theta: Vector) -> Vector:
        return np.sqrt(np.interp(theta % (2 * np.pi), nodes, np.append(rate, rate[0]) ** 2))

    stance, flight = (np.linspace(a, b, 4001) for a, b in ((0.0, angle), (angle, 2 * np.pi)))
    z, slope, _ = case.leg.path(swing, start + stance)
    air = case.leg.path(swing, start + flight)[0].imag
    hoof = -slope * speed(start + stance) / case.speed - 1
    standing, passed = (
        np.r_[0, np.cumsum(np.diff(turned) / speed(start + (turned[1:] + turned[:-1]) / 2))]
        for turned in (stance, flight)
    )
    period = standing[-1] + passed[-1]
    middle = np.abs(passed / passed[-1] - 0.5) < 0.4
    turn = np.linspace(0, 2 * np.pi, 4001)
    top, bottom = z.imag.max(), z.imag.min()
    figures: dict[str, Any] = {
        "level_pp_cm": 100 * (top - bottom),
        "speed_deviation_percent": 100 * np.abs(hoof).max(),
        "clearance_cm": 100 * (air.max() - top),
        "lowest_in_swing_cm": 100 * (air.min() - bottom),
        "least_mid_swing_cm": 100 * (air[middle].min() - top),
        "duty": standing[-1] / period,
        "stride_s": period,
        "crank_min_rad_s": rate.min(),
        "crank_max_rad_s": rate.max(),
        "crank_acceleration_max_rad_s2": np.abs(np.diff(np.append(rate, rate[0]) ** 2)).max() / 2 / nodes[1],
        "swing_rate_max_rad_s": np.abs(case.leg.path(swing, turn)[2] * speed(turn)).max(),
        "stroke_m": -np.trapezoid(slope, stance),
        "touch_down_x_m": z[0].real,
        "lift_off_x_m": z[-1].real,
        "hip_over_ground_m": -(top + bottom) / 2,
    }
    met = {
        "stroke": abs(figures["stroke_m"] - case.stroke) < 0.001,
        "level": top - bottom <= LEVEL,
        "speed": figures["speed_deviation_percent"] <= 100 * DEVIATION,
        "clearance": figures["clearance_cm"] >= 100 * CLEARANCE and air.min() >= bottom,
        "crank": rate.max() <= SPEED + 1e-9
        and figures["crank_acceleration_max_rad_s2"] <= ACCELERATION + 1e-6
        and figures["swing_rate_max_rad_s"] <= SWING_RATE,
    }
    return figures | {"missed": " ".join(name for name, is_met in met.items() if not is_met)}


def draw(solved: list[tuple[str, Case, Vector]], path: Path) -> None:
    """The lowest point of the hoof over a turn, for the longest stroke at a walk."""
    figure = Figure(figsize=(9, 6.6), layout="constrained", dpi=110)
    for axes, name in zip(figure.subplots(len(LEGS), sharex=True), LEGS, strict=True):
        for leg, case, x in solved:
            if (leg, case.stroke, case.froude, case.clears) != (name, max(STROKES), min(DUTY), True):
                continue
            swing, (start, angle, _) = x[:-3], x[-3:]
            stance = case.leg.path(swing, start + angle * np.linspace(0, 1, 400))[0]
            ground = (stance.imag.max() + stance.imag.min()) / 2
            z, colour = case.leg.path(swing, np.linspace(0, 2 * np.pi, 800))[0], f"C{case.harmonics - 1}"
            z[1:][np.abs(np.diff(z)) > 0.03] = np.nan  # from heel to toe
            axes.plot(z.real, z.imag - ground, colour, lw=1)
            label = f"{case.harmonics} harmonic{'s' * (case.harmonics > 1)}"
            axes.plot(stance.real, stance.imag - ground, ".", color=colour, ms=3.5, label=label)
        axes.axhspan(-LEVEL / 2, LEVEL / 2, color="0.88", zorder=0)
        axes.axvline(0, color="0.7", lw=0.8, zorder=0)
        axes.set(aspect="equal", title=f"{name}: stance thick, band {100 * LEVEL:.0f} cm", ylim=(-0.1, 0.75))
        axes.set(xlabel="forward of the hip [m]", ylabel="over the stance line [m]")
        axes.legend(fontsize=8, loc="upper center")
    figure.savefig(path)


def strokes(out: Path = Path("runs/strokes")) -> None:
    """Fit all cases; write strokes.csv, gaits.json and paths.png to the folder `out`."""
    out.mkdir(parents=True, exist_ok=True)
    rows, gaits, solved = [], [], []
    for name, preset in LEGS.items():
        leg, known = Leg(preset), list[Vector]()
        asked = [*product((1, 2, 3), STROKES, DUTY, [True]), *product((1, 2, 3), [1.09], [0.25], [False])]
        for harmonics, stroke, froude, clears in asked:
            case = Case(leg, harmonics, stroke, froude, clears)
            x = case.fit([each for each in known if len(each) <= 2 * harmonics + 4][-8:])
            x[-3] %= 2 * np.pi
            known.append(x)
            solved.append((name, case, x))
            swing, rate = x[:-3].round(6), crank_speeds(case, x).round(5)
            about = {"leg": name, "harmonics": harmonics, "stroke": stroke, "froude": froude}
            figures = judge(case, np.r_[swing, x[-3:]], rate)
            terms = dict(zip(COEFFICIENTS, [*swing.tolist(), *[0.0] * (7 - len(swing))], strict=True))
            rows.append(about | {"swing_asked": clears} | figures | terms)
            print(*(v if isinstance(v, str | int) else f"{v:.4g}" for v in rows[-1].values()), flush=True)
            if clears:
                stance = {
                    "stance_start_rad": float(x[-3].round(6)),
                    "stance_angle_rad": float(x[-2].round(6)),
                }
                gaits.append(about | stance | {"coefficients": terms, "crank_speed_rad_s": rate.tolist()})
    with (out / "strokes.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(rows[0])
        writer.writerows([f"{v:.4g}" if isinstance(v, float) else v for v in row.values()] for row in rows)
    lines = ",\n".join(json.dumps(gait) for gait in gaits)
    (out / "gaits.json").write_text(f"[\n{lines}\n]\n", encoding="utf-8")
    draw(solved, out / "paths.png")


if __name__ == "__main__":
    tyro.cli(strokes)

"""What the search varies: a `Choice` of assembly and law, and for each choice a vector x of numbers.

Link 9 holds the upper leg from the crank pin P. Where it ends is garbled in print: at F in Jansen's linkage
(and in the product), at E, at an inner point Q of link 6 (D-E) or of link 7 (E-F). The swing of the leg's
frame is not printed either: about the crank centre O (and so in the product), about the pivot C, or none,
with the pivot on an ellipse instead. All but the first of each live in this search only, by kinematics alone.

x holds log lengths [m], the pivot [m], the hip's height [m] and the swing of both gaits [rad]; see `names`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import HoofEnvError, ParameterError, check_choice, check_number
from hoof_env.gait.parameters import LIMITS, GaitParameters
from hoof_env.leg.geometry import Geometry
from hoof_env.leg.linkage import DYADS, LENGTHS

LINK9 = ("F", "E", "6", "7")
SWINGS = ("crank", "pivot", "oval")
SIGNS = tuple(dyad.point for dyad in DYADS)
"""The points whose side of their dyad is a choice, in the order of `Choice.assembly`."""

SPEED = 2 * np.pi
"""The paper's crank speed in both gaits [rad/s]; not searched."""

Vector = NDArray[np.float64]

_SWING = ("swing_offset", "swing_sin", "swing_cos")
_OVAL = ("swing_offset", "oval_ahead_x", "oval_ahead_y", "oval_back_x", "oval_back_y")


@dataclass(frozen=True)
class Choice:
    """What a search cannot change continuously.

    Attributes:
        assembly: +1 or -1 for each of `SIGNS`, as `Geometry.assembly`. With link 9 at "E" or "6" the sign of
            F is that of the dyad C-F-E, the sign of E that of D-E-P or D-Q-P; at "7" both are unused and +1.
        toe: which hoof corner is the toe, "I" or "J"; the other is the heel.
        travel: +1 or -1, as `Geometry.travel`.
        link9: where link 9 ends: "F", "E", or "6", "7" for an inner point of that link.
        swing: "crank" turns the frame about O, "pivot" about C; "oval" moves C on an ellipse instead.
        exponent: n of Eq. 14, which the paper does not print [-]; 1.5 is Lankarani and Nikravesh's.

    Raises:
        ParameterError: another value.
    """

    assembly: tuple[int, ...]
    toe: str
    travel: int
    link9: str = "F"
    swing: str = "crank"
    exponent: float = 1.5

    def __post_init__(self) -> None:
        signs = tuple(self.assembly) if isinstance(self.assembly, Sequence) else ()
        if len(signs) != len(SIGNS) or any(sign not in (1, -1) for sign in signs):
            raise ParameterError(
                f"assembly: expected +1 or -1 for each of {', '.join(SIGNS)}, got {self.assembly!r}"
            )
        check_choice("toe", self.toe, ("I", "J"))
        if self.travel not in (1, -1):
            raise ParameterError(f"travel: expected +1 or -1, got {self.travel!r}")
        check_choice("link9", self.link9, LINK9)
        check_choice("swing", self.swing, SWINGS)
        object.__setattr__(self, "exponent", check_number("exponent", self.exponent, low=1, high=3))
        free = ("E", "F") if self.link9 == "7" else ()
        signs = tuple(1 if name in free else int(sign) for name, sign in zip(SIGNS, signs, strict=True))
        object.__setattr__(self, "assembly", signs)

    @property
    def heel(self) -> str:
        """The hoof corner that is the heel."""
        return "J" if self.toe == "I" else "I"

    @property
    def simulable(self) -> bool:
        """Whether the full system has this leg: link 9 at F and the frame swinging about O."""
        return self.link9 == "F" and self.swing == "crank"

    def to_dict(self) -> dict[str, Any]:
        """JSON-serialisable."""
        return {**asdict(self), "assembly": list(self.assembly)}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Choice:
        """Inverse of `to_dict`.

        Raises:
            ParameterError: an entry is missing, unknown or out of range.
        """
        try:
            return cls(**{**data, "assembly": tuple(data["assembly"])})
        except (KeyError, TypeError) as error:
            expected = "assembly, toe, travel, link9, swing, exponent"
            raise ParameterError(f"choice: expected {expected}, got {data!r}: {error}") from None


def _strut(choice: Choice) -> str:
    """Name of the length of link 9."""
    return {"F": "PF", "E": "PE", "6": "PQ", "7": "PQ"}[choice.link9]


def lengths_of(choice: Choice) -> tuple[str, ...]:
    """Names of the 15 lengths, those of `LENGTHS` with link 9 as it is."""
    return tuple(_strut(choice) if name == "PF" else name for name in LENGTHS)


def names(choice: Choice) -> tuple[str, ...]:
    """Names of the entries of x.

    "log OP" ... [log m], "pivot_x", "pivot_y", "hip_height" [m]; with link 9 at "6" or "7" "part", where Q
    lies from D to E or from E to F [-], and at "7" "angle_DE", "angle_CF", where Newton's method starts at
    theta = 0 [rad]; then for each gait "walk.swing_offset" ... [rad], and with an oval complex coefficients
    of exp(i theta) ("ahead") and exp(-i theta) ("back", the way the crank turns) [m].
    """
    link9 = {"6": ("part",), "7": ("part", "angle_DE", "angle_CF")}.get(choice.link9, ())
    law = _OVAL if choice.swing == "oval" else _SWING
    gaits = tuple(f"{gait}.{name}" for gait in ("walk", "run") for name in law)
    lengths = tuple(f"log {name}" for name in lengths_of(choice))
    return (*lengths, "pivot_x", "pivot_y", "hip_height", *link9, *gaits)


def standard_deviations(choice: Choice) -> Vector:
    """How far each entry of x ranges, beside one: the scales of a search, shape as x."""
    kinds = {"log": 1.0, "pivot_x": 0.6, "pivot_y": 0.6, "hip_height": 0.5, "part": 0.3, "angle_DE": 0.6}
    kinds |= {"angle_CF": 0.6, "swing": 0.6, "oval": 0.3}
    keys = (name.split(".")[-1] for name in names(choice))
    return np.array([kinds.get(key) or kinds[key.replace("_", " ").split()[0]] for key in keys])


def random_choice(
    rng: np.random.Generator,
    link9: Sequence[str] = ("F",),
    swing: Sequence[str] = ("crank",),
    exponent: float = 1.5,
) -> Choice:
    """A choice with every assembly, toe, travel and each of the given laws equally likely."""
    return Choice(
        tuple(int(sign) for sign in rng.choice([-1, 1], len(SIGNS))),
        str(rng.choice(["I", "J"])), int(rng.choice([-1, 1])), str(rng.choice(link9)), str(rng.choice(swing)),
        exponent,
    )  # fmt: skip


def random_start(choice: Choice, rng: np.random.Generator) -> Vector:
    """One x of a leg of a horse's size, seldom one that turns: take the best of many.

    Lengths are around 0.5 m within a factor of 1.6, the crank around 0.27 m; the swing's range covers the
    limits of the product's gaits.
    """
    low, high = LIMITS["swing_offset"]
    draws = {
        "log": lambda: rng.normal(-0.6, 0.5),
        "log OP": lambda: rng.normal(-1.3, 0.3),
        "pivot": lambda: rng.normal(0.0, 0.7),
        "hip": lambda: rng.uniform(1.2, 1.7),
        "part": lambda: rng.uniform(0.2, 0.8),
        "angle": lambda: rng.uniform(-np.pi, np.pi),
        "swing_offset": lambda: rng.uniform(low, high),
        "walk.swing": lambda: rng.normal(0.0, 0.2),
        "run.swing": lambda: rng.normal(-0.2, 0.4),
        "oval": lambda: rng.normal(0.0, 0.1),
    }

    def draw(name: str) -> float:
        key = name.split(".")[-1]
        for option in (name, key, name.rsplit("_", 1)[0], key.replace("_", " ").split()[0]):
            if option in draws:
                return float(draws[option]())
        raise KeyError(name)

    return np.array([draw(name) for name in names(choice)])


def encode(
    geometry: Geometry, walk: GaitParameters, run: GaitParameters, exponent: float = 1.5
) -> tuple[Choice, Vector]:
    """A leg and its two gaits, on a ground with this exponent, as (choice, x).

    Raises:
        ParameterError: a gait whose crank does not turn at the paper's speed.
    """
    for name, gait in (("walk", walk), ("run", run)):
        if abs(gait.crank_speed - SPEED) > 1e-9:
            raise ParameterError(
                f"{name}.crank_speed: expected the paper's {SPEED:.6f} rad/s, got {gait.crank_speed!r}"
            )
    signs = tuple(geometry.assembly[p] for p in SIGNS)
    choice = Choice(signs, geometry.toe, geometry.travel, exponent=exponent)
    logs = [np.log(geometry.lengths[name]) for name in LENGTHS]
    swings = [*walk.to_array()[1:], *run.to_array()[1:]]
    return choice, np.array([*logs, *geometry.pivot, geometry.hip_height, *swings])


@dataclass(frozen=True)
class Candidate:
    """x in plain words.

    Attributes:
        choice: what x belongs to.
        lengths: by name [m]. pivot: C relative to O [m].
        hip_height: height of the centre of the swing (O, or C with swing "pivot") above the ground [m].
        link9: "part", "angle_DE", "angle_CF", as far as the choice has them.
        gaits: for "walk" and "run" the numbers of the swing by name.
    """

    choice: Choice
    lengths: dict[str, float]
    pivot: tuple[float, float]
    hip_height: float
    link9: dict[str, float]
    gaits: dict[str, dict[str, float]]

    def geometry(self, name: str = "identified", provenance: str = "") -> Geometry:
        """The leg of the full system.

        Raises:
            HoofEnvError: the full system does not have this variant. GeometryError: the leg cannot turn.
        """
        choice = self.choice
        if not choice.simulable:
            raise HoofEnvError(
                f"link 9 at {choice.link9!r} with swing {choice.swing!r} lives in the search only: expected "
                "'F' and 'crank', which the full system can simulate"
            )
        return Geometry(
            lengths=self.lengths, pivot=self.pivot, assembly=dict(zip(SIGNS, choice.assembly, strict=True)),
            toe=choice.toe, heel=choice.heel, travel=choice.travel, hip_height=self.hip_height,
            name=name, provenance=provenance,
        )  # fmt: skip


def check_vector(x: Any, choice: Choice) -> Vector:
    """x as floats.

    Raises:
        ParameterError: another length than `names(choice)`, or a number that is not finite.
    """
    try:
        array = np.asarray(x, dtype=np.float64)
    except (TypeError, ValueError):
        raise ParameterError(f"x: expected {len(names(choice))} numbers, got {x!r}") from None
    if array.shape != (len(names(choice)),) or not np.isfinite(array).all():
        raise ParameterError(f"x: expected {len(names(choice))} finite numbers, got {x!r}")
    return array


def decode(x: Any, choice: Choice) -> Candidate:
    """The numbers of x by name.

    Raises:
        ParameterError: x does not fit the choice.
    """
    values = dict(zip(names(choice), check_vector(x, choice).tolist(), strict=True))
    gaits: dict[str, dict[str, float]] = {
        gait: {name.split(".")[1]: v for name, v in values.items() if name.startswith(f"{gait}.")}
        for gait in ("walk", "run")
    }
    return Candidate(
        choice=choice,
        lengths={name: float(np.exp(values[f"log {name}"])) for name in lengths_of(choice)},
        pivot=(values["pivot_x"], values["pivot_y"]),
        hip_height=values["hip_height"],
        link9={name: values[name] for name in ("part", "angle_DE", "angle_CF") if name in values},
        gaits=gaits,
    )


def to_preset(x: Any, choice: Choice, provenance: str, name: str) -> dict[str, Any]:
    """The content of a preset file, as those in `hoof_env/data`.

    Args:
        x, choice: the leg. provenance: where its numbers come from. name: used in errors.

    Raises:
        HoofEnvError: a variant that the full system does not have. GeometryError: the leg cannot turn.
        ParameterError: a gait outside the limits.
    """
    candidate = decode(x, choice)
    geometry = candidate.geometry(name, provenance).to_dict()
    kept = ("lengths", "pivot", "assembly", "toe", "heel", "travel", "hip_height")
    gaits = {gait: vars(GaitParameters(SPEED, **law)) for gait, law in candidate.gaits.items()}
    return {
        "provenance": provenance,
        "units": "m, rad, rad/s",
        "geometry": {key: geometry[key] for key in kept},
        "ground": {"exponent": choice.exponent},
        "gaits": gaits,
    }

"""Gaits of a horse, and the commands that maintain one: the zero action of `Horse-v0`.

A gait has one rate of the crank for all legs, a lead of the fore pair over the hind pair, and for each pair
the crank's speed and the leg's swing as harmonics of the crank's angle. Left and right are half a stride
apart. The speed within a stride is a function of the angle, not of time. Cranks that are out of step are
pulled back (Kuramoto 1984): the speed of each changes with the sine of its phase difference from the others,
by the part `COUPLING` at most.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib import resources
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import ParameterError, brief, check_choice, check_number
from hoof_env.gait import WIDEST
from hoof_env.simd import (
    Lanes,
    Mask,
    Plane,
    Pointer,
    Whole,
    any_lane,
    block_at,
    cross,
    dot,
    full_like,
    maximum,
    minimum,
    read,
    rounded,
    sqrt,
    vector,
    when,
    where,
)
from hoof_env.simd.layout import Block, Layout, Row, Vector
from hoof_env.simd.math import clip, cos_sin

Floats = NDArray[np.float64]

PAIRS = ("fore", "hind")
LEGS = ("left_fore", "right_fore", "left_hind", "right_hind")
"""Names of the legs, in the order of an engine's limbs."""

LIMITS = {
    # Below 1 / sqrt(2) each, so that the speed within a stride never changes its sign.
    "speed_cos": (-0.6, 0.6),
    "speed_sin": (-0.6, 0.6),
    "swing_offset": WIDEST["swing_offset"],
    "swing_sin": WIDEST["swing_sin"],
    "swing_cos": WIDEST["swing_cos"],
    "swing_sin_2": WIDEST["higher"],
    "swing_cos_2": WIDEST["higher"],
}
"""Lowest and highest value of each number of a pair: a harmonic of the crank's speed / its mean [-], and
offset and two harmonics of the swing [rad]."""

PAIR = tuple(LIMITS)
SWING = 5  # number of these that are about the swing
COUNT = len(LEGS)
ACTED = 4  # actions of each leg
SCRATCH_SIZE = 3 * COUNT  # numbers of scratch memory for `command_gait`: speed and phase of each leg
NAMES = ("rate", "lead", *(f"{pair}_{name}" for pair in PAIRS for name in PAIR))
"""Names of the numbers of a gait, in their order."""

SIZES = 0.25, 2.0
"""Smallest and largest length relative to a horse of 475 kg [-]; the command filters of a smaller horse would
be too fast for the usual time step."""
SLOWEST = 0.1
FASTEST = 6 * np.pi
"""Lowest and highest rate of a gait, and highest speed of a crank within a stride, of a horse of 475 kg
[rad/s]."""
LEADS = (-10.0, 10.0)  # range of leads [strides]
COUPLING = 0.6
"""Largest change of a crank's speed that is out of step [-]. Legs whose actions change the speed of a crank
for long must not lose their phase; with 0.2 they do, see docs/evidence/actions.md."""


@dataclass(frozen=True)
class HorseGait:
    """Gait of a horse.

    Attributes:
        rate: mean speed of the cranks over a stride, for the size of the animal [rad/s].
        lead: phase of the fore pair ahead of the hind pair [strides]; a whole stride changes nothing, half a
            stride exchanges left and right.
        fore, hind: numbers of a pair, in the order of `LIMITS`.

    Raises:
        ParameterError: a number is not finite or outside its limits, or a pair does not have seven.
    """

    rate: float
    lead: float
    fore: tuple[float, ...]
    hind: tuple[float, ...]

    def __post_init__(self) -> None:
        # The size is not known here: any rate that some horse can take is accepted.
        check_number("rate", self.rate, low=rates(SIZES[1])[0], high=rates(SIZES[0])[1])
        check_number("lead", self.lead, low=LEADS[0], high=LEADS[1])
        for pair in PAIRS:
            given: Any = getattr(self, pair)
            try:
                numbers = tuple(given)
            except TypeError:
                numbers = ()
            if len(numbers) != len(PAIR):
                raise ParameterError(f"{pair}: expected {len(PAIR)} numbers {PAIR}, got {brief(given)}")
            checked = (
                check_number(f"{pair}[{name!r}]", value, low=low, high=high)
                for value, (name, (low, high)) in zip(numbers, LIMITS.items(), strict=True)
            )
            object.__setattr__(self, pair, tuple(checked))

    def of_size(self, size: float) -> HorseGait:
        """Return the similar gait of an animal that is `size` times as long."""
        return replace(self, rate=self.rate / math.sqrt(size))

    def to_array(self) -> Floats:
        """Return the numbers in the order of `NAMES`, shape (16,)."""
        return np.array([self.rate, self.lead, *self.fore, *self.hind])

    @classmethod
    def from_array(cls, values: Any) -> HorseGait:
        """Make a gait from numbers in the order of `NAMES`, shape (16,)."""
        array = np.asarray(values, float)
        if array.shape != (len(NAMES),):
            raise ParameterError(f"gait of a horse: expected {len(NAMES)} numbers, got shape {array.shape}")
        rate, lead, *pairs = array.tolist()
        return cls(rate, lead, tuple(pairs[: len(PAIR)]), tuple(pairs[len(PAIR) :]))


def checked_size(given: float | None) -> float:
    """Return the setting `size`, or 1 if it is None; raise `ParameterError` for a size outside `SIZES`."""
    return check_number("size", 1.0 if given is None else given, low=SIZES[0], high=SIZES[1])


def rates(size: float) -> tuple[float, float]:
    """Return the lowest and highest rate of gaits of a horse of some size [rad/s]."""
    return SLOWEST / math.sqrt(size), FASTEST / math.sqrt(size)


def bounds(size: float = 1.0) -> Floats:
    """Return the lowest and highest value of each number of a gait of a horse of some size, shape (2, 16)."""
    limits: Floats = np.transpose([rates(size), LEADS, *[*LIMITS.values()] * len(PAIRS)])
    return limits


@cache
def _data(name: str = "gaits") -> dict[str, Any]:
    """Read a file of stored gaits: "gaits", with the reference gaits, or "kinematic"."""
    file = resources.files("hoof_env").joinpath("data", "horse", f"{name}.json")
    return dict(json.loads(file.read_text(encoding="utf-8")))


def horse_gaits() -> dict[str, HorseGait]:
    """Return the stored gaits, which are for a horse of 475 kg, by name: those found by the return alone,
    then kinematic ones."""
    kinematic = {name: found["gait"] for name, found in _data("kinematic").items()}
    return {name: HorseGait.from_array(values) for name, values in (_data()["gaits"] | kinematic).items()}


def kinematic_speeds() -> dict[str, float]:
    """Return the speeds [m/s] of the kinematic gaits of a horse of 475 kg by name.

    These were searched for with lag, duty factors, number of force peaks and stride of living horses; see
    `agents.kinematic_gaits`.
    """
    return {name: float(found["speed"]) for name, found in _data("kinematic").items()}


def kinematic_phases() -> dict[str, float]:
    """Return the phase [strides] at which a kinematic gait starts, by name, for gaits that cannot start at
    every phase: a trunk that starts level and at rest drops too far at some."""
    return {name: float(found["phase"]) for name, found in _data("kinematic").items() if "phase" in found}


def gait_numbers(name: str, given: Any, gaits: Mapping[str, HorseGait], size: float) -> Floats:
    """Return the numbers of a gait, shape (16,), or of several, shape (n, 16).

    Args:
        name: name of the argument in messages.
        given: name of one of `gaits`, a `HorseGait`, or numbers, shape (16,) or (n, 16).
        gaits: known gaits by name.
        size: size of the horse, on which the limits of the rate depend [-].

    Raises:
        ParameterError: an unknown name, another shape, or a number outside its limits.
    """
    if isinstance(given, str):
        given = gaits[check_choice(name, given, gaits)]
    if isinstance(given, HorseGait):
        given = given.to_array()
    try:
        numbers = np.asarray(given, float)
    except (TypeError, ValueError):
        numbers = np.empty(0)
    if numbers.ndim not in (1, 2) or numbers.shape[-1] != len(NAMES) or not np.isfinite(numbers).all():
        raise ParameterError(
            f"{name}: expected one of {', '.join(gaits)}, a HorseGait, or finite numbers of shape "
            f"({len(NAMES)},) or (n, {len(NAMES)}), got {given!r:.80}"
        )
    low, high = bounds(size)
    beyond = np.argwhere((numbers < low) | (numbers > high))
    if len(beyond):
        k = beyond[0][-1]
        raise ParameterError(
            f"{name}: expected {NAMES[k]} from {low[k]:g} to {high[k]:g}, got {numbers[tuple(beyond[0])]:g}"
        )
    return numbers


@cache
def _reference() -> tuple[Floats, Floats, Floats]:
    """Return the speeds [m/s] of the stored reference gaits, shape (m,), those gaits, (m, 16), and the motion
    of the trunk in them, (m, 3, coefficients)."""
    stored = _data()["reference"]
    speeds, gaits, trunk = (np.array(stored[name]) for name in ("speeds", "gaits", "trunk"))
    return speeds, gaits, trunk


def reference_type() -> list[Any]:
    """Return the fields of a task's record that `refer_to_target` reads: a flag that switches it on, the
    speed scale, and the stored speeds and gaits."""
    n = len(_reference()[0])
    return [("follows", "?"), ("speed_scale", "f8"), ("speeds", "f8", (n,)), ("gaits", "f8", (n, len(NAMES)))]


def reference_constants(speed_scale: float, follows: bool) -> dict[str, Any]:
    """Return values for the fields of `reference_type`, for a speed relative to a horse of 475 kg [-];
    `follows` is True if the gait follows the commanded speed."""
    speeds, gaits, _ = _reference()
    return {"follows": follows, "speed_scale": speed_scale, "speeds": speeds, "gaits": gaits}


def _mixed(speeds: Floats, values: Floats) -> Floats:
    """Interpolate values at the stored speeds, shape (m, ...), to other speeds [m/s]; shape (n, ...)."""
    stored = _reference()[0]
    # Outside the stored speeds the value of the nearest one is taken.
    at = np.clip(speeds, stored[0], stored[-1])
    k = np.minimum(np.searchsorted(stored, at, "right"), len(stored) - 1)
    part = (at - stored[k - 1]) / (stored[k] - stored[k - 1])
    part = part.reshape(-1, *[1] * (values.ndim - 1))
    interpolated: Floats = (1 - part) * values[k - 1] + part * values[k]
    return interpolated


def reference_gaits(speeds: Floats) -> Floats:
    """Return the reference gaits of a horse of 475 kg at speeds [m/s], shape (n, 16): interpolated between
    the stored ones, and with a proportional rate beyond them."""
    stored, gaits, _ = _reference()
    numbers = _mixed(speeds, gaits)
    numbers[:, 0] *= speeds / np.clip(speeds, stored[0], stored[-1])
    return numbers


def trunk_motion(speeds: Floats, phase: Floats) -> dict[str, Floats]:
    """Return the motion of the trunk of a horse of 475 kg in its reference gaits, from simulation, for speeds
    of the gaits [m/s] and phases of the stride [strides], shape (n,).

    The values are "y" divided by the height of the hips [-], its rate "vy" divided by the crank's rate as
    well [1/rad], "vx" divided by the speed [-], "pitch" [rad], and "pitch_rate" divided by the crank's rate
    [-], shape (n,) each.
    """
    # Rows are y, vx and pitch; columns the mean, then a cosine and a sine coefficient of each harmonic.
    mixed = np.moveaxis(_mixed(speeds, _reference()[2]), 0, -1)
    # Harmonics of half a stride, after which left and right are exchanged and the trunk moves alike.
    order = 2 * np.arange(1, mixed.shape[1] // 2 + 1)[:, None]
    cosine = np.cos(2 * np.pi * order * phase)
    sine = np.sin(2 * np.pi * order * phase)
    value = mixed[:, 0] + (mixed[:, 1::2] * cosine + mixed[:, 2::2] * sine).sum(1)
    slope = (order * (mixed[:, 2::2] * cosine - mixed[:, 1::2] * sine)).sum(1)
    return {"y": value[0], "vy": slope[0], "vx": value[1], "pitch": value[2], "pitch_rate": slope[2]}


class PairGait(Layout):
    """Numbers of a pair, in the order of `LIMITS`."""

    wave: Vector  # cosine and sine coefficient of the crank's speed / its mean [-]
    swing: Annotated[Block, SWING]  # coefficients [rad]


class GaitRows(Layout):
    """Memory of a gait, in the order of `NAMES`."""

    rate: Row  # mean speed of the cranks [rad/s]
    lead: Row  # lead of the fore pair [strides]
    fore: PairGait
    hind: PairGait


class Stride:
    """Relation between crank angle and phase of a stride, in closed form.

    The speed of the crank is a constant times 1 + Re(conj(w) z) with z = e^(i theta) and w = cosine + i sine
    coefficient. The phase grows uniformly in time. Up to constant angles theta is related to the phase as the
    true anomaly of a Kepler orbit with eccentricity |w| is to the eccentric anomaly:

        e^(i phase) = (half z + fold conj(z) + w) / (1 + Re(conj(w) z)),
        half = (1 + r) / 2,   fold = w^2 / (2 + 2 r),   r = sqrt(1 - |w|^2),

    and the inverse is the same with -w.

    Args:
        cosine, sine: coefficients of the crank's speed divided by its mean, of any shape.
    """

    def __init__(self, cosine: Floats, sine: Floats) -> None:
        # Pairs of real arrays: NumPy's rounding of complex products depends on the number of elements.
        self.wave = cosine, sine
        self.r = np.sqrt(1 - (cosine * cosine + sine * sine))
        self.half = (1 + self.r) / 2
        by = 2 + 2 * self.r
        self.fold = (cosine * cosine - sine * sine) / by, 2 * cosine * sine / by

    def begin(self) -> tuple[Floats, Floats]:
        """Return `phase` at angle 0."""
        (u, v) = self.wave
        (f, g) = self.fold
        return (self.half + f + u) / (1 + u), (g + v) / (1 + u)

    def phase(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """Return e^(i phase) for e^(i theta) = x + i y, as real and imaginary part."""
        return self._map(x, y, 1.0)

    def angle(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """Return e^(i theta) for e^(i phase) = x + i y, as real and imaginary part."""
        return self._map(x, y, -1.0)

    def _map(self, x: Floats, y: Floats, sign: float) -> tuple[Floats, Floats]:
        """Evaluate the formula of the class with w, or with -w for a `sign` of -1."""
        (u, v) = self.wave
        (f, g) = self.fold
        speed = 1 + sign * (u * x + v * y)
        return (
            (self.half * x + (f * x + g * y) + sign * u) / speed,
            (self.half * y + (g * x - f * y) + sign * v) / speed,
        )


def _pairs(gaits: Floats) -> Floats:
    """Return the numbers of the pairs, shape (2, 7, n)."""
    pairs = gaits[:, 2:].reshape(len(gaits), len(PAIRS), len(PAIR))
    # Contiguous along n: NumPy's loops over strided arrays may round differently.
    return np.ascontiguousarray(pairs.transpose(1, 2, 0))


def crank_angles(gaits: Floats, phase: Floats, off: Floats) -> Floats:
    """Return the angles of the cranks [rad], shape (4, n), in gaits, shape (n, 16), at phases of the stride
    [strides], shape (n,), from which the cranks deviate by `off` [strides], shape (4, n)."""
    wave = np.repeat(_pairs(gaits)[:, :2], 2, axis=0)
    stride = Stride(wave[:, 0], wave[:, 1])
    ahead = np.zeros((COUNT, len(gaits)))
    half = 0.5 * (np.arange(COUNT) % 2)[:, None]
    ahead[:2] = gaits[:, 1]
    turned = 2 * np.pi * (phase + off + ahead + half)
    (x, y) = stride.begin()
    c = np.cos(turned)
    s = np.sin(turned)
    x, y = stride.angle(x * c - y * s, x * s + y * c)
    angles: Floats = np.arctan2(y, x) % (2 * np.pi)
    return angles


def commands_of(gaits: Floats, theta: Floats, count: int) -> Floats:
    """Return the commands of legs that are in step, shape (4, count, n), in gaits, shape (n, 16), at crank
    angles [rad], shape (4, n); `count` is the number of gait parameters of the engine."""
    pairs = np.repeat(_pairs(gaits), 2, axis=0)
    stride = Stride(pairs[:, 0], pairs[:, 1])
    wave = stride.wave[0] * np.cos(theta) + stride.wave[1] * np.sin(theta)
    speed = gaits[:, 0] / stride.r * (1 + wave)
    return np.concatenate([speed[:, None], pairs[:, 2 : count + 1]], axis=1)


def offset_name(leg: str, action: str) -> str:
    """Return the name of the observed offset of a leg's action."""
    return f"offset: {leg}, {action}".replace("_", " ")


# In the kernels

FOLLOWED = 0.1
FOLLOWED_IN = 0.02
"""Part of the difference between action and offset by which the offset moves [-], and the time in which it
does [s]: an offset is a mean of the last actions, and decays under zero actions."""


def part_followed(dt: float) -> float:
    """Return the part of the difference between action and offset by which the offset moves in a control step
    of `dt` seconds of a horse of size 1 [-]; a similar animal's time is longer by the root of its size."""
    rest = 1.0 - FOLLOWED
    # The quotient is 1 where `dt` is `FOLLOWED_IN`, to the last bit
    return float(FOLLOWED * ((1.0 - rest ** (dt / FOLLOWED_IN)) / (1.0 - rest)))


def command_gait(
    task: Any, actions: Pointer, episode: Any, first_leg: Any, parameters: int, n: Whole, scratch: Any
) -> None:
    """Command the gait of the episode plus the offsets of the actions; `scratch` has room for
    `SCRATCH_SIZE` numbers. See `body.BodyKernels.command`.

    The first action of a leg scales its crank's speed or, where the footfall is free, shifts its phase; the
    remaining three are added to the swing's first coefficients. The first loop finds the phase of every leg,
    less the shift, which the coupling in the second one needs."""

    def offset_of(at: int, k: int) -> Lanes:
        """Follow the action at a place, the k-th of its leg; return the offset in its unit."""
        action = clip(read(actions, n * (COUNT * ACTED) + at, COUNT * ACTED, first_leg.lanes), 1.0)
        offset = episode.offset[at]
        offset = offset + task.followed * (action - offset)
        episode.offset[at] = offset
        return rounded(task.half[k] * offset)

    gait = episode.gait
    together = vector(full_like(episode, 0.0), 0.0)
    for p in range(len(PAIRS)):
        wave = block_at(gait.fore, p).wave
        r = sqrt(1.0 - dot(wave, wave))
        half = 0.5 * (1.0 + r)
        fold = (1.0 / (2.0 + 2.0 * r)) * (wave * wave)
        speed = gait.rate / r
        cosine, sine = cos_sin(2.0 * math.pi * gait.lead * (1.0 - p))
        begin = vector(cosine, sine) * phase_of(wave, half, fold, vector(full_like(episode, 1.0), 0.0))
        for side in range(2):
            i = 2 * p + side
            sign = 1.0 - 2.0 * side
            cosine, sine = cos_sin(block_at(first_leg, i).state.crank_angle)
            crank = vector(cosine, sine)
            # Phase of the stride that this leg alone would be in: the same for all legs that are in step.
            phase = sign * (conjugate(begin) * phase_of(wave, half, fold, crank))
            if task.is_free:
                # A leg that is where its action wants it to be is in step
                cosine, sine = cos_sin(2.0 * math.pi * offset_of(i * ACTED, 0))
                phase = conjugate(vector(cosine, sine)) * phase
            scratch[3 * i] = speed * (1.0 + dot(wave, crank))
            scratch[3 * i + 1] = phase.real
            scratch[3 * i + 2] = phase.imag
            together = together + phase
    for i in range(COUNT):
        leg = block_at(first_leg, i)
        pair = block_at(gait.fore, i // 2)
        # Kuramoto's coupling: the mean sine of the differences from all four phases.
        behind = cross(vector(scratch[3 * i + 1], scratch[3 * i + 2]), together)
        speed = scratch[3 * i] * (1.0 + (COUPLING / COUNT) * behind)
        for k in range(parameters):
            offset = 0.0 * speed
            if k < ACTED and not (task.is_free and k == 0):
                offset = offset_of(i * ACTED + k, k)
            wanted = speed * (1.0 + offset)
            if k > 0:
                wanted = pair.swing[k - 1] + offset
            leg.command[k] = minimum(maximum(wanted, task.low[k]), task.high[k])


def phase_of(wave: Plane, half: Lanes, fold: Plane, crank: Plane) -> Plane:
    """Return e^(i phase) of a pair for e^(i theta) = `crank`; see `Stride`."""
    return (1.0 / (1.0 + dot(wave, crank))) * (half * crank + fold * conjugate(crank) + wave)


def conjugate(z: Plane) -> Plane:
    """Return the complex conjugate of a planar vector."""
    return vector(z.real, -z.imag)


def refer_to_target(task: Any, episode: Any, switched: Mask) -> None:
    """Change the episode's gait to the reference gait of the new commanded speed in the rows `switched`; the
    kernel's form of `reference_gaits`."""
    if task.follows:
        when(any_lane(switched))(lambda: _refer(task, episode, switched))


def _refer(task: Any, episode: Any, switched: Mask) -> None:
    speeds = task.speeds
    gaits = task.gaits
    last = len(task.speeds) - 1
    speed = episode.target * (1.0 / task.speed_scale)
    within = minimum(maximum(speed, speeds[0]), speeds[last])
    for k in range(len(NAMES)):
        mixed = full_like(episode, gaits[0, k])
        # A sum over all intervals, each clipped to its own: lanes have different speeds, so none can search.
        for j in range(last):
            part = (within - speeds[j]) * (1.0 / (speeds[j + 1] - speeds[j]))
            mixed = mixed + (gaits[j + 1, k] - gaits[j, k]) * minimum(maximum(part, 0.0), 1.0)
        if k == 0:
            mixed = mixed * speed / (within * task.speed_scale)
        episode.gait[k] = where(switched, mixed, episode.gait[k])

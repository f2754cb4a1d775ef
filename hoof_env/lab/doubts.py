"""What makes the axes of a force record doubtful: another force is larger, or propulsion comes first."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from hoof_env.lab.stances import whole_stances

Floats = NDArray[np.float64]

IDLE = 0.1  # share of the highest force of all limbs up to which a limb is not loaded
LOADED = 0.2  # share of a limb's highest vertical force from which on its other forces count
SMALL = 0.01  # share of that up to which a horizontal force is none
# order of braking and propulsion, the mean of all limbs and that of one, from
BACKWARD = -0.2
ALONE = -0.35
# which on it is remarked; see `order`
BOTH = 0.1  # least share of braking, and of propulsion, in the fore-aft force, for an order to be there


OPTION = re.compile(r"--(?P<name>\w+)-a(?P<value>=\S+)?(?: or |, )--(?P=name)-b(?:=\S+)?")
"""What notes say of options, as a record does not know whether it is A or B."""


def for_one(note: str, which: str) -> str:
    """A note with the option of one record: "-a" or "-b", or "" where options have no such ending."""
    return OPTION.sub(rf"--\g<name>{which}\g<value>", note)


def sideways(
    forces: Mapping[str, Floats],
    sizes: Mapping[str, Mapping[str, Floats]],
    ahead: str,
    upward: str,
    given: tuple[str, str],
) -> list[str]:
    """Warnings of limbs whose largest force is not the vertical, or whose larger horizontal force is not the
    fore-aft one, with the options that change that.

    Args:
        forces: forward and upward by limb, shape (n, 2).
        sizes: of forces by limb and axis of the file, shape (n,).
        ahead, upward: axes that are taken.
        given: what the options say of up and forward; what they name is not doubted.
    """
    highest = max((float(size.max()) for axes in sizes.values() for size in axes.values()), default=0.0)
    wrong: dict[tuple[str, str], list[str]] = {}
    for limb, axes in sizes.items():
        vertical = np.abs(forces[limb][:, 1])
        others = {axis: size for axis, size in axes.items() if axis != upward[-1]}
        largest = max(others, key=lambda axis: float(others[axis].max()), default="")
        peak = float(vertical.max())
        if largest and others[largest].max() > max(peak, IDLE * highest):
            if given[0] == "auto":
                wrong.setdefault(("up", largest), []).append(limb)
            continue
        loaded = vertical > LOADED * peak
        if peak <= IDLE * highest or given[1] != "auto":
            continue
        means = {axis: float(size[loaded].mean()) for axis, size in others.items()}
        most = max(means, key=lambda axis: means[axis], default=ahead[-1])
        if most != ahead[-1] and means[most] > max(SMALL * peak, means.get(ahead[-1], 0.0)):
            wrong.setdefault(("forward", most), []).append(limb)
    said = {
        "up": f"is larger than that along {upward}, which is taken for the vertical force",
        "forward": f"is larger than that along {ahead}, which is taken for the direction of travel",
    }
    return [
        f"{', '.join(limbs)}: the {'' if which == 'up' else 'horizontal '}force along {axis} {said[which]}; "
        f"--{which}-a={axis} or --{which}-b={axis} (or =-{axis}) changes that"
        for (which, axis), limbs in wrong.items()
    ]


def order(force: Floats, rate: float) -> float:
    """Whether braking comes before propulsion, as in an animal that travels forward: 0.5 for half a sine of
    each, -0.5 for propulsion first, and 0 where there is only one of them, or no whole stance. Forces forward
    and upward, shape (n, 2), at `rate` [Hz]."""
    level = LOADED * float(force[:, 1].max())
    moments = 0.0
    sizes = 0.0
    parts = np.zeros(2)
    for first, last in whole_stances(force[:, 1], level, rate):
        forward = force[first:last, 0]
        moments += float(forward @ np.linspace(-1.0, 1.0, last - first))
        sizes += float(np.abs(forward).sum())
        parts += np.maximum(forward, 0.0).sum(), np.maximum(-forward, 0.0).sum()
    if not sizes > 0 or parts.min() < BOTH * sizes:
        return 0.0
    return moments / sizes


def backward(forces: Mapping[str, Floats], time: Floats, ahead: str, by_axis: bool) -> list[str]:
    """A warning of limbs with propulsion before braking, and the option that turns the direction of travel
    round. Forces forward and upward by limb, shape (n, 2); `by_axis` where the options of axes work."""
    rate = (len(time) - 1) / float(time[-1] - time[0])
    highest = max(float(np.abs(force[:, 1]).max()) for force in forces.values())
    orders = {
        limb: order(force, rate) for limb, force in forces.items()
        if np.isfinite(force).all() and force[:, 1].max() > IDLE * highest
    }  # fmt: skip
    known = [one for one in orders.values() if one != 0.0]
    least = 0.0 if known and float(np.mean(known)) < BACKWARD else ALONE
    limbs = [limb for limb, one in orders.items() if one < least]
    if not limbs:
        return []
    other = ahead[1:] if ahead.startswith("-") else f"-{ahead}"
    remedy = (
        f"--forward-a={other} or --forward-b={other}"
        if by_axis
        else "a minus before the column of force_x in --map-a or --map-b"
    )
    return [
        f"{', '.join(limbs)}: propulsion before braking; if the animal travels in the direction of {other}, "
        f"{remedy} says so"
    ]

"""Checks of a force record's axes: which force is the largest, and whether braking precedes propulsion."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from hoof_env.lab.stances import whole_stances

Floats = NDArray[np.float64]

UNLOADED_SHARE = 0.1
"""Share of the highest force of all limbs below which a limb counts as unloaded."""

LOADED_SHARE = 0.2
"""Share of a limb's highest vertical force above which its other forces count."""

ZERO_FORCE_SHARE = 0.01
"""Share of a limb's highest vertical force below which a horizontal force counts as 0."""

MIN_MEAN_ORDER = -0.2
"""Mean `order` of all limbs below which each limb with propulsion first causes a warning."""

MIN_ORDER = -0.35
"""The `order` of one limb below which it causes a warning, whatever the mean."""

MIN_PHASE_SHARE = 0.1
"""Least share of braking, and of propulsion, in the fore-aft force that defines an order."""

OPTION_OF_BOTH = re.compile(r"--(?P<name>\w+)-a(?P<value>=\S+)?(?: or |, )--(?P=name)-b(?:=\S+)?")
"""Options in notes. They name both records, because a record does not know whether it is A or B."""


def for_one(note: str, which: str) -> str:
    """Return a note with the option of one record.

    Args:
        note: the note with the options of both records.
        which: "-a" or "-b", or "" for commands with options without such an ending.
    """
    return OPTION_OF_BOTH.sub(rf"--\g<name>{which}\g<value>", note)


def suspect_axes(
    forces: Mapping[str, Floats],
    sizes: Mapping[str, Mapping[str, Floats]],
    ahead: str,
    upward: str,
    options: tuple[str, str],
) -> list[str]:
    """Warn of limbs whose largest force is not the vertical one, or whose largest horizontal force is not the
    fore-aft one.

    Args:
        forces: forces forward and upward by limb, shape (n, 2).
        sizes: absolute forces by limb and axis of the file, shape (n,).
        ahead, upward: axes taken as forward and up, such as "x" or "-x".
        options: values of the options up and forward; an axis that they name causes no warning.

    Returns:
        Warnings, with the options that choose other axes.
    """
    highest = max((float(size.max()) for axes in sizes.values() for size in axes.values()), default=0.0)
    wrong: dict[tuple[str, str], list[str]] = {}
    for limb, axes in sizes.items():
        vertical = np.abs(forces[limb][:, 1])
        others = {axis: size for axis, size in axes.items() if axis != upward[-1]}
        largest = max(others, key=lambda axis: float(others[axis].max()), default="")
        peak = float(vertical.max())
        if largest and others[largest].max() > max(peak, UNLOADED_SHARE * highest):
            if options[0] == "auto":
                wrong.setdefault(("up", largest), []).append(limb)
            # Without a certain vertical axis the horizontal forces cannot be judged.
            continue
        loaded = vertical > LOADED_SHARE * peak
        if peak <= UNLOADED_SHARE * highest or options[1] != "auto":
            continue
        # Means under load and not peaks, which an impact may cause.
        means = {axis: float(size[loaded].mean()) for axis, size in others.items()}
        most = max(means, key=lambda axis: means[axis], default=ahead[-1])
        if most != ahead[-1] and means[most] > max(ZERO_FORCE_SHARE * peak, means.get(ahead[-1], 0.0)):
            wrong.setdefault(("forward", most), []).append(limb)
    reasons = {
        "up": f"is larger than the force along {upward}, which is taken for the vertical force",
        "forward": f"is larger than the force along {ahead}, which is taken for the direction of travel",
    }
    return [
        f"{', '.join(limbs)}: the {'' if which == 'up' else 'horizontal '}force along {axis} "
        f"{reasons[which]}; --{which}-a={axis} or --{which}-b={axis} (or =-{axis}) changes that"
        for (which, axis), limbs in wrong.items()
    ]


def order(force: Floats, rate: float) -> float:
    """Compute the order of braking and propulsion: positive if braking comes first, as in an animal that
    travels forward.

    It is 0.5 for half a sine of braking and another of propulsion, -0.5 for propulsion first, and 0 if there
    is only one of them, or no whole stance.

    Args:
        force: forces forward and upward, shape (n, 2).
        rate: sampling rate [Hz].
    """
    level = LOADED_SHARE * float(force[:, 1].max())
    moments = 0.0
    sizes = 0.0
    parts = np.zeros(2)
    for first, last in whole_stances(force[:, 1], level, rate):
        forward = force[first:last, 0]
        # The first moment of the force about mid-stance, over a duration from -1 to 1.
        moments += float(forward @ np.linspace(-1.0, 1.0, last - first))
        sizes += float(np.abs(forward).sum())
        parts += np.maximum(forward, 0.0).sum(), np.maximum(-forward, 0.0).sum()
    if not sizes > 0 or parts.min() < MIN_PHASE_SHARE * sizes:
        return 0.0
    return moments / sizes


def propelling_first(forces: Mapping[str, Floats], time: Floats) -> list[str]:
    """Return the limbs with propulsion before braking.

    Args:
        forces: forces forward and upward by limb, shape (n, 2).
        time: times, shape (n,) [s].
    """
    rate = (len(time) - 1) / float(time[-1] - time[0])
    highest = max(float(np.abs(force[:, 1]).max()) for force in forces.values())
    orders = {}
    for limb, force in forces.items():
        if np.isfinite(force).all() and force[:, 1].max() > UNLOADED_SHARE * highest:
            orders[limb] = order(force, rate)
    known = [value for value in orders.values() if value != 0.0]
    # The order of one limb scatters more than the mean of all and must therefore be clearer.
    least = 0.0 if known and float(np.mean(known)) < MIN_MEAN_ORDER else MIN_ORDER
    return [limb for limb, value in orders.items() if value < least]


def of_model(forces: Mapping[str, Floats], time: Floats) -> list[str]:
    """Return a line on limbs of an export of this package with propulsion before braking, or none.

    Args:
        forces: forces forward and upward by limb, shape (n, 2).
        time: times, shape (n,) [s].
    """
    limbs = propelling_first(forces, time)
    if not limbs:
        return []
    return [
        f"{', '.join(limbs)}: propulsion before braking, as legs of the model may have it and living horses "
        "do not (Limits in docs/help.md); the signs are right"
    ]


def suspect_direction(forces: Mapping[str, Floats], time: Floats, ahead: str, by_axis: bool) -> list[str]:
    """Warn of limbs with propulsion before braking.

    Args:
        forces: forces forward and upward by limb, shape (n, 2).
        time: times, shape (n,) [s].
        ahead: axis taken as forward, such as "x" or "-x".
        by_axis: True if options for axes affect the file.

    Returns:
        One warning with the remedy, or none.
    """
    limbs = propelling_first(forces, time)
    if not limbs:
        return []
    opposite = ahead[1:] if ahead.startswith("-") else f"-{ahead}"
    remedy = (
        f"--forward-a={opposite} or --forward-b={opposite}"
        if by_axis
        else "a minus before the column of force_x in --map-a or --map-b"
    )
    return [
        f"{', '.join(limbs)}: propulsion before braking; if the animal travels in the direction of "
        f"{opposite}, {remedy} says so"
    ]

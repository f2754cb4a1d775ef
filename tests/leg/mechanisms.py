"""Mechanisms that the package does not ship: random ones, and one with all features of a list."""

from itertools import pairwise

import numpy as np

from hoof_env.leg.geometry import Geometry


def rods(fixed, pin, dyads, points=()):
    """A list in which every length of a dyad is a rod; joints tie the rods at a point in a chain, or to the
    frame."""
    ends = [(fixed[0], pin)]
    for point, first, second in dyads:
        ends += [(first, point), (second, point)]
    names = ["".join(pair) for pair in ends]
    joints = []
    for point in (*fixed, pin, *(dyad[0] for dyad in dyads)):
        at = [name for name, pair in zip(names, ends, strict=True) if point in pair]
        pairs = [(name, "frame") for name in at] if point in fixed else pairwise(at)
        joints += [[point, one, other] for one, other in pairs]
    listed = [{"point": p, "dyad": [a, b], "lengths": [a + p, b + p]} for p, a, b in dyads]
    return {
        "fixed": list(fixed),
        "crank": {"point": pin, "length": fixed[0] + pin},
        "points": [*listed, *points],
        "bodies": [
            {"name": name, "tail": tail, "head": head} for name, (tail, head) in zip(names, ends, strict=True)
        ],
        "joints": joints,
        "feet": [dyads[-1][0]],
    }


def random_leg(rng, dyads=4):
    """A leg of random dyads and lengths that can be assembled at the crank angle 0, and where its points are
    there. It need not turn fully."""
    at = {"O": 0j, "C": complex(-1, 0) + complex(*rng.uniform(-0.3, 0.3, 2)), "P": 0.3 + 0j}
    chosen = []
    lengths = {"OP": 0.3}
    sides = {}
    for k in range(dyads):
        point = "QRSTUVW"[k]
        known = list(at)
        # the pin at first, so that something moves
        pair = ("C", "P") if k == 0 else tuple(rng.choice(known, 2, replace=False).tolist())
        a, b = (at[name] for name in pair)
        place = rng.uniform(0.2, 0.8) + 1j * rng.choice([-1, 1]) * rng.uniform(0.4, 1.0)
        at[point] = a + (b - a) * place
        sides[point] = int(np.sign(place.imag))
        chosen.append((point, *pair))
        lengths |= {pair[0] + point: abs(at[point] - a), pair[1] + point: abs(at[point] - b)}
    mechanism = rods(("O", "C"), "P", chosen)
    leg = Geometry(
        lengths=lengths,
        pivot=(at["C"].real, at["C"].imag),
        assembly=sides,
        toe=chosen[-1][0],
        heel=None,
        travel=int(rng.choice([-1, 1])),
        hip_height=1.0,
        full_turn=False,
        mechanism=mechanism,
    )
    return leg, at


def lambda_leg(crank=0.35):
    """Return Chebyshev's lambda: a coupler that goes on, straight, beyond its dyad to the foot."""
    return Geometry(
        lengths={"OP": crank, "PB": 2.5 * crank, "CB": 2.5 * crank, "BF": 2.5 * crank},
        pivot=(2 * crank, 0.0),
        assembly={"B": 1},
        toe="F",
        heel=None,
        travel=1,
        hip_height=1.2,
        mechanism={
            "fixed": ["O", "C"],
            "crank": {"point": "P", "length": "OP"},
            "points": [
                {"point": "B", "dyad": ["C", "P"], "lengths": ["CB", "PB"]},
                {"point": "F", "body": "PB", "from": "B", "along": "-BF"},
            ],
            "bodies": [
                {"name": "OP", "tail": "O", "head": "P"},
                {"name": "PB", "tail": "P", "head": "B"},
                {"name": "CB", "tail": "C", "head": "B"},
            ],
            "joints": [["O", "OP", "frame"], ["P", "PB", "OP"], ["C", "CB", "frame"], ["B", "CB", "PB"]],
            "feet": ["F"],
        },
    )


EVERYTHING = {
    "fixed": ["O", "C"],
    "crank": {"point": "P", "length": "OP"},
    "points": [
        {"point": "B", "dyad": ["C", "P"], "lengths": ["CB", "PB"]},
        {"point": "D", "dyad": ["P", "B"], "lengths": ["PD", "BD"]},  # within the plate P-B-D
        {"point": "A", "body": "CB", "from": "B", "along": "-BA", "across": "AX"},
        {"point": "E", "dyad": ["D", "A"], "lengths": ["DE", "AE"]},
        {"point": "G", "body": "ankle", "from": "E", "along": "-EG"},
        {"point": "H", "body": "foot", "along": "GF", "across": "-GH"},
    ],
    "bodies": [
        {"name": "crank", "tail": "O", "head": "P", "length": "OP"},
        {"name": "plate", "tail": "P", "head": "B", "length": "PB", "points": ["D"]},
        {"name": "CB", "tail": "C", "head": "B"},
        {"name": "DE", "tail": "E", "head": "D"},
        {"name": "ankle", "tail": "A", "head": "E", "length": "AE"},
        {"name": "foot", "tail": "G", "head": "E", "length": "EG"},
    ],
    "joints": [
        ["O", "crank", "frame"],
        ["P", "plate", "crank"],
        ["B", "CB", "plate"],
        ["C", "CB", "frame"],
        ["D", "DE", "plate"],
        ["A", "ankle", "CB"],
        ["E", "ankle", "DE"],
        ["E", "foot", "ankle"],
    ],
    "welds": [["foot", "ankle"]],
    "feet": ["G", "H"],
}
"""A plate with a dyad inside it, a bent rocker, a weld, coordinates of all signs, two feet."""


def leg_with_everything(**changes):
    """A leg of that mechanism that turns fully, with bodies that are no rods."""
    lengths = {
        "OP": 0.2, "CB": 0.6, "PB": 0.7, "PD": 0.5, "BD": 0.45, "BA": 0.15, "AX": 0.1,
        "DE": 0.8, "AE": 0.75, "EG": 0.5, "GF": 0.05, "GH": 0.12,
    }  # fmt: skip
    values = {
        "lengths": lengths,
        "pivot": (-0.6, -0.1),
        "assembly": {"B": 1, "D": -1, "E": 1},
        "toe": "H",
        "heel": "G",
        "travel": 1,
        "hip_height": 0.68,
        "solids": {
            "plate": {"mass": 1.5, "centre": [0.3, -0.15], "inertia": 0.04},
            "foot": {"centre": [0.1, 0.05]},
            "CB": {"inertia": 0.07},
        },
        "mechanism": EVERYTHING,
        "name": "everything",
    }
    return Geometry(**(values | changes))

"""Legs beside the one that ships: golden numbers of many tests belong to the first of them."""

import json
from pathlib import Path

from hoof_env.leg.mechanism_list import PAPER, read_mechanism

DATA = Path(__file__).with_name("data")

FIRST_FIT = str(DATA / "first_fit.json")
"""The leg that the search for `identified` set out from."""

PRESETS = {"first_fit": FIRST_FIT, "identified": "identified"}


FOUR_BAR = {
    "fixed": ["O", "B"],
    "crank": {"point": "A", "length": "OA"},
    "points": [
        {"point": "C", "dyad": ["B", "A"], "lengths": ["BC", "AC"]},
        {"point": "D", "body": "AC", "from": "C", "along": "-CD"},
    ],
    "bodies": [
        {"name": "OA", "tail": "O", "head": "A"},
        {"name": "AC", "tail": "A", "head": "C", "points": ["D"]},
        {"name": "BC", "tail": "B", "head": "C"},
    ],
    "joints": [["O", "OA", "frame"], ["A", "AC", "OA"], ["C", "BC", "AC"], ["B", "BC", "frame"]],
    "feet": ["D"],
}
"""Mechanism of three bodies whose coupler goes on beyond its pin, to the only foot."""

FOUR_BAR_LEG = {
    "lengths": {"OA": 0.2, "BC": 0.6, "AC": 0.7, "CD": 0.5},
    "pivot": (0.6, 0.1),
    "assembly": {"C": 1},
    "toe": "D",
    "heel": None,
    "travel": 1,
    "hip_height": 1.0,
    "mechanism": FOUR_BAR,
}
"""Values of a leg of it."""

MECHANISMS = {"paper": PAPER, "four-bar": read_mechanism(FOUR_BAR)}


def load_ensemble():
    """Load 24 legs that also meet the paper's numbers, far apart, each as the content of a preset file."""
    data = json.loads((DATA / "ensemble.json").read_text(encoding="utf-8"))
    shared = {"provenance": "a member of the ensemble of identified", "ground": data["ground"]}
    return [shared | {"geometry": one["geometry"], "gaits": one["gaits"]} for one in data["members"]]


OLD_HORSE = {
    "preset": FIRST_FIT,  # with its ground
    "trunk_mass": 80.0,
    "trunk_stiffness": 4000.0,
    "trunk_damping": 1130.0,
    "target_speed": None,
    "reward_weights": {"progress": 1.0, "peak": 0.3, "energy": 0.1, "support": 0.0},
}
"""`HorseLeg-v0` when golden numbers of that leg were made."""

"""Legs that cannot be, and calls of legs and about them, by the words of each error: values of a `Geometry`
(`VALUES`), calls (`CALLS`). Presets are in tests/leg/test_refused_presets.py, lists of a mechanism in
tests/leg/test_refused_mechanisms.py."""

import copy
import re

import numpy as np
import pytest

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Limb, Motor, Trunk
from hoof_env.errors import GeometryError, OutputError, ParameterError, brief
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import Geometry, load_geometry
from hoof_env.leg.kinematics import FrameMotion, pose
from hoof_env.leg.limb_masses import segment_masses, trunk_mass, with_limb_masses
from hoof_env.leg.mechanism_list import PAPER, read_mechanism
from hoof_env.leg.profile import LegProfile
from hoof_env.paper_solver.solver import ConstrainedLeg
from tests.leg.mechanisms import leg_with_everything
from tests.legs import FIRST_FIT, FOUR_BAR, FOUR_BAR_LEG

LEG = load_geometry(FIRST_FIT)
IDENTIFIED = load_geometry()
KLANN = load_geometry("klann")
JANSEN = load_geometry("jansen")
SHORT = {"CF": 0.8 * LEG.lengths["CF"]}
ROCKER = LEG.replace(lengths=SHORT, full_turn=False)
NUMBER = r"expected .*\(0, inf\], got"


def four_bar(**numbers):
    """The list of the four-bar leg, with numbers of the body AC in it."""
    mechanism = copy.deepcopy(FOUR_BAR)
    mechanism["bodies"][1] |= numbers
    return mechanism


def with_a_stranger():
    """A list with a point of a body on which it moves."""
    mechanism = copy.deepcopy(FOUR_BAR)
    mechanism["bodies"][2]["points"] = ["D"]
    return mechanism


def with_a_free_body():
    """A list with as many rows as coordinates, which leave a body free and hold another twice."""
    given = PAPER.to_mapping()
    given["joints"].remove(["B", "CB", "PB"])
    given["welds"] += [["BD", "PB"], ["DE", "BD"]]
    return given


WITHOUT_FG = {name: length for name, length in LEG.lengths.items() if name != "FG"}
Z = {"mechanism": FOUR_BAR | {"fixed": ["O", "B", "Z"]}, "pivot": {"B": (0.6, 0.1), "Z": (0, "1")}}
VALUES = [
    # of the first leg
    *(
        (LEG.to_dict(), changes, ParameterError, words)
        for changes, words in (
            ({"lengths": WITHOUT_FG}, "lengths: expected exactly .*missing FG"),
            ({"lengths": {**LEG.lengths, "XY": 1.0}}, "lengths: expected exactly .*unknown XY"),
            ({"lengths": {**LEG.lengths, "FG": -0.1}}, r"lengths\['FG'\]: expected .*got -0.1"),
            ({"lengths": {**LEG.lengths, "FG": 0}}, r"lengths\['FG'\]: expected .*got 0"),
            ({"lengths": {**LEG.lengths, "FG": np.nan}}, r"lengths\['FG'\]: expected .*got nan"),
            ({"lengths": {**LEG.lengths, "FG": "long"}}, r"lengths\['FG'\]: expected .*got 'long'"),
            ({"lengths": [0.1] * 15}, "lengths: expected a mapping"),
            ({"pivot": (0.0, np.inf)}, r"pivot\[1\]: expected .*got inf"),
            ({"pivot": (0.0,)}, "pivot: expected two numbers"),
            ({"pivot": 1.0}, "pivot: expected two numbers"),
            ({"pivot": [[1.0], 1.0]}, r"pivot\[0\]: expected .*got \[1.0\]"),
            ({"assembly": {**LEG.assembly, "B": 0}}, r"assembly\['B'\]: expected \+1 or -1, got 0"),
            ({"assembly": {"B": 1}}, "assembly: expected exactly .*missing D, E, F, I, J"),
            ({"toe": "J"}, "toe and heel: expected I and J, .*got 'J' and 'J'"),
            ({"toe": ["I"]}, "toe.*: expected"),
            ({"heel": "G"}, "toe and heel: expected I and J"),
            ({"travel": 0}, r"travel: expected \+1 or -1, got 0"),
            ({"travel": [1, 1]}, "travel.*: expected"),
            ({"hip_height": 0.0}, "hip_height: expected .*in"),
            ({"linear_density": -1.0}, "linear_density: expected"),
            ({"masses": (1.0,) * 13}, "masses: expected 14 link masses, got"),
            ({"masses": (1.0,) * 13 + (0.0,)}, r"masses\[13\]: expected"),
            ({"masses": 3.0}, "masses: expected 14 link masses"),
            ({"masses": [[1.0], 2.0]}, "masses: expected 14 link masses"),
            ({"inertia": "sphere"}, "inertia: expected .*paper, uniform_rod, got 'sphere'"),
            ({"name": ["l"]}, "name.*: expected"),
            ({"provenance": 3}, "provenance.*: expected"),
            ({"full_turn": 1}, "full_turn: expected True or False, got 1"),
            # what Python or NumPy would take for numbers or texts
            *(
                ({"travel": value}, rf"travel: expected \+1 or -1, got {re.escape(repr(value))}")
                for value in (True, np.True_, np.array(True), "1", np.nan, None)
            ),
            ({"assembly": {**LEG.assembly, "B": True}}, r"assembly\['B'\]: expected \+1 or -1, got True"),
            *(
                ({"hip_height": value}, f"^hip_height: {NUMBER} {re.escape(brief(value))}")
                for value in (np.array(True), np.array("1"), bytearray(b"1"), np.complex128(1), 10**400)
            ),
            *(
                ({"pivot": value}, f"pivot: expected .*got {re.escape(brief(value))}")
                for value in (np.array(1.0), np.ones((2, 2)), b"12", "12", {1.0, 2.0}, None)
            ),
            *(
                ({"masses": value}, f"masses: expected 14 link masses, got {re.escape(repr(value))}")
                for value in (np.array(1.0), bytearray(range(1, 15)), "1" * 14, [])
            ),
            ({"masses": [True] * 14}, r"masses\[0\]: expected .*got True"),
            ({"toe": np.array("I")}, "toe and heel: expected I and J"),
            ({"toe": None}, "toe and heel: expected I and J"),
        )
    ),
    # of legs of a list
    *(
        (FOUR_BAR_LEG, changes, ParameterError, words)
        for changes, words in (
            (
                {"mechanism": four_bar(mass=-1)},
                r"^mechanism\.bodies\[1\]\['mass'\]: expected .*\(0, inf\]",
            ),
            (
                {"mechanism": four_bar(centre=3)},
                r"^mechanism\.bodies\[1\]\['centre'\]: expected two numbers",
            ),
            (
                {"mechanism": four_bar(colour=3)},
                r"^mechanism\.bodies\[1\]: expected exactly name, .*; unknown colour",
            ),
            (
                {"mechanism": four_bar(mass=1), "solids": {"AC": {}}},
                r"^solids\['AC'\]: mechanism\.bodies\[1\] has numbers of 'AC', too",
            ),
            ({"solids": {"XX": {}}}, r"^solids: expected .*OA, AC, BC; unknown XX$"),
            ({"solids": None}, r"^solids: expected .*OA, AC, BC, got None$"),
            ({"lengths": 3}, r"^lengths: expected .*OA, AC, BC, CD, got 3$"),
            *(
                (
                    {"solids": {"AC": {"centre": value}}},
                    rf"^solids\['AC'\]\['centre'\]: expected .*got {re.escape(repr(value))}",
                )
                for value in (np.array(1.0), b"12", (0.1,), None)
            ),
            ({"solids": {"AC": {"inertia": np.inf}}}, r"^solids\['AC'\]\['inertia'\]: expected .*got inf"),
            ({"solids": {"AC": 3}}, r"^solids\['AC'\]: expected .*mass, .*got 3"),
            (Z, r"^pivot\['Z'\]\[1\]: expected .*number"),
        )
    ),
    *(
        (KLANN.to_dict(), changes, ParameterError, words)
        for changes, words in (
            (
                {"lengths": {name: 1.0 for name in KLANN.lengths if name != "EG"}},
                r"lengths: expected exactly OP, BH.*missing EG",
            ),
            ({"pivot": (0.0, 1.0)}, "pivot: expected a mapping of B, D to their places, got"),
            ({"heel": "E"}, "toe and heel: expected G and None, got 'G' and 'E'"),
            ({"masses": (1, 1, 1, 0, 1, 1, 1, 1, 1)}, r"masses\[3\]: expected"),
        )
    ),
    # that lock, or whose bodies leave their points
    (LEG.to_dict(), {"lengths": {**LEG.lengths, **SHORT}}, GeometryError, "does not close at crank angle"),
    (
        KLANN.to_dict(),
        {"lengths": {**KLANN.lengths, "BH": 0.2}},
        GeometryError,
        r"dyad 1 \(B-H-P, .* does not close at crank angle [\d.]+ deg",
    ),
    (
        FOUR_BAR_LEG,
        {"mechanism": with_a_stranger()},
        GeometryError,
        r"mechanism.bodies\[2\]: 'D' is not a point of body 'BC', on which",
    ),
    (
        IDENTIFIED.to_dict(),
        {"mechanism": with_a_free_body()},
        GeometryError,
        r"mechanism.joints: .*crank stands: 'CB'; tie",
    ),
]
"""Values of a leg, others instead, class and words of the error."""


@pytest.mark.parametrize(("values", "changes", "error", "words"), VALUES)
def test_values(values, changes, error, words):
    for make in (lambda given: Geometry(**given), Geometry.from_dict):
        with pytest.raises(error, match=words):
            make(values | changes)


CHANGES = [row for row in VALUES if "missing" not in row[3]]
"""Without those that lack a length or sign, which `replace` takes from the leg."""


@pytest.mark.parametrize(("values", "changes", "error", "words"), CHANGES)
def test_changes(values, changes, error, words):
    leg = Geometry(**values)
    with pytest.raises(error, match=words):
        leg.replace(**changes)


def test_the_list_alone_does_not_tell_that_a_body_is_free():
    assert read_mechanism(with_a_free_body())


CALLS = [
    *(
        (lambda _, make=make: make(), ParameterError, rf"{name}: expected .*number")
        for make, name in (
            (lambda: pose(LEG, np.nan), "theta"),
            (lambda: pose(LEG, 0.0, np.inf), "theta_rate"),
            (lambda: pose(LEG, 0.0, 0.0, "fast"), "theta_acc"),
            (lambda: FrameMotion(phi_rate=np.nan), r"frame\.phi_rate"),
            (lambda: FrameMotion(position=(0.0, np.inf)), r"frame\.position"),
            (lambda: FrameMotion(phi=(1.0,)), r"frame\.phi"),
            (lambda: FrameMotion(velocity=("1", "2")), r"frame\.velocity"),
        )
    ),
    *(
        (
            lambda _, value=value: FrameMotion(acceleration=value),
            ParameterError,
            rf"frame\.acceleration: expected .*\(x, y\), got {re.escape(repr(value))}",
        )
        for value in (1.0, np.array(1.0), (0.0, 1.0, 2.0), (), "12", b"12", None)
    ),
    *(
        (
            lambda _, value=value: pose(LEG, 0.0, frame=value),
            ParameterError,
            "frame: expected FrameMotion, got",
        )
        for value in (0, "", {}, np.zeros(2), FrameMotion)
    ),
    (lambda _: pose("klann", 0.0), ParameterError, "geometry: expected Geometry, got 'klann'"),
    (
        lambda _: KLANN.pose(0.0).point("X"),
        ParameterError,
        r"point: expected .*B, D, .*, O, P, got 'X'",
    ),
    # entries of a leg
    (lambda _: LEG.replace(lengths={"XY": 1.0}), ParameterError, "unknown XY"),
    (
        lambda _: Geometry.from_dict({name: each for name, each in LEG.to_dict().items() if name != "toe"}),
        ParameterError,
        r"geometry: expected exactly .*; missing toe",
    ),
    (
        lambda _: leg_with_everything(solids={"plate": {"mass": 0.0}}),
        ParameterError,
        r"solids\['plate'\]\['mass'\]: expected",
    ),
    (lambda _: leg_with_everything(solids={"XY": {}}), ParameterError, "solids: .*unknown XY"),
    # another size
    *(
        (
            lambda _, value=value: LEG.scaled(value),
            ParameterError,
            f"^factor: {NUMBER} {re.escape(repr(value))}",
        )
        for value in (0, -1.0, np.nan, np.inf, "half", None, True)
    ),
    *(
        (
            lambda _, value=value: LEG.scaled(2.0, value),
            ParameterError,
            f"^mass_per_metre: {NUMBER} {re.escape(repr(value))}",
        )
        for value in (0, -1.0, np.nan, np.inf, "half", True)
    ),
    *(
        (
            lambda _, factor=factor: LEG.scaled(factor),
            ParameterError,
            r"lengths\['..'\]: expected .*\[0.001, 1000\]",
        )
        for factor in (1e-4, 1e4)
    ),
    # masses of a limb
    *(
        (call, ParameterError, f"^limb: expected .*fore, hind, got {limb!r}")
        for limb in ("middle", "Fore", None, 1)
        for call in (
            lambda _, limb=limb: segment_masses(limb),
            lambda _, limb=limb: with_limb_masses(LEG, limb),
        )
    ),
    *(
        (lambda _, ask=ask, mass=mass: ask(mass), ParameterError, f"^body_mass: {NUMBER}")
        for mass in (0, -1.0, np.nan, np.inf, "heavy", None)
        for ask in (
            trunk_mass,
            lambda mass: segment_masses("fore", mass),
            lambda mass: with_limb_masses(LEG, "hind", mass),
        )
    ),
    (
        lambda _: with_limb_masses("klann", "fore"),
        ParameterError,
        "geometry: expected Geometry, got 'klann'",
    ),
    (
        lambda _: with_limb_masses(KLANN, "fore"),
        ParameterError,
        "geometry 'klann': expected the paper's mechanism",
    ),
    # models of MuJoCo
    *(
        (lambda _, given=given: IDENTIFIED.to_mjcf(**given), ParameterError, words)
        for given, words in (
            ({"theta": np.nan}, "theta: expected"),
            ({"swing": "far"}, "swing: expected"),
            ({"timestep": 0}, "timestep: expected"),
            ({"timestep": 1}, "timestep: expected"),
            ({"trunk": "suspended"}, "trunk: expected a Trunk"),
            ({"motor": True}, "motor: expected a Motor"),
            ({"motor": Motor}, "motor: expected a Motor"),
            ({"ground": 0.4}, "ground: expected a Ground"),
            ({"path": "leg.urdf"}, "path: expected .*.xml"),
            ({"path": 3}, r"path: expected the path .*, got 3"),
        )
    ),
    # what a leg is for
    (lambda _: LegProfile("klann"), ParameterError, "geometry: expected Geometry, got 'klann'"),
    *(
        (lambda _, cells=cells: LegProfile(LEG, cells), ParameterError, "cells: expected")
        for cells in (0, -1, True, 1024.0, "1024", np.array([1024]), 10**400)
    ),
    (
        lambda _: LegProfile(LEG.replace(lengths={"GJ": 0.8 * LEG.lengths["GJ"]}, full_turn=False)),
        GeometryError,
        "can be assembled at some crank angle",
    ),
    (
        lambda _: ConstrainedLeg(ROCKER, Ground()),
        GeometryError,
        "expected a leg that turns through a full revolution",
    ),
    (
        lambda _: TrunkEngine([Limb(IDENTIFIED), Limb(JANSEN, (0.5, 0.0))], Trunk(kind="free", height=1.6)),
        ParameterError,
        r"limbs\[1\].geometry: expected the mechanism .*leg",
    ),
    # presets that are written
    (
        lambda folder: LEG.save(folder / "mine.txt"),
        ParameterError,
        r"path: expected .*\.json, got .*mine\.txt",
    ),
    (lambda folder: LEG.save(folder / "file" / "mine.json"), OutputError, "cannot write to"),
    *(
        (lambda folder, given=given: LEG.save(folder / "file.json", **given), ParameterError, words)
        for given, words in (
            ({"ground": {"stifness": 1e4}}, r"ground: .*; unknown stifness"),
            (
                {"gaits": {"trot": {"crank_speed": "fast"}}},
                r"gaits\['trot'\]\['crank_speed'\]: expected .*fast",
            ),
            ({"gaits": ["walk"]}, "gaits: expected a mapping"),
            ({"gaits": {5: {"crank_speed": 1.0}}}, "gaits: expected names .*strings, got 5"),
            ({"gaits": {"trot": {5: 1.0}}}, r"gaits\['trot'\]: expected names .*strings, got 5"),
            ({"gaits": {"trot": {}}}, r"gaits\['trot'\]: expected .*names to numbers, got {}"),
            ({"ground": 1.4}, "ground: expected .*stiffness, exponent, got 1.4"),
            *(
                (
                    {"ground": {"exponent": value}},
                    rf"ground\['exponent'\]: {NUMBER} {re.escape(repr(value))}",
                )
                for value in (0, -1.0, np.nan, True, "1.4", [1.4], None)
            ),
        )
    ),
    *(
        (
            lambda _, path=path: LEG.save(path),
            ParameterError,
            rf"path: expected the path .*\.json, got {re.escape(repr(path))}",
        )
        for path in (3, None, True, b"leg.json", ["leg.json"])
    ),
]
"""Call with a folder that has a file, class and words of the error."""


@pytest.mark.parametrize(
    ("call", "error", "words"), CALLS, ids=[f"{k} {row[2]}" for k, row in enumerate(CALLS)]
)
def test_calls(call, error, words, tmp_path, monkeypatch):
    """Nothing is written."""
    (tmp_path / "file").write_text("")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(error, match=words):
        call(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_point_on_the_other_side_has_its_sign_in_the_list_of_points():
    leg = leg_with_everything()
    step = next(step for step in leg.mechanism.steps if getattr(step, "across", ""))
    name = step.across.lstrip("-")
    other = name if step.across.startswith("-") else f"-{name}"
    with pytest.raises(ParameterError, match=rf"lengths.*{name}.*got -0\.1; .*'across': '{other}'"):
        leg.replace(lengths={name: -0.1})

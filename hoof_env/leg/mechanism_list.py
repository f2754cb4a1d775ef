"""Parse and validate the mechanism section of a preset."""

from __future__ import annotations

import json
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from functools import cache
from importlib import resources
from typing import Any

from hoof_env.errors import ParameterError, brief
from hoof_env.leg.mechanism import FRAME, FRAME_NAME, Body, BodyPoint, Dyad, Joint, Mechanism

PARTS = ("fixed", "crank", "points", "bodies", "joints", "feet")
OPTIONAL_PARTS = ("welds",)
SOLID = ("mass", "centre", "inertia")
"""Numbers of a body that is not a uniform rod; they are part of a `Geometry`."""


def read_mechanism(given: Any) -> Mechanism:
    """Read and check the list of a mechanism; see `hoof_env.leg.mechanism`.

    Raises:
        ParameterError: an entry is missing, unknown or inconsistent; the message has its name and the remedy.
    """
    keys = _entries("mechanism", given, PARTS, OPTIONAL_PARTS)
    fixed = _names("mechanism.fixed", keys["fixed"])
    if not fixed:
        raise ParameterError(
            "mechanism.fixed: expected the centre of the crank and the fixed points, got none"
        )
    crank = _entries("mechanism.crank", keys["crank"], ("point", "length"))
    pin = _name("mechanism.crank.point", crank["point"])
    if pin in fixed:
        raise ParameterError(
            f"mechanism.crank.point: expected the moving end of the crank, got the fixed point {pin!r}"
        )
    known = dict.fromkeys((*fixed, pin))
    length = _name("mechanism.crank.length", crank["length"])
    distances = {frozenset((fixed[0], pin)): length}
    bodies = _read_bodies(keys["bodies"])
    steps: list[Dyad | BodyPoint] = []
    for k, entry in enumerate(_list("mechanism.points", keys["points"])):
        where = f"mechanism.points[{k}]"
        read = _read_dyad if isinstance(entry, Mapping) and "dyad" in entry else _read_body_point
        step = read(where, entry, known, bodies, distances)
        if step.point in known:
            raise ParameterError(
                f"{where}: point {step.point!r} is already there; give this one another name"
            )
        known[step.point] = None
        steps.append(step)
    whole = [_measured(body, known, distances) for body in bodies.values()]
    numbers = {body.name: i for i, body in enumerate(whole)}
    mechanism = Mechanism(
        fixed,
        pin,
        length,
        tuple(steps),
        tuple(whole),
        tuple(_read_joints(keys["joints"], whole, numbers, fixed)),
        tuple(_read_welds(keys.get("welds", []), numbers)),
        _names("mechanism.feet", keys["feet"]),
    )
    _check_feet(mechanism)
    _check_crank(mechanism)
    _check_joints(mechanism)
    _check_freedom(mechanism)
    _check_groups(mechanism)
    return mechanism


def split_solids(given: Any) -> tuple[Any, dict[str, dict[str, Any]], dict[str, str]]:
    """Return a list without the numbers of its bodies, these numbers by body, and their entries for errors.
    Any other value is returned unchanged, for `read_mechanism` to refuse."""
    bodies = given.get("bodies") if isinstance(given, Mapping) else None
    if not isinstance(bodies, (list, tuple)):
        return given, {}, {}
    plain: list[Any] = []
    solids: dict[str, dict[str, Any]] = {}
    labels: dict[str, str] = {}
    for k, entry in enumerate(bodies):
        numbers = {key: entry[key] for key in SOLID if key in entry} if isinstance(entry, Mapping) else {}
        if numbers:
            # `read_mechanism` refuses a name that is not a string
            name = str(entry.get("name"))
            solids[name] = numbers
            labels[name] = f"mechanism.bodies[{k}]"
            entry = {key: value for key, value in entry.items() if key not in SOLID}
        plain.append(entry)
    return {**given, "bodies": plain}, solids, labels


def _read_bodies(given: Any) -> dict[str, dict[str, Any]]:
    bodies: dict[str, dict[str, Any]] = {}
    for k, entry in enumerate(_list("mechanism.bodies", given)):
        where = f"mechanism.bodies[{k}]"
        if isinstance(entry, Mapping) and any(key in entry for key in SOLID):
            raise ParameterError(
                f"{where}: a structure has no {', '.join(SOLID)}, which are numbers of a Geometry; give the "
                "list to Geometry(mechanism=...), or the numbers to its `solids`"
            )
        keys = _entries(where, entry, ("name", "tail", "head"), ("length", "points", "role"))
        name = _name(f"{where}.name", keys["name"])
        if name in bodies or name == FRAME_NAME:
            raise ParameterError(f"{where}: expected a name that no other body has, got {brief(name)}")
        ends = [_name(f"{where}.{end}", keys[end]) for end in ("tail", "head")]
        points = _names(f"{where}.points", keys.get("points", ()))
        if len({*ends, *points}) < 2 + len(points):
            raise ParameterError(f"{where}: expected points that differ, got {', '.join([*ends, *points])}")
        role = keys.get("role", "")
        if not isinstance(role, str):
            raise ParameterError(f"{where}.role: expected a string, got {brief(role)}")
        length = _name(f"{where}.length", keys.get("length", name))
        bodies[name] = {
            "where": where,
            "body": Body(name, ends[0], ends[1], length, points, role),
        }
    return bodies


def _read_dyad(
    where: str, entry: Any, known: Mapping[str, None], bodies: Any, distances: dict[frozenset[str], str]
) -> Dyad:
    keys = _entries(where, entry, ("point", "dyad", "lengths"))
    point = _name(f"{where}.point", keys["point"])
    centres = _names(f"{where}.dyad", keys["dyad"])
    lengths = _names(f"{where}.lengths", keys["lengths"])
    if len(centres) != 2 or len(lengths) != 2:
        raise ParameterError(f"{where}: expected two points and two lengths, got {centres} and {lengths}")
    _check_found(where, f"{point!r} lies at a length from", centres, known)
    for centre, name in zip(centres, lengths, strict=True):
        distances[frozenset((centre, point))] = name
    return Dyad(point, *centres, *lengths)


def _check_found(where: str, told: str, names: Iterable[str], known: Mapping[str, None]) -> None:
    """Check that a point is listed after the points that define it."""
    for name in names:
        if name not in known:
            raise ParameterError(
                f"{where}: {told} {name!r}, which is not found before it; those found are {', '.join(known)}"
            )


def _read_body_point(
    where: str, entry: Any, known: Mapping[str, None], bodies: Any, distances: dict[frozenset[str], str]
) -> BodyPoint:
    keys = _entries(where, entry, ("point", "body"), ("from", "along", "across"))
    point = _name(f"{where}.point", keys["point"])
    if not _known(keys["body"], bodies):
        raise ParameterError(
            f"{where}: expected 'dyad' with two points, or 'body' with one of {', '.join(bodies)}, "
            f"got body {keys['body']!r}"
        )
    body = bodies[keys["body"]]["body"]
    ends = [body.tail, body.head]
    origin = keys.get("from", body.tail)
    if not _known(origin, ends):
        raise ParameterError(f"{where}.from: expected an end of {body.name!r}, {ends}, got {brief(origin)}")
    _check_found(where, f"{point!r} lies on body {body.name!r} between", ends, known)
    along, across = (_coordinate(f"{where}.{axis}", keys.get(axis, "")) for axis in ("along", "across"))
    if not along and not across:
        raise ParameterError(f"{where}: expected 'along' or 'across', else {point!r} is {origin!r} itself")
    if not across:
        distances[frozenset((origin, point))] = along.lstrip("-")
    if point not in body.all_points:
        bodies[body.name]["body"] = Body(
            body.name, body.tail, body.head, body.length, (*body.points, point), body.role
        )
    toward = ends[1 - ends.index(origin)]
    return BodyPoint(point, body.name, origin, toward, body.length, along, across)


def _measured(read: Mapping[str, Any], known: Mapping[str, None], distances: Any) -> Body:
    """Return a body whose points are known and whose length is the distance between its ends."""
    body: Body = read["body"]
    for name in body.all_points:
        if name not in known:
            raise ParameterError(
                f"{read['where']}: no entry of 'points' finds {name!r} of body {body.name!r}"
            )
    length = distances.get(frozenset((body.tail, body.head)))
    if length is None:
        apart = ", ".join(sorted("-".join(sorted(pair)) for pair in distances))
        raise ParameterError(
            f"{read['where']}: {body.name!r} needs two ends whose distance is a length ({apart}), "
            f"got {brief(body.tail)} and {body.head!r}"
        )
    if length != body.length:
        raise ParameterError(
            f"{read['where']}: the ends of {body.name!r} are {length!r} apart by the points, "
            f"got the length {body.length!r}; give 'length': {length!r}"
        )
    return body


def _read_joints(
    given: Any, bodies: Sequence[Body], numbers: Mapping[str, int], fixed: Sequence[str]
) -> Iterator[Joint]:
    for k, entry in enumerate(_list("mechanism.joints", given)):
        where = f"mechanism.joints[{k}]"
        if not isinstance(entry, (list, tuple)) or len(entry) != 3:
            raise ParameterError(f"{where}: expected [point, body, body or 'frame'], got {brief(entry)}")
        point, *names = entry
        for name, able in zip(names, (numbers, (*numbers, FRAME_NAME)), strict=True):
            if not _known(name, able):
                raise ParameterError(
                    f"{where}: expected [point, body, body or 'frame'] with bodies of the list "
                    f"({', '.join(numbers)}), got {brief(entry)}"
                )
        i, j = (FRAME if name == FRAME_NAME else numbers[name] for name in names)
        for number, name in ((i, names[0]), (j, names[1])):
            points = fixed if number == FRAME else bodies[number].all_points
            if not _known(point, points):
                raise ParameterError(
                    f"{where}: expected a point of {name!r}, one of {', '.join(points)}, got {brief(point)}"
                )
        yield Joint(point, i, j)


def _read_welds(given: Any, numbers: Mapping[str, int]) -> Iterator[tuple[int, int]]:
    for k, entry in enumerate(_list("mechanism.welds", given)):
        pair = entry if isinstance(entry, (list, tuple)) else ()
        if len(pair) != 2 or not all(_known(name, numbers) for name in pair):
            raise ParameterError(
                f"mechanism.welds[{k}]: expected two bodies of {', '.join(numbers)}, got {brief(entry)}"
            )
        yield numbers[pair[0]], numbers[pair[1]]


def _check_feet(mechanism: Mechanism) -> None:
    feet, movable = mechanism.feet, mechanism.points[len(mechanism.fixed) :]
    on_bodies = {point for body in mechanism.bodies for point in body.all_points}
    if len(feet) not in (1, 2):
        raise ParameterError(f"mechanism.feet: expected one point or two, got {list(feet)}")
    for foot in feet:
        if foot not in movable or foot not in on_bodies:
            able = [name for name in movable if name in on_bodies]
            raise ParameterError(
                f"mechanism.feet: {foot!r} is not a moving point of a body; expected some of"
                f" {', '.join(able)}"
            )


def _check_crank(mechanism: Mechanism) -> None:
    centre, pin = mechanism.centre, mechanism.pin
    driven = [body for body in mechanism.bodies if {body.tail, body.head} == {centre, pin}]
    if len(driven) != 1 or (driven[0].tail, driven[0].head) != (centre, pin):
        raise ParameterError(
            f"mechanism.crank: the driver is not a crank; expected one body with the tail {centre!r}, a "
            f"fixed point, and the head {pin!r}, got {[body.name for body in driven] or 'none'}"
        )
    number = mechanism.crank
    held = [joint for joint in mechanism.joints if {FRAME, number} == {joint.i, joint.j}]
    if [joint.point for joint in held] != [centre] or len(mechanism.parts[number]) > 1:
        raise ParameterError(
            f"mechanism.crank: body {driven[0].name!r} is not a crank; expected one joint with the frame, "
            f"at {centre!r}, and no weld"
        )


def _check_joints(mechanism: Mechanism) -> None:
    """Check that the joints at each point connect its bodies exactly once."""
    for one, other in mechanism.welds:
        if not any({one, other} == {joint.i, joint.j} for joint in mechanism.joints):
            names = f"{mechanism.bodies[one].name!r} and {mechanism.bodies[other].name!r}"
            raise ParameterError(f"mechanism.welds: {names} need a joint between them")
    for point in mechanism.points:
        part = {number: {number} for number in mechanism.at(point)}
        for joint in mechanism.joints:
            if joint.point != point:
                continue
            if part[joint.i] is part[joint.j]:
                raise ParameterError(
                    f"mechanism.joints: at {point!r} two joints tie the same bodies; leave one of them out"
                )
            whole = part[joint.i] | part[joint.j]
            for number in whole:
                part[number] = whole
        if part and len(next(iter(part.values()))) < len(part):
            raise ParameterError(
                f"mechanism.joints: at {point!r} the joints leave bodies apart; tie each to another one"
            )


def _check_freedom(mechanism: Mechanism) -> None:
    coordinates = 3 * len(mechanism.bodies)
    rows = 2 * len(mechanism.joints) + len(mechanism.welds) + 1
    if coordinates != rows:
        free = coordinates - rows
        left = f"{free + 1} degrees of freedom" if free > 0 else f"{-free} rows too many"
        mend = "add joints or welds" if free > 0 else "leave out joints or welds"
        raise ParameterError(
            f"mechanism.joints: {len(mechanism.bodies)} bodies have {coordinates} coordinates, and joints, "
            f"welds and crank give {rows} rows: {left}; expected one degree of freedom, so {mend}"
        )


def _check_groups(mechanism: Mechanism) -> None:
    """Check that each body but the crank is one of the two that meet in a dyad's point."""
    placed = {mechanism.crank}
    for dyad in mechanism.dyads:
        parts = []
        for end in (dyad.first, dyad.second):
            names = mechanism.bodies_with(end, dyad.point)
            if not names:
                raise ParameterError(
                    f"mechanism.bodies: no body has {end!r} and {dyad.point!r}, which the dyad of "
                    f"{dyad.point!r} holds at a length; add one"
                )
            parts.append({i for name in names for i in mechanism.parts[name]})
        placed |= parts[0] | parts[1]
    for i, body in enumerate(mechanism.bodies):
        if i not in placed:
            raise ParameterError(
                f"mechanism.bodies: body {body.name!r} is not moved by a dyad or the crank; let it hold two "
                "points of one, or weld it to a body that does"
            )


def _entries(where: str, given: Any, required: Sequence[str], optional: Sequence[str] = ()) -> dict[str, Any]:
    if not isinstance(given, Mapping):
        raise ParameterError(f"{where}: expected an object with {', '.join(required)}, got {brief(given)}")
    missing = [name for name in required if name not in given]
    unknown = [str(name) for name in given if name not in (*required, *optional)]
    if missing or unknown:
        wanted = ", ".join(required) + (f", and perhaps {', '.join(optional)}" if optional else "")
        wrong = [f"missing {', '.join(missing)}"] if missing else []
        wrong += [f"unknown {', '.join(unknown)}"] if unknown else []
        raise ParameterError(f"{where}: expected exactly {wanted}; {'; '.join(wrong)}")
    return dict(given)


def _known(given: Any, names: Container[str]) -> bool:
    # a list or an object has no hash and would raise a TypeError, and an array is equal in parts
    return isinstance(given, str) and given in names


def _list(where: str, given: Any) -> Sequence[Any]:
    if not isinstance(given, (list, tuple)):
        raise ParameterError(f"{where}: expected a list, got {brief(given)}")
    return given


def _name(where: str, given: Any) -> str:
    if not isinstance(given, str) or not given or given.startswith("-"):
        raise ParameterError(f"{where}: expected a name, got {brief(given)}")
    # Names become columns of files, with these characters as separators.
    if not given.isprintable() or any(letter in given for letter in ',;"'):
        raise ParameterError(
            f"{where}: expected a printable name without commas, semicolons and quotes, got {brief(given)}"
        )
    return given


def _names(where: str, given: Any) -> tuple[str, ...]:
    names = tuple(_name(f"{where}[{k}]", name) for k, name in enumerate(_list(where, given)))
    if len({*names}) < len(names):
        raise ParameterError(f"{where}: expected names that differ, got {list(names)}")
    return names


def _coordinate(where: str, given: Any) -> str:
    if isinstance(given, str) and not given:
        return ""
    if not isinstance(given, str) or not given.removeprefix("-") or given.startswith("--"):
        raise ParameterError(f"{where}: expected the name of a length, or '-' and a name, got {brief(given)}")
    return given


@cache
def _paper() -> dict[str, Any]:
    path = resources.files("hoof_env").joinpath("data", "mechanisms", "paper.json")
    return dict(json.loads(path.read_text(encoding="utf-8")))


PAPER = read_mechanism(_paper()["mechanism"])
"""The mechanism of the paper's Eq. 2, which a preset without a list has: 14 bodies, 20 joints, a weld."""

Flesh = tuple[str, str, float, float]


def flesh_of(mechanism: Mechanism) -> list[Flesh]:
    """Return the flesh around the links where a horse's leg has its bones: from point, to point, radius at
    both ends [m]; empty for any mechanism except the paper's."""
    flesh = _paper()["flesh"] if mechanism == PAPER else []
    return [(tail, head, float(one), float(other)) for tail, head, one, other in flesh]

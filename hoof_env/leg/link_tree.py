"""Rigid links of a leg in a tree, and the pins that close its loops.

Simulators with joint coordinates take a tree of links with one hinge each; pins outside the tree are
constraints. Bodies that cannot move against each other, welded ones and triangles of rods, can be one link:
that leaves fewer hinges and fewer constraints.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from hoof_env.leg.mechanism import FRAME, FRAME_NAME, Joint, Mechanism

CRANK_LINK = "crank"
"""Name of the link that is driven."""

HOOF_LINK = "hoof"
"""Name of the link with the foot that touches the ground."""

TAKEN = (FRAME_NAME, CRANK_LINK, HOOF_LINK, "world", "trunk", "swing", "x", "z", "pitch")
"""Names that a simulator's model already uses for parts and joints."""

Pins = dict[tuple[str, str, str], list[tuple[int, int]]]


@dataclass(frozen=True)
class LinkTree:
    """Leg as rigid links and the pins between them.

    Attributes:
        mechanism: structure of the leg.
        links: numbers of the bodies in each link, by its name: `CRANK_LINK`, `HOOF_LINK`, otherwise the name
            of its first body, with "_" behind it if it is one of `TAKEN`.
        tree: every link, the one (or `FRAME_NAME`) that carries it and the point of the pin between them;
            carriers stand before what they carry.
    """

    mechanism: Mechanism
    links: dict[str, tuple[int, ...]]
    tree: tuple[tuple[str, str, str], ...]

    @cached_property
    def pins(self) -> Pins:
        """Rows of `Mechanism.joints` in each pin (point, link, other) and their signs: the force of `other`
        on `link` is their signed sum."""
        link_of = _link_of(self.links)
        pins: Pins = {}
        for row, joint in enumerate(self.mechanism.joints):
            one = link_of[joint.i]
            two = link_of[joint.j]
            if one == two:
                continue  # the inside of a rigid link
            # On the other link the force has the opposite sign
            if (joint.point, two, one) in pins:
                pins[joint.point, two, one].append((row, -1))
            else:
                pins.setdefault((joint.point, one, two), []).append((row, 1))
        return pins

    @cached_property
    def carrier(self) -> dict[str, tuple[str, str]]:
        """Carrier and pin of each link."""
        return {link: (parent, point) for link, parent, point in self.tree}

    @cached_property
    def loops(self) -> tuple[tuple[str, str, str], ...]:
        """Pins outside the tree, which close loops. Of several links at a point, a pair that other pins
        already hold together there is left out, because it would be held twice."""
        held: dict[str, list[set[str]]] = {}
        for link, parent, point in self.tree:
            _join(held.setdefault(point, []), link, parent)
        return tuple(
            (point, one, two) for point, one, two in self.pins if _join(held.setdefault(point, []), one, two)
        )

    @cached_property
    def locked(self) -> tuple[tuple[str, str], ...]:
        """Pairs of links that a weld holds in one orientation."""
        link_of = _link_of(self.links)
        pairs = ((link_of[one], link_of[two]) for one, two in self.mechanism.welds)
        return tuple((one, two) for one, two in pairs if one != two)

    def carried_points(self, link: str) -> tuple[str, ...]:
        """Return the points of a link's bodies, each once."""
        bodies = (self.mechanism.bodies[k] for k in self.links[link])
        return tuple(dict.fromkeys(point for body in bodies for point in body.all_points))

    def pin_forces(self, joints: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the forces at the pins [N], shape (..., pins, 2), from the forces at the joints, shape
        (..., joints, 2)."""
        signed = [sum(sign * joints[..., row, :] for row, sign in rows) for rows in self.pins.values()]
        return np.stack(signed, axis=-2)


def link_tree(mechanism: Mechanism, merge: bool = True) -> LinkTree:
    """Return the tree of a leg's links, each as few pins from the frame as possible.

    Args:
        mechanism: structure of the leg.
        merge: make one link of bodies that cannot move against each other; otherwise every body is a link,
            and welds are `LinkTree.locked`.
    """
    count = len(mechanism.bodies)
    groups = _rigid_groups(mechanism) if merge else [{k} for k in range(count)]
    hoof = mechanism.body_of_foot(mechanism.feet[0])
    links: dict[str, tuple[int, ...]] = {}
    names = [body.name for body in mechanism.bodies]
    for members in sorted(groups, key=min):
        name = names[min(members)]
        if name in TAKEN:
            while name in (*TAKEN, *names):
                name += "_"
        if hoof in members:
            name = HOOF_LINK
        if mechanism.crank in members:
            name = CRANK_LINK
        links[name] = tuple(sorted(members))
    return LinkTree(mechanism, links, tuple(_grow(mechanism.joints, links)))


def _join(groups: list[set[str]], one: str, two: str) -> bool:
    """Merge the groups of two links; return False if they are already one group."""
    mine = next((group for group in groups if one in group), {one})
    others = next((group for group in groups if two in group), {two})
    if mine is others:
        return False
    groups[:] = [group for group in groups if group is not mine and group is not others]
    groups.append(mine | others)
    return True


def _link_of(links: dict[str, tuple[int, ...]]) -> dict[int, str]:
    return {FRAME: FRAME_NAME} | {body: link for link, bodies in links.items() for body in bodies}


def _grow(joints: Iterable[Joint], links: dict[str, tuple[int, ...]]) -> Iterable[tuple[str, str, str]]:
    """Yield the tree from the frame outwards, in breadth: shallow trees have sparse matrices of mass."""
    link_of = _link_of(links)
    reached = [FRAME_NAME]
    for carrier in reached:  # grows meanwhile
        for joint in joints:
            pair = (link_of[joint.i], link_of[joint.j])
            if carrier not in pair:
                continue
            link = pair[1] if pair[0] == carrier else pair[0]
            if link not in reached:
                reached.append(link)
                yield link, carrier, joint.point


def _rigid_groups(mechanism: Mechanism) -> list[set[int]]:
    """Return the bodies in groups that cannot move against each other.

    Welded bodies are one group, and so are three groups that are pinned to each other in three points. Two
    pins between two groups would be redundant: `read_mechanism` refuses such a list.
    """
    groups = [set(part) for part in dict.fromkeys(mechanism.parts)]
    while (found := _rigid_triangle(mechanism, groups)) is not None:
        groups = [group for group in groups if group not in found]
        groups.append(set().union(*found))
    return groups


def _rigid_triangle(mechanism: Mechanism, groups: list[set[int]]) -> list[set[int]] | None:
    """Return three groups that are pinned to each other in three points, or None."""
    # A joint names two of the bodies at its point, and all of them meet there
    pinned = {joint.point: set(mechanism.at(joint.point)) for joint in mechanism.joints}

    def shared(one: set[int], two: set[int]) -> set[str]:
        return {point for point, bodies in pinned.items() if one & bodies and two & bodies}

    for few in combinations(groups, 3):
        corners = [shared(one, two) for one, two in combinations(few, 2)]
        if all(corners) and len(set().union(*corners)) > 2:
            return [*few]
    return None

"""Proof that a policy sees nothing of the ground: its actions, computed in a world with other ground and
replayed in the real one, return the same.

A policy without feedback acts on its start, on its crank and gait, and on the command, which depend on
no force. So it acts alike on any ground, and the returns must be the same to the last bit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hoof_env.errors import DataFileError, ParameterError
from hoof_env.evaluation.episodes import make_rows
from hoof_env.policies.actor import Actor

OTHER_GROUNDS = ((0.05, 10.0), (0.05, 0.2), (0.2, 3.0), (0.2, 0.5), (0.3, 1.5), (0.3, 0.7))
"""Friction of other grounds, and factors of their stiffness, the most unlike first. On the first of them some
animals fall, and an episode that is over has no more actions to replay. A ground that needs another number of
substeps is passed over: the crank's motion has the error of its step, and would differ by that."""


@dataclass(frozen=True)
class Proof:
    """What a replay has shown.

    Attributes:
        friction, stiffness: of the other ground [-, N/m^n].
        episodes: episodes that went on in the other world until they ended in the real one.
        of: episodes that were played.
        difference: largest difference of a return from the policy's own, in the episodes that went on.
        actions: largest difference of an action from the policy's own, while an episode goes on in both
            worlds. Zero differences prove blindness.
        elsewhere: largest difference of returns between the worlds, which shows that the ground matters.
    """

    friction: float
    stiffness: float
    episodes: int
    of: int
    difference: float
    actions: float
    elsewhere: float


def prove(
    policy: Any, env_id: str, seeds: Sequence[int], env_kwargs: Mapping[str, Any] | None = None
) -> Proof:
    """Replay the actions of another world in the real one.

    Args:
        policy: policy with `predict` for many observations.
        env_id: id of the environment, of this package.
        seeds: seeds of the episodes.
        env_kwargs: arguments of the environment.

    Raises:
        ParameterError: the id has no native vector environment.
        DataFileError: an action or a return differs, so the policy sees the ground; or nothing is proved, as
            most episodes ended early on each other ground, or no return depends on it.
    """
    kwargs = dict(env_kwargs or {})
    real = make_rows(env_id, len(seeds), **kwargs)
    if real is None:
        raise ParameterError(f"env_id: expected an id of this package with many at once, got {env_id!r}")
    settings: Any = real.settings
    stiffness = float(real.engine.ground.stiffness)
    proof = None
    for friction, factor in OTHER_GROUNDS:
        ground = {"friction": friction, "stiffness": factor * stiffness}
        other = make_rows(env_id, len(seeds), **kwargs | ground)
        assert other is not None
        if other.engine.substeps != real.engine.substeps:
            continue
        own, here, there, whole, actions = replay(policy, real, other, seeds)
        proof = Proof(
            **ground,
            episodes=int(whole.sum()),
            of=len(seeds),
            difference=float(np.abs(own - here)[whole].max(initial=0.0)),
            actions=actions,
            elsewhere=float(np.abs(here - there)[whole].max(initial=0.0)),
        )
        if 2 * proof.episodes >= proof.of:
            break
    assert proof is not None
    if proof.difference or proof.actions:
        raise DataFileError(
            f"policy on {env_id}: expected actions that do not depend on the ground; with friction"
            f" {proof.friction:g} they differ by up to {proof.actions:.3g}, and replayed they differ by up to"
            f" {proof.difference:.3g} in their returns (observed: {', '.join(settings.observation)})"
        )
    if 2 * proof.episodes < proof.of or not proof.elsewhere:
        raise DataFileError(
            f"policy on {env_id}: expected episodes on other ground that prove something; {proof.episodes} of"
            f" {proof.of} last there, and their returns differ by {proof.elsewhere:.3g} between the grounds"
        )
    return proof


def replay(policy: Any, real: Any, other: Any, seeds: Sequence[int]) -> tuple[Any, Any, Any, Any, float]:
    """Play a policy in two worlds, and the actions of the other one in the real one.

    Returns:
        Returns of the policy in the real world, of the replayed actions there, and of the policy in the other
        world, each of shape (n,); the episodes that lasted in the other world as long as in the real one; and
        the largest difference of the actions while an episode goes on in both worlds.
    """
    (own,), _, own_actions = _episodes(policy, [real], seeds)
    (here, there), whole, other_actions = _episodes(policy, [real, other], seeds)
    difference = 0.0
    for (mine, is_mine), (theirs, is_theirs) in zip(own_actions, other_actions, strict=False):
        gap = np.abs(np.asarray(mine, float) - theirs)[is_mine & is_theirs]
        difference = max(difference, float(gap.max(initial=0.0)))
    return own, here, there, whole, difference


def _episodes(
    policy: Any, worlds: Sequence[Any], seeds: Sequence[int]
) -> tuple[Any, Any, list[tuple[Any, Any]]]:
    """Play an episode for each seed in each world, with the actions of the last; return the returns, shape
    (worlds, n), the rows whose last world was not over before another one, and the actions of each step with
    the rows that were going on in the last world."""
    count = len(seeds)
    actor = Actor(policy)
    actor.begin(count)
    seen = [world.reset(seed=list(seeds), options=actor.start)[0] for world in worlds]
    totals = np.zeros((len(worlds), count))
    going = np.ones((len(worlds), count), bool)
    whole = np.ones(count, bool)
    taken = []
    while going.any():
        # A row that starts again is no longer compared, so the policy need not know of it
        actions = actor.act(seen[-1])
        taken.append((actions, going[-1].copy()))
        for k, world in enumerate(worlds):
            seen[k], rewards, terminated, truncated, _ = world.step(actions)
            totals[k] += np.where(going[k], rewards, 0.0)
            going[k] &= ~(terminated | truncated)
        # What an ended episode of the last world would have done is not known
        whole &= going[-1] | ~going[:-1].any(0)
    return totals, whole, taken

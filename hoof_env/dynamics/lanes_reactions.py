"""Joint reactions of the legs (`reactions`); see `lanes`."""

from __future__ import annotations

from hoof_env.dynamics import limb_rows as b
from hoof_env.dynamics import trunk_rows as t
from hoof_env.dynamics.lanes_ground import HEEL, TOE
from hoof_env.dynamics.reactions import keep_reactions, leg_reactions
from hoof_env.dynamics.vectors import vector
from hoof_env.leg import profile as f
from hoof_env.simd import across, level, plane
from hoof_env.simd.compile import inlined


@inlined
def react(trunk, limb, constants, found):  # type: ignore[no-untyped-def]
    """Reactions of one leg; `constants` and `found` are rows of `reactions`."""
    hip, pitch_rate, pitch_acc = vector(limb, b.HIP), trunk[t.PITCH_RATE], trunk[t.PITCH_ACC]
    weight = plane(level(trunk, 0.0), trunk[t.GRAVITY])
    lift = vector(trunk, t.ACC) + weight + pitch_acc * across(hip) - pitch_rate * pitch_rate * hip
    joints, lock, driver, by_trunk = leg_reactions(
        constants,
        plane(limb[b.VALUES + f.COS], limb[b.VALUES + f.SIN]), limb[b.SPIN], limb[b.SPIN_RATE],
        vector(limb, b.TURN), limb[b.FRAME_RATE],
        pitch_acc + limb[b.K] * limb[b.SPIN_RATE] + limb[b.SWAY_RATE],
        lift, vector(limb, TOE + b.FORCE), vector(limb, HEEL + b.FORCE),
    )  # fmt: skip
    keep_reactions(found, joints, lock, driver, by_trunk)

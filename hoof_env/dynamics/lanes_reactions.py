"""Joint reactions of the legs in a tile of environments (`reactions`); see `lanes`."""

from __future__ import annotations

from hoof_env._jit import inlined
from hoof_env.dynamics import limb_rows as b
from hoof_env.dynamics import trunk_rows as t
from hoof_env.dynamics.reactions import keep_reactions, leg_reactions
from hoof_env.dynamics.vectors import across, times, vector
from hoof_env.leg import profile as f


@inlined
def ground_force(limb, point, lane):  # type: ignore[no-untyped-def]
    """Force of the ground on toe (0) or heel (1), in the world."""
    c = b.CONTACT + point * b.CONTACT_ROWS
    normal = vector(limb, c + b.NORMAL_X, lane)
    return times(limb[c + b.NORMAL, lane], normal) - times(limb[c + b.RUB, lane], across(normal))


@inlined
def react(trunk, limb, constants, found):  # type: ignore[no-untyped-def]
    """Reactions of one leg in every lane; `constants` and `found` are tiles of `reactions`' rows."""
    for lane in range(limb.shape[1]):
        hip, pitch_rate = vector(limb, b.HIP, lane), trunk[t.PITCH_RATE, lane]
        pitch_acc = trunk[t.PITCH_ACC, lane]
        lift = (
            vector(trunk, t.ACC, lane)
            + complex(0.0, trunk[t.GRAVITY, lane])
            + times(pitch_acc, across(hip))
            - times(pitch_rate * pitch_rate, hip)
        )
        joints, lock, driver, by_trunk = leg_reactions(
            constants, lane,
            complex(limb[b.VALUES + f.COS, lane], limb[b.VALUES + f.SIN, lane]),
            limb[b.SPIN, lane], limb[b.SPIN_RATE, lane],
            vector(limb, b.TURN, lane), limb[b.FRAME_RATE, lane],
            pitch_acc + limb[b.K, lane] * limb[b.SPIN_RATE, lane] + limb[b.SWAY_RATE, lane],
            lift, ground_force(limb, 0, lane), ground_force(limb, 1, lane),
        )  # fmt: skip
        keep_reactions(found, lane, joints, lock, driver, by_trunk)

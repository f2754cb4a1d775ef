"""Joint reactions along an episode, from a second engine that runs its substeps again and computes them.

The second engine begins every control step with the same bits as the first, and arrives at the same bits. Its
kernels are compiled at the first use.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import ParameterError
from hoof_env.leg.mechanism import FRAME, Mechanism

MOMENTS = {"lock_moment": "lock", "crank_moment": "driver", "hip_moment": "hip"}
"""Parts of `dynamics.parts.Reactions` by column [N m]: moments on body 10 by body 7, on the crank by the
leg's frame, and on the leg's frame by the trunk about the crank centre."""


def joint_columns(mechanism: Mechanism) -> list[str]:
    """Return the columns of forces [N] at a joint on one body by another, with the bodies' numbers in Eq. 2:
    `joint_G_11_10_x` is the force at the ankle on the hoof triangle (11) by the shank (10) along x."""
    return [
        f"joint_{joint.point}_{joint.i + 1}_{'frame' if joint.j == FRAME else joint.j + 1}_{axis}"
        for joint in mechanism.joints
        for axis in "xy"
    ]


def reaction_units(mechanism: Mechanism) -> dict[str, str]:
    """Return the units by column of a limb's reactions."""
    moments = [name for name in MOMENTS if name != "lock_moment" or mechanism.welds]
    return dict.fromkeys(joint_columns(mechanism), "N") | dict.fromkeys(moments, "N m")


class JointReactions:
    """Reactions at the substeps of an environment of this package.

    Args:
        env: the environment, wrapped or not, before its `reset`.

    Raises:
        ParameterError: the environment is run by the paper's solver, or its legs vary in size.
    """

    def __init__(self, env: Any) -> None:
        self._env = leg = env.unwrapped
        if leg.resolved_settings.solver == "paper":
            raise ParameterError('reactions: expected an environment with solver="exact", got solver="paper"')
        # The environment's engine has kernels without reactions, which are faster.
        self._engine = leg.engine.alone(reactions=True)

    def before(self) -> NDArray[np.float64]:
        """Return the memory of the environment's engine, for `after`."""
        column: NDArray[np.float64] = self._env.engine.column(0)
        return column

    def now(self) -> NDArray[np.float64]:
        """Compute the reactions in the present state of the environment, shape (1, legs, columns)."""
        self._engine.set_column(0, self.before())
        self._engine.observe()
        return self._row()[None]

    def after(self, before: NDArray[np.float64], steps: int) -> NDArray[np.float64]:
        """Compute the reactions at the `steps` substeps since `before`, shape (steps, legs, columns), with
        the columns of `reaction_units`."""
        self._engine.set_column(0, before)
        rows: list[NDArray[np.float64]] = []
        for command, count in self._env.commands_between(before, self.before()):
            for _ in range(min(count, steps - len(rows))):
                self._engine.advance(command, 1)
                rows.append(self._row())
        return np.array(rows)

    def _row(self) -> NDArray[np.float64]:
        """Return the reactions of the second engine, shape (legs, columns)."""
        reactions = self._engine.reactions()
        legs = len(reactions.joints)
        parts = [getattr(reactions, part)[..., 0] for part in MOMENTS.values()]
        moments = [part for part in parts if part.size]
        return np.column_stack([reactions.joints.reshape(legs, -1), *moments])

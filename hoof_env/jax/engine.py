"""Engine inside JAX: the substeps of a control step are one `lax.scan` over the rows of the stack."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from hoof_env.dynamics.advance import Advance
from hoof_env.dynamics.limits import CHECK_EVERY
from hoof_env.dynamics.mechanics import evaluate
from hoof_env.dynamics.stepping import begin_step
from hoof_env.simd import Cell
from hoof_env.simd.machines import CURRENT


class JaxAdvance(Advance):
    """Engine whose loop over substeps is traced once."""

    def _run(self, h: Any, steps: Any, keeps_account: Any) -> None:
        """Advance by `steps` of `h` [s], as `Advance` does.

        A turn of the scan goes from one whole step to the next, and there looks at the new state. Before the
        first one nothing is remembered: the memory has what the last step remembered. Rounding would make a
        hoof that starts on the ground, at a penetration of 0, one that is above it or in it.
        """
        model = self.model
        begin_step(self.trunk, self.legs, self.leg_count, model)
        evaluate(self.trunk, self.legs, self.leg_count, model, 0.0)

        def turn(rows: Any, is_due: Any) -> Any:
            self._take(rows)
            stage, elapsed = Cell(0), Cell(0.0)
            for _ in range(model.stages):
                self._move(stage, elapsed, h, keeps_account)
                evaluate(self.trunk, self.legs, self.leg_count, model, elapsed.value)
            self._remember(1, h, steps)
            if model.form.has_limits:
                before = self._rows()
                self._check_limits()
                after = self._rows()
                self._take(jax.tree.map(lambda x, y: jnp.where(is_due, x, y), after, before))
            return self._rows(), None

        left = steps - 1 - jnp.arange(steps)
        rows, _ = jax.lax.scan(jax.checkpoint(turn), self._rows(), left % CHECK_EVERY == 0)
        self._take(rows)

    def _rows(self) -> list[Any]:
        """Return all rows of the stack as arrays of one shape and type."""
        lanes, kind = self.arrangement.lanes, CURRENT.machine.kind
        shape = (lanes,) if lanes > 1 else ()

        def array(x: Any) -> Any:
            return jnp.broadcast_to(jnp.asarray(0.0 if x is None else x, kind), shape)

        return [array(x) for rows in self._places() for x in rows]

    def _take(self, rows: list[Any]) -> None:
        """Put arrays in place of all rows."""
        first = 0
        for place in self._places():
            place[:] = rows[first : first + len(place)]
            first += len(place)

    def _places(self) -> list[list[Any]]:
        stack: tuple[Any, ...] = self.trunk, self.legs, self.account
        return [rows._place for rows in stack]

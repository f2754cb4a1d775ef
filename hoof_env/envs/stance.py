"""Stances and sums: what reward and episode summary read from the trace, in one pass over its rows.

A stance opens when the normal force on the hoof rises above a threshold, as on a force plate. It closes when
the force falls below it (lift-off), or after one crank revolution, whichever comes first, so that a hoof that
never lifts pays for a peak every revolution. While it is open its peak is the highest resultant ground
reaction force of any substep; the increases of a stance's running peak add up to that peak.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hoof_env.simd.compile import kernel

ACCOUNT = np.dtype(
    [
        ("threshold", "f8"),  # normal force that tells stance from swing [N]
        ("open", "b1"),
        ("opened_at", "f8"),  # crank angle [rad]
        ("peak", "f8"),  # of the open stance [N]
        ("peak_increase", "f8"),  # in the last control step [N]
        ("progress", "f8"),  # in the last control step [m]
        ("work", "f8"),  # positive work of both drives in the last control step [J]
        ("stances", "i8"),
        ("time", "f8"),  # [s]
        ("loaded_time", "f8"),  # [s]
        ("distance", "f8"),  # [m]
        ("total_work", "f8"),  # [J]
        ("impulse", "f8"),  # of the normal force [N s]
        ("peak_sum", "f8"),  # of all stances so far [N]
        ("highest", "f8"),  # force of the episode [N]
    ]
)


LIFT_OFF = 0.05
"""Threshold of a stance, in weights of trunk and leg. A hoof that merely grazes the ground between two pushes
has lifted off: were any contact stance, a policy could hold one peak for ever and push under it."""


def new_account(threshold: float) -> Any:
    """An empty account, as a record of dtype `ACCOUNT`, with the threshold of a stance [N]."""
    account = np.zeros(1, ACCOUNT)[0]
    account["threshold"] = threshold
    return account


@kernel
def take_account(account, trace, h, start_x, fixed):  # type: ignore[no-untyped-def]
    """Add the rows of one control step to the account.

    Args:
        account: record of dtype `ACCOUNT`.
        trace: rows of dtype `TRACE`, `h` [s] apart.
        start_x: where the trunk was before the first row [m].
        fixed: on a trunk that cannot move, progress is the load-weighted backward travel of the hoof points
            while they bear load, and 0 in the air; else it is the trunk's.
    """
    account.peak_increase = 0.0
    account.work = 0.0
    account.progress = 0.0
    for k in range(trace.shape[0]):
        row = trace[k]
        loaded = row.normal > account.threshold
        if account.open and (not loaded or row.theta - account.opened_at >= 2.0 * np.pi):
            account.open = False
        if loaded and not account.open:
            account.open = True
            account.opened_at = row.theta
            account.peak = 0.0
            account.stances += 1
        if not account.open:
            account.peak = 0.0
        elif row.grf > account.peak:
            account.peak_increase += row.grf - account.peak
            account.peak = row.grf
        account.highest = max(account.highest, row.grf)
        account.work += h * (max(row.crank_power, 0.0) + max(row.hip_power, 0.0))
        account.impulse += h * row.normal
        if row.normal > 0.0:
            account.loaded_time += h
            if fixed:
                account.progress -= (
                    h * (row.toe_normal * row.toe_vx + row.heel_normal * row.heel_vx) / row.normal
                )
    if not fixed:
        account.progress = trace[trace.shape[0] - 1].trunk_x - start_x
    account.time += h * trace.shape[0]
    account.distance += account.progress
    account.total_work += account.work
    account.peak_sum += account.peak_increase

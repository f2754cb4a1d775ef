"""Names of quantities that were others once, which are refused with the present ones."""

from __future__ import annotations

from collections.abc import Iterable
from types import MappingProxyType
from typing import Any

RENAMED = MappingProxyType(
    {
        "peak_increase": "peak_grf_increase",
        "highest": "highest_grf",
        "load_impulse": "normal_impulse",
        "toe_rate": "toe_penetration_rate",
        "heel_rate": "heel_penetration_rate",
        "toe_slowness": "toe_inverse_approach_speed",
        "heel_slowness": "heel_inverse_approach_speed",
        "toe_give_normal": "toe_deflection_normal",
        "toe_give_tangential": "toe_deflection_tangential",
        "heel_give_normal": "heel_deflection_normal",
        "heel_give_tangential": "heel_deflection_tangential",
        "theta": "crank_angle",
        "theta_rate": "crank_angle_rate",
        "theta_acc": "crank_angle_acceleration",
        "phi": "swing_angle",
        "phi_rate": "swing_angle_rate",
        "phi_acc": "swing_angle_acceleration",
        "pitch_acc": "pitch_acceleration",
        "trunk_x": "x",
        "trunk_y": "y",
        "trunk_vx": "vx",
        "trunk_vy": "vy",
        "crank_speed": "crank_angle_rate",  # in columns of substeps only
        "peak_grf_n": "highest_grf_n",
        "mean_grf_n": "mean_normal_n",
        "drive_work_j": "positive_work_j",
    }
)
"""Present names of quantities, by the old ones."""


def present_name(key: str, names: Iterable[str]) -> str | None:
    """Return the present name of a quantity, also behind the name of a leg; None if `key` is no old name.

    Args:
        key: name to look up.
        names: names that there are.
    """
    for old, new in RENAMED.items():
        name = key.removesuffix(old) + new
        if (key == old or key.endswith(f"_{old}")) and name in names:
            return name
    return None


class NamedColumns(dict[str, Any]):
    """Quantities by name; an old name raises a `KeyError` with the present one."""

    def __missing__(self, key: str) -> Any:
        """Raise a `KeyError`."""
        new = present_name(key, self) if isinstance(key, str) else None
        raise KeyError(f"{key!r} is called {new!r} now" if new else key)

    def get(self, key: Any, default: Any = None) -> Any:
        """Return the quantity, or `default` if there is none of this name.

        Raises:
            KeyError: an old name, which would pass for one that is not there.
        """
        is_old = key not in self and isinstance(key, str) and present_name(key, self)
        return self[key] if is_old or key in self else default

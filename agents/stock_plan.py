"""Trainings of `agents.stock`, and the file of its learning curves."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from hoof_env.errors import DataFileError


@dataclass(frozen=True)
class Curves:
    """Trainings of one algorithm on one id, with a score every `every` steps."""

    env_id: str
    algo: str
    seeds: int
    steps: int
    every: int  # steps between two scores
    preset: str = ""  # leg, if it is not the id's own
    half_rates: bool = False  # with `HALF_RATES`


TUNED: Final = "ppo_flat"
"""Name of the one learner that is not stock, for comparison: its settings are those of agents/hyperparams."""

LEG, RAIL, SPEED, TERRAIN, FIXED, HORSE = (
    f"hoof_env/{name}-v0"
    for name in ("HorseLeg", "HorseLegRail", "HorseLegSpeed", "HorseLegTerrain", "HorseLegFixed", "Horse")
)
OTHERS = (RAIL, SPEED, TERRAIN, HORSE, FIXED)

PLAN = (
    Curves(LEG, "ppo", 10, 400_000, 20_480),
    Curves(LEG, "sac", 10, 60_000, 6_000),
    *(Curves(env_id, "ppo", 10 if env_id == RAIL else 5, 300_000, 20_480) for env_id in OTHERS),
    Curves(LEG, "td3", 5, 60_000, 6_000),
    Curves(LEG, "tqc", 5, 60_000, 6_000),
    Curves(LEG, TUNED, 10, 3_000_000, 40_960),
    *(Curves(env_id, "sac", 3, 60_000, 6_000) for env_id in OTHERS),
)
"""Trainings of the published table, in the order of training."""

LEGS = ("jansen", "klann", "fourbar")
"""Presets of other legs that are trained on `LEG`."""

LEGS_PLAN = (
    *(Curves(LEG, "ppo", 5, 200_000, 20_480, preset) for preset in LEGS),
    *(Curves(LEG, "sac", 5, 60_000, 6_000, preset) for preset in LEGS),
    *(Curves(LEG, "ppo", 5, 200_000, 20_480, preset, half_rates=True) for preset in LEGS),
)
"""Their trainings."""

HALF_RATES = {"crank_rate": 9.0, "swing_rate": 0.6}
"""Settings under which actions change a gait half as fast as usual: for a leg whose foot is far from its
crank, so that its gait changes too much."""


COLUMNS = ("env_id", "algo", "seed", "steps", "return", "train_seconds", "commit", "processor")
"""Columns of curves.csv: a line for each score. The seconds are those of the processor for learning alone so
far; the commit is that of the code that trained, empty if there is no git. The processor is empty in rows
from before it was noted."""

FIGURES = ("speed_m_s", "stance_peak_n", "cost_of_transport", "weight_share")
"""Further columns for other legs: means of the episodes of the score."""


def leg_folder(preset: str, half_rates: bool = False) -> str:
    """Return the name of the folder of a leg's curves."""
    return f"{preset}-half-rates" if half_rates else preset


def read_curves(folder: Path) -> list[dict[str, Any]]:
    """Return the rows of curves.csv; an empty list if there is no such file.

    Raises:
        DataFileError: it cannot be read.
    """
    path = folder / "curves.csv"
    if not path.is_file():
        return []
    try:
        with path.open(encoding="utf-8", newline="") as file:
            return [
                {
                    "env_id": row["env_id"],
                    "algo": row["algo"],
                    "seed": int(row["seed"]),
                    "steps": int(row["steps"]),
                    "return": float(row["return"]),
                    "train_seconds": float(row["train_seconds"]),
                    "commit": row["commit"] or "",
                    "processor": row.get("processor") or "",
                    **{name: float(row[name]) for name in FIGURES if name in row},
                }
                for row in csv.DictReader(file)
            ]
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise DataFileError(f"{path}: expected columns {', '.join(COLUMNS)}: {error!r}") from None

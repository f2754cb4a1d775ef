"""Report and picture of `hoof-env compare`: a table of errors, and both records over the stance."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from hoof_env._input import as_path
from hoof_env._output import check_folder, markdown_table, staged
from hoof_env._plotting import BLUE, GREY, ORANGE, STYLE
from hoof_env.errors import MissingExtraError, ParameterError
from hoof_env.lab.axis_checks import for_one, of_model, propelling_first
from hoof_env.lab.compare import Comparison, Force
from hoof_env.lab.read import REVERSED, ForceRecord

SUFFIXES = (".pdf", ".png", ".svg")
"""Formats of the picture."""

NO_DATE = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
"""Metadata by format without the date, so that the same comparison gives the same bytes."""

POINTS = 201
"""Number of points of a mean curve."""


def report(found: Comparison) -> str:
    """Return the report of a comparison as text: the records, a table of errors, the number of stances
    without a partner, and warnings of limbs that are left out, of doubtful stances, and of fore-aft forces in
    opposite directions, with the remedy."""
    lines = [
        _about("A", found.a),
        _about("B", found.b),
        f"Errors are B less A, means over the stances, at {found.rate:g} Hz; "
        f"times of B {found.shift:+.3f} s. A's own value is in brackets. {_levels(found)}",
        "",
        _table(found),
        *_alone(found),
    ]
    remarks = [
        f"{which}: {text}"
        for which, record in (("A", found.a), ("B", found.b))
        if record.own
        for text in of_model(record.limbs, record.time)
    ]
    lines += ["", *remarks] if remarks else []
    return "\n".join([*lines, *(f"warning: {text}" for text in warnings_of(found))])


def warnings_of(found: Comparison) -> list[str]:
    """Return warnings of the records, of limbs that are left out, of doubtful stances, and of fore-aft forces
    in opposite directions, with the remedy."""
    # A record that is compared with itself shows its warnings once, with the options of both.
    same = (found.a.name, found.a.notes) == (found.b.name, found.b.notes)
    warnings = [f"{found.a.name}: {note if same else for_one(note, '-a')}" for note in found.a.notes]
    warnings += [f"{found.b.name}: {for_one(note, '-b')}" for note in found.b.notes if not same]
    warnings += [f"{limb} is not compared: {why}" for limb, why in found.missing.items()] + found.warnings
    for limb, errors in found.limbs.items():
        if "fore-aft" in errors.forces and errors.forces["fore-aft"].r < -0.5:
            warnings.append(f"{limb}: fore-aft forces point opposite ways; {_why_opposite(found, limb)}")
    return warnings


def _alone(found: Comparison) -> list[str]:
    """Return a line on stances without a partner, or none."""
    limbs = []
    for limb, errors in found.limbs.items():
        alone = [
            f"{count - errors.pairs} of {count} in {which}"
            for which, count in zip("AB", errors.stances, strict=True)
            if count > errors.pairs
        ]
        if alone:
            limbs.append(f"{limb} {' and '.join(alone)}")
    return ["", f"Whole stances that are not compared: {', '.join(limbs)}."] if limbs else []


def _why_opposite(found: Comparison, limb: str) -> str:
    """Return why the fore-aft forces of a limb point opposite ways, or the option that turns them."""
    # The only limbs of two records are compared even with different names.
    of_b = limb if limb in found.b.limbs else next(iter(found.b.limbs))
    if found.a.own and found.b.own:
        return "both records are exports of this package, whose signs are right"
    own, other, name = (found.a, found.b, of_b) if found.a.own else (found.b, found.a, limb)
    if own.own and name not in propelling_first(other.limbs, other.time):
        return (
            f"braking and propulsion of {own.name} are the model's (Limits in docs/help.md); {other.name} "
            "does not propel before it brakes, so nothing shows that its forces are to be turned"
        )
    return _remedy(found, limb, of_b)


def _remedy(found: Comparison, limb: str, of_b: str) -> str:
    """Return the option that turns the fore-aft forces of a limb, whose name in B is `of_b`.

    The option counts from the file: if "auto" has turned both components, the vertical one alone is to be
    turned. A is taken to be wrong if B is an export of this package, or if only A was turned; else B.
    """
    only_a = limb in found.a.turned and of_b not in found.b.turned
    at_a = found.b.own or (only_a and not found.a.own)
    which, record, limb = ("a", found.a, limb) if at_a else ("b", found.b, of_b)
    forward, upward = record.signs.get(limb, (1, 1))
    # An option turns all limbs, so that it is no remedy if their signs differ.
    if len({record.signs.get(name, (1, 1)) for name in record.limbs}) > 1:
        return f"a minus before the column of {limb}_force_x in --map-{which} turns {which.upper()}"
    option = next(name for name, signs in REVERSED.items() if signs == (-forward, upward))
    return f"--reverse-{which} {option} turns {which.upper()}"


def _levels(found: Comparison) -> str:
    """Return a sentence on the thresholds of stances."""
    of_a, of_b = (f"{level:.4g} {found.unit}" for level in found.levels)
    return f"Stances are above {of_a}." if of_a == of_b else f"Stances are above {of_a} in A and {of_b} in B."


def _about(which: str, record: ForceRecord) -> str:
    """Return a line on a record, `which` is "A" or "B"."""
    limbs = "" if len(record.turned) == len(record.limbs) else f" of {', '.join(record.turned)}"
    turned = f"; forces{limbs} pointed into the ground and are turned round" if record.turned else ""
    own = "; an export of this package" if record.own else ""
    level = [limb for limb, force in record.limbs.items() if not np.isfinite(force[:, 0]).any()]
    only = f"; no fore-aft force of {', '.join(level)}" if level else ""
    return (
        f"{which}  {record.name}: {record.rate:g} Hz, {record.unit}, {', '.join(record.limbs)}, "
        f"{record.time[0]:.4g} to {record.time[-1]:.4g} s{own}{turned}{only}"
    )


def _table(found: Comparison) -> str:
    """Return the table of errors, one row for each limb and component."""
    unit = found.unit
    places = 1 if found.unit == "N" else 4
    head = (
        "limb",
        "force",
        "stances",
        f"RMSE [{unit}]",
        "r",
        f"peak [{unit}]",
        f"impulse [{unit} s]",
        "contact [ms]",
        "touchdown [ms]",
        "time of peak [ms]",
    )
    rows = []
    for limb, errors in found.limbs.items():
        for name, force in errors.forces.items():
            row = [limb if name == "vertical" else "", name]
            if name in ("vertical", "fore-aft"):
                row += [str(errors.pairs), f"{force.rmse:.{places}f}", _r(force)]
            else:
                row += ["", "", ""]
            # The largest fore-aft force is propulsion's, which has its own row.
            row.append("" if name == "fore-aft" else _pair(force.peak_error, force.peak, places))
            row.append(_pair(force.impulse_error, force.impulse, places + 1))
            if name == "vertical":
                row += [
                    _pair(1e3 * errors.contact_error, 1e3 * errors.contact, 0),
                    f"{round(1e3 * errors.touchdown_error):+d} ± {1e3 * errors.touchdown_spread:.0f}",
                    f"{round(1e3 * errors.peak_time_error):+d}",
                ]
            rows.append(row)
    rows += [[limb, "not compared", "0"] for limb in found.missing]
    return markdown_table(head, rows)


def _r(force: Force) -> str:
    """Return the correlation as text, "-" if it is NaN."""
    return "-" if math.isnan(force.r) else f"{force.r:.3f}"


def _pair(error: float, of_a: float, places: int) -> str:
    """Return an error and A's own value in brackets as text."""
    # Adding 0 after rounding turns -0 into 0.
    return f"{round(error, places) + 0.0:+.{places}f} ({round(of_a, places) + 0.0:.{places}f})"


def draw(found: Comparison, path: Path | str) -> Path:
    """Write a picture of a comparison and return its path. Errors are as in `check_picture`.

    Each limb has a row of panels: the vertical and the fore-aft force of A and B from touchdown on, single
    stances thin and their mean thick. A force that a record lacks has no panel.
    """
    path = as_path("path", path)
    check_picture(path)
    from matplotlib import style
    from matplotlib.figure import Figure

    limbs = list(found.curves)
    columns = 2 if any("fore-aft" in errors.forces for errors in found.limbs.values()) else 1
    with style.context(["default", STYLE]), staged(path.parent) as stage:
        figure = Figure(figsize=(7.5, 1.1 + 1.9 * len(limbs)), layout="constrained")
        axes = figure.subplots(len(limbs), columns, sharex=True, sharey="col", squeeze=False)
        for row, limb in zip(axes, limbs, strict=True):
            pairs = found.curves[limb]
            for panel, component, title in zip(row, (1, 0), ("vertical", "fore-aft"), strict=False):
                if title not in found.limbs[limb].forces:
                    panel.set_visible(False)
                    continue
                # A is drawn first and thicker, so that it shows behind B where both agree.
                for side, colour, width in ((1, BLUE, 2.4), (2, ORANGE, 1.2)):
                    for pair in pairs:
                        panel.plot(pair[0], pair[side][:, component], color=colour, lw=0.5, alpha=0.35)
                    panel.plot(*_mean(pairs, side, component), color=colour, lw=width)
                panel.axhline(0, color=GREY, lw=0.6, zorder=1)
                panel.set_title(f"{limb.replace('_', ' ')}, {title}", loc="left")
            row[0].set_ylabel(f"force [{found.unit}]")
        for panel in axes[-1]:
            panel.set_xlabel("time from touchdown [s]")
        for name, record, colour, width in (("A", found.a, BLUE, 2.4), ("B", found.b, ORANGE, 1.2)):
            axes[0, 0].plot([], [], color=colour, lw=width, label=f"{name}: {record.name}, mean")
        axes[0, 0].plot([], [], color=GREY, lw=0.5, label="single stances")
        figure.legend(loc="outside lower center", ncols=3)
        figure.savefig(stage / path.name, metadata=NO_DATE.get(path.suffix.lower()))
    return path


def _mean(pairs: list[Any], side: int, component: int) -> tuple[Any, Any]:
    """Compute the mean curve of pairs of stances over the longest of them.

    Args:
        pairs: times and forces of A and of B, see `Comparison.curves`.
        side: 1 for A, 2 for B.
        component: 0 for the forward force, 1 for the upward force.

    Returns:
        Times [s] and forces, both of shape (POINTS,).
    """
    time = np.linspace(min(pair[0][0] for pair in pairs), max(pair[0][-1] for pair in pairs), POINTS)
    # A limb bears nothing outside its stance.
    curves = [np.interp(time, pair[0], pair[side][:, component], 0.0, 0.0) for pair in pairs]
    return time, np.mean(curves, axis=0)


def check_picture(path: Path) -> None:
    """Check that a picture can be drawn at `path`.

    Raises:
        ParameterError: the suffix is not one of `SUFFIXES`.
        OutputError: the folder cannot be written.
        MissingExtraError: matplotlib is not installed.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise ParameterError(f"out: expected a file that ends in {', '.join(SUFFIXES)}, got {str(path)!r}")
    check_folder(path.parent)
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise MissingExtraError('pictures need matplotlib: pip install "hoof-env[lab]"') from None

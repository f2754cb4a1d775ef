"""Tables and picture of docs/open_loop.md, from the gaits that agents.open_loop found.

    python -m agents.open_loop_report

Writes the tables of docs/open_loop.md, each between two marks, and docs/open_loop/front.png.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from agents import runs
from agents.command import run
from agents.evaluate import estimate
from agents.markdown import put
from agents.open_loop import GAITS, stored
from agents.open_loop_search import TEST_SEED
from agents.score import score_vector
from hoof_env.errors import DataFileError

SCRIPTED = ("run", "walk")
FIGURES = {
    "return": ("return", 1.0, 1), "speed_m_s": ("speed m/s", 1.0, 2), "stance_peak_n": ("peak kN", 1e-3, 2),
    "cost_of_transport": ("cost of transport", 1.0, 3), "weight_share": ("weight share", 1.0, 2),
    "peak_grf_n": ("highest kN", 1e-3, 1), "stances": ("stances", 1.0, 0),
}  # fmt: skip
"""Columns of the tables: title, factor, digits."""

BARE = ("weight_share", "peak_grf_n", "stances")
"""Columns without intervals."""

FRONT_ID = "hoof_env/HorseLeg-v0"

TOO_SLOW, TOO_LITTLE = 0.1, 0.02
"""By so much less speed [m/s], or less of the weight, than was asked for a gait is no answer."""


@dataclass(frozen=True)
class Args:
    gaits: Path = GAITS
    """folder of gait files"""
    page: Path = Path("docs/open_loop.md")
    """the page; its picture goes into the folder beside it of the same name"""


Figures = dict[str, tuple[float | None, str]]
"""Mean, None for an infinite one, and interval as people read it."""


def figures_of(found: dict[str, Any]) -> Figures:
    """Of a gait file."""
    score = found["score"]
    return {key: _figure(key, score["mean"][key], score["interval95"][key]) for key in FIGURES}


def scripted(env_id: str, name: str, count: int) -> Figures:
    """Of a scripted gait in the episodes that gait files were scored with."""
    episodes = score_vector(name, env_id, range(TEST_SEED, TEST_SEED + count))
    found = {key: estimate([one[key] for one in episodes]) for key in FIGURES}
    return {
        key: _figure(key, None if one.low is None else one.mean, (one.low, one.high))
        for key, one in found.items()
    }


def _figure(key: str, mean: float | None, bounds: Any) -> tuple[float | None, str]:
    _, factor, digits = FIGURES[key]
    if mean is None:
        return None, "∞"
    low, high = (f"{factor * bound:.{digits}f}" for bound in bounds)
    return mean, f"{factor * mean:.{digits}f}" + (
        f" [{low}, {high}]" if low != high and key not in BARE else ""
    )


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


def _table(titles: list[str], rows: list[list[str]]) -> str:
    return "\n".join([_row(*titles), "|" + "---|" * len(titles), *(_row(*cells) for cells in rows)])


def returns_table(files: list[dict[str, Any]], compared: dict[str, dict[str, Figures]]) -> str:
    """Gaits of highest return beside the scripted ones, by id."""
    rows = []
    for env_id, others in compared.items():
        own = [one for one in files if one["env_id"] == env_id and one["objective"] == "return"]
        for found in own:
            returns = sorted(one["mean"]["return"] for one in found["restarts"])
            spread = ", ".join(f"{value:.1f}" for value in returns)
            cells = [text for _, text in figures_of(found).values()]
            rows.append([f"`{env_id}`", found["family"], *cells, spread, f"{found['cpu_s']:.0f}"])
        rows += [
            [f"`{env_id}`", f"scripted {name}", *(text for _, text in figures.values()), "", ""]
            for name, figures in others.items()
        ]
    titles = [title for title, _, _ in FIGURES.values()]
    return _table(["id", "gait", *titles, "returns of the searches", "processor s"], rows)


def front_table(files: list[dict[str, Any]]) -> str:
    """Gaits of least peak and of least cost of transport, by the speed that was asked for."""
    rows = []
    for found in front(files):
        cells = [text for key, (_, text) in figures_of(found).items() if key != "return"]
        gait = ", ".join(f"{value:.2f}" for value in found["gait"].values())
        least = {"peak": "peak", "transport": "cost of transport"}[found["objective"]]
        least += f", bearing {found['weight_share']:g}" if found.get("weight_share") else ""
        rows.append([f"least {least}", f"{found['speed']:g}", *cells, _found_by_each(found), gait])
    titles = [title for key, (title, _, _) in FIGURES.items() if key != "return"]
    return _table(["asked for", "at least m/s", *titles, "found by each search", "gait"], rows)


def _found_by_each(found: dict[str, Any]) -> str:
    """The figure that each search made small, the least first; a dash for one that misses a condition."""
    key = {"peak": "stance_peak_n", "transport": "cost_of_transport"}[found["objective"]]
    _, factor, digits = FIGURES[key]
    least = found["speed"] - TOO_SLOW, (found.get("weight_share") or 0.0) - TOO_LITTLE
    means = [one["mean"] for one in found["restarts"]]
    kept = [one[key] for one in means if one["speed_m_s"] > least[0] and one["weight_share"] > least[1]]
    return ", ".join([f"{factor * x:.{digits}f}" for x in sorted(kept)] + ["-"] * (len(means) - len(kept)))


def front(files: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The gaits of the trade-off, by objective and speed."""
    found = [one for one in files if one["objective"] != "return" and one["env_id"] == FRONT_ID]
    return sorted(found, key=lambda one: (one["objective"], one.get("weight_share") or 0.0, one["speed"]))


def draw_front(files: list[dict[str, Any]], others: dict[str, Figures], weight: float, path: Path) -> None:
    """Peak force and cost of transport against speed."""
    from matplotlib.figure import Figure

    from hoof_env.paper.figure_style import BLUE, GREEN, GREY, ORANGE, PURPLE, SKY

    figure = Figure(figsize=(9.5, 4), layout="constrained")
    panels = figure.subplots(1, 2)
    looks = {
        "peak": (BLUE, "o-", "least peak"),
        "transport": (ORANGE, "s-", "least cost of transport"),
        "share": (SKY, "^-", "least peak, the leg bears {:g} of the weight"),
    }
    series: dict[str, list[dict[str, Any]]] = {name: [] for name in looks}
    for one in front(files):
        series["share" if one.get("weight_share") else one["objective"]].append(one)
    best = [one for one in files if one["env_id"] == FRONT_ID and one["objective"] == "return"]
    for axes, key, factor in zip(panels, ("stance_peak_n", "cost_of_transport"), (1e-3, 1.0), strict=True):
        for name, (colour, style, label) in looks.items():
            if not series[name]:
                continue
            means = [one["score"]["mean"] for one in series[name]]
            speeds, values = [mean["speed_m_s"] for mean in means], [factor * mean[key] for mean in means]
            label = label.format(*(one.get("weight_share") for one in series[name][:1]))
            axes.plot(speeds, values, style, color=colour, label=label, ms=5, lw=1.2)
        for found, marker in zip(best, "*P", strict=False):
            mean = found["score"]["mean"]
            place = mean["speed_m_s"], factor * mean[key]
            axes.plot(*place, marker, color=GREEN, ms=10, label=f"highest return, {found['family']}", ls="")
        for (name, figures), marker in zip(others.items(), "Dv", strict=False):
            speed, value = figures["speed_m_s"][0], figures[key][0]
            if speed is not None and value is not None:
                axes.plot(speed, factor * value, marker, color=PURPLE, ms=8, label=f"scripted {name}", ls="")
        axes.set_xlabel("mean speed [m/s]")
        axes.set_ylim(bottom=0)
        axes.grid(color=GREY, alpha=0.15)
    panels[0].set_ylabel("mean peak force of a stance [kN]")
    panels[1].set_ylabel("cost of transport [-]")
    inside = panels[0].secondary_yaxis(
        "right", functions=(lambda kn: 1e3 * kn / weight, lambda w: weight * w / 1e3)
    )
    inside.set_ylabel("[weights]")
    panels[0].legend(loc="upper left")
    figure.savefig(path, dpi=120)


def report(args: Args) -> None:
    """Write the tables and the picture.

    Raises:
        DataFileError: no page, no gaits, or a file that is none.
    """
    import matplotlib

    from hoof_env.paper.figure_style import STYLE

    files = [stored(path) for path in sorted(args.gaits.glob("*.json"))]
    if not args.page.is_file() or not front(files):
        raise DataFileError(f"expected a page {args.page} and gaits of agents.open_loop in {args.gaits}")
    order = {"constant": 0, "clocked": 1}
    files.sort(key=lambda one: (one["env_id"], order[one["family"]]))
    compared = {
        env_id: {name: scripted(env_id, name, files[0]["test_episodes"]) for name in SCRIPTED}
        for env_id in dict.fromkeys(one["env_id"] for one in files)
    }
    pictures = args.page.with_suffix("")
    pictures.mkdir(exist_ok=True)
    with runs.make_env(FRONT_ID) as env, matplotlib.rc_context(STYLE):
        leg: Any = env.unwrapped
        draw_front(files, compared[FRONT_ID], leg.weight, pictures / "front.png")
    text = args.page.read_text(encoding="utf-8")
    text = put(text, "returns", returns_table(files, compared))
    runs.write_text(args.page, put(text, "front", front_table(files)))


def main(argv: list[str] | None = None) -> None:
    import tyro

    args = tyro.cli(Args, args=argv, prog="python -m agents.open_loop_report", description=__doc__)
    report(args)
    print(f"written: {args.page} and {args.page.with_suffix('')}/front.png")


if __name__ == "__main__":
    run(main)

"""Commands that compare policies, and show what there is to play."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from hoof_env.commands.console import say, size
from hoof_env.errors import ParameterError, brief, parse_pairs

EXTRAS = {
    "render": "pygame",
    "video": "imageio_ffmpeg",
    "plot": "matplotlib",
    "view": "bokeh",
    "train": "stable_baselines3",
    "onnx": "onnxruntime",
    "export": "pyarrow",
    "lab": "ezc3d",
}
"""Module by which an extra is known to be installed."""


def evaluate(
    policies: tuple[str, ...],
    /,
    env_id: str | None = None,
    env_kwargs: tuple[str, ...] = (),
    episodes: int | None = None,
    seed: int | None = None,
    published: bool = False,
    out: Path | None = None,
    overwrite: bool = False,
) -> None:
    """Play the same episodes with several policies, and print their figures with 95 % intervals.

    Args:
        policies: policies as in `hoof-env render`: names, shipped, open-loop, paths of models (trusted ones
            only: a model is code) and gaits; or module:function, a function of observations, shape (n, k),
            that returns actions.
        env_id: id of the environment; otherwise the id of the first model or gait file, or
            hoof_env/HorseLeg-v0.
        env_kwargs: arguments of the environment: key=value ..., or one JSON object; otherwise the
            arguments of the first model or gait file.
        episodes: number of episodes of each policy; 20 if left out.
        seed: seed of the first episode; 1000 if left out. The others follow it.
        published: play the 100 episodes of the published tables, print their lines in Markdown, and refuse
            policies that were trained for other settings.
        out: write all figures of all episodes to this file; ends in .csv or .json.
        overwrite: replace an existing file.
    """
    from hoof_env._output import check_new, new_file
    from hoof_env.evaluation import scores
    from hoof_env.records import check_place

    made = ""
    if out is not None:
        made = check_new(out, overwrite)
        check_place(out, scores.WRITERS)
    found = scores.evaluate(
        policies, env_id, parse_pairs("--env-kwargs", env_kwargs) or None, episodes, seed, published
    )
    with_what = f" with {found.env_kwargs}" if found.env_kwargs else ""
    say(f"{found.env_id}{with_what}, episodes {found.seeds[0]:,} to {found.seeds[-1]:,}\n")
    say(scores.published_lines(found.scores) if published else scores.text_table(found.scores))
    if out is not None:
        with new_file(out, overwrite) as file:
            scores.WRITERS[out.suffix.lower()](found, file)
        say(f"\n{out}: {size(out)}{made}")


def list_ids(env_id: str | None = None) -> None:
    """List the environments, what returns are good in each, its policies, and the extras that are installed.

    Args:
        env_id: only this environment, with the names of its scripted policies.
    """
    from hoof_env.policies.catalogue import good_returns, summaries
    from hoof_env.policies.find import names_of, shipped_policy
    from hoof_env.tasks.registry import TASKS

    known = summaries()
    costly = {task.id for task in TASKS.values() if task.defaults.get("cost")}
    if env_id is not None and env_id not in known:
        raise ParameterError(f"env_id: expected one of {', '.join(known)}, got {brief(env_id)}")
    for name in known if env_id is None else [env_id]:
        ships = shipped_policy(name)
        sizes = f"{ships.action_space.shape[0]} actions, {ships.observation_space.shape[0]} observations"
        say(f"{name}: {known[name]}")
        say(f"    {sizes}; mean returns: {good_returns(name.removeprefix('hoof_env/'))}")
        if name in costly:
            say(f"    a return says nothing without its cost: hoof-env evaluate shipped zero --env-id {name}")
    if env_id is None:
        installed = [extra for extra, module in EXTRAS.items() if find_spec(module)]
        missing = [extra for extra in EXTRAS if extra not in installed]
        say(f"\nextras that are installed: {', '.join(installed) or 'none'}")
        if missing:
            say(f'others: {", ".join(missing)} (pip install "hoof-env[{missing[0]}]")')
        say(
            "next: hoof-env evaluate shipped open-loop run, or hoof-env list --env-id ENV_ID for its policies"
        )
        return
    from hoof_env.envs.make_env import make_env

    with make_env(env_id) as env:
        say(f"    policies: {', '.join(names_of(env, env_id))}")


def demo(out: Path = Path("hoof-env-demo"), quick: bool = False, overwrite: bool = False) -> None:
    """Reproduce the paper, compare the shipped agent with scripted gaits, and film them, on one page; takes
    about a minute (needs 'plot', 'render' and 'video').

    Args:
        out: folder of the page and its data; made if it is missing.
        quick: tiny numbers, which show that everything works and nothing more.
        overwrite: replace an existing page.
    """
    from hoof_env._output import check_new
    from hoof_env.demo.demo import PAGE, demo

    check_new(out / PAGE, overwrite)
    page = demo(out, quick, say, overwrite)
    say(f"open {page} ({size(page)})")

"""Command that prints the tables of an environment."""

from __future__ import annotations

import re
import shutil
import textwrap

from hoof_env._output import terminal_table
from hoof_env.commands.console import say


def manual(env_id: str = "hoof_env/HorseLeg-v0") -> None:
    """Print the arguments, actions, observation and rewards of an environment, with units and meanings.

    Args:
        env_id: id of the environment; one of your own may be module:id.
    """
    from hoof_env.envs.manual import leg_of, tables_of, task_of_id
    from hoof_env.policies.catalogue import summaries

    tables = tables_of(env_id)
    task = task_of_id(env_id)
    width = shutil.get_terminal_size((110, 24)).columns
    module = f" (import {task.module})" if task.module else ""
    say(f"{env_id.rpartition(':')[2]}{module}: {summaries().get(env_id, task.summary)}")
    lines = textwrap.wrap(f"Leg: {leg_of(task)}", width, break_long_words=False, break_on_hyphens=False)
    say("\n".join(lines))
    for title, table in tables.items():
        say(f"\n{title}\n")
        say(terminal_table(table.head, [[without_links(cell) for cell in row] for row in table.rows], width))


def without_links(text: str) -> str:
    """Return a text without the addresses of its Markdown links."""
    return re.sub(r"\[([^\]]+)\]\([^)]*\)", r"\1", text)

"""What commands share. Torch's threads: one unless more are asked for, none that spin, no more than there are
cores; and tables."""

import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("given", "expected"),
    [({}, "1 1 PASSIVE"), ({"OMP_NUM_THREADS": "2", "OMP_WAIT_POLICY": "ACTIVE"}, "2 2 ACTIVE")],
)
def test_commands_take_one_thread_and_let_others_work_unless_the_user_says_so(given, expected):
    code = (
        "import os, agents, torch\n"
        "print(torch.get_num_threads(), os.environ['OMP_NUM_THREADS'], os.environ['OMP_WAIT_POLICY'])"
    )
    ours = {k: v for k, v in os.environ.items() if not k.startswith(("OMP_", "MKL_", "KMP_", "GOMP_"))}
    said = subprocess.check_output([sys.executable, "-c", code], env=ours | given, text=True, timeout=120)
    assert said.strip() == expected


COMMANDS = sorted(path.stem for path in ROOT.glob("agents/*.py") if "\n    run(" in path.read_text())


FIRST = {"results": ("score",)}
"""Sub-commands."""

WITH_ENV = {
    "bar", "dataset", "distribute", "experiments.training", "export", "open_loop", "order", "results", "ship",
    "train", "tune",
}  # fmt: skip
"""Commands that take any environment; the rest has its own."""


@pytest.mark.parametrize("name", [*COMMANDS, "experiments", "experiments.training"])
def test_an_environment_has_the_same_options_everywhere(name, monkeypatch, capsys):
    """As in `hoof-env`; and a wrong option shows the options of its command."""
    module = f"agents.{name}" + (".__main__" if name == "experiments" else "")
    with pytest.raises(SystemExit) as end:
        import_module(module).main([*FIRST.get(name, ()), "--no-such-option"])
    assert end.value.code == 2
    told = capsys.readouterr().err.splitlines()[-1]
    assert told.startswith(f"options of python -m agents.{name}")
    names = set(told.partition(": ")[2].split(", "))
    assert not {"--id", "--ids", "--args", "--env", "--kwargs"} & names
    assert ("--env-id" in names) == (name in WITH_ENV)

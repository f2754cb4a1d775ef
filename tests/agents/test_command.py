"""What commands share. Torch's threads: one unless more are asked for, none that spin, no more than there are
cores; and tables."""

import os
import subprocess
import sys

import pytest


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

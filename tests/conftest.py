"""For all tests: windows are drawn unseen, and nobody computes in threads: there is a process on each
processor, and threads that wait for others spin.

Where PyTorch cannot be had, what needs it is left out, and a line at the end says so."""

import gc
import os
import pickle
import shutil
import signal
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from filelock import FileLock

import hoof_env
from hoof_env._collector import paused

os.environ["SDL_VIDEODRIVER"] = "dummy"
for library in ("OMP", "OPENBLAS", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

# A shell's background ignores interrupts, and so does what is started there; tests interrupt what they start.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

LONGEST = (
    "simd/test_oracle.py",
    "envs/test_bits.py",
    "test_packaging.py",
    "envs/test_own_task.py",
    "benchmarks/test_speed.py",
    "dynamics/test_mechanisms.py",
    "view/test_server.py",
    "envs/test_own_parts.py",
    "agents/test_resume.py",
    "test_setup.py",
    "test_site.py",
    "envs/test_refused_tasks.py",
    "agents/test_demo.py",
    "view/test_tab.py",
    "paper/test_figures.py",
    "simd/test_compile.py",
    "envs/test_refused_functions.py",
    "simd/test_objects.py",
    "dynamics/test_animal.py",
    "test_typing.py",
    "ecosystem/test_gymnasium.py",
    "agents/test_experiments.py",
    "test_cli.py",
    "envs/test_rewards_of_tasks.py",
    "paper/test_legs_that_fit.py",
    "dynamics/test_strokes.py",
    "agents/test_horse_gaits.py",
    "agents/test_examples.py",
    "test_make_test.py",
    "ecosystem/test_wrappers.py",
    "test_docs.py",
    "ecosystem/test_suite.py",
)
"""Files that take longest, the longest first. They begin: one that began last would keep one processor busy
while the others have nothing left to do."""

HAS_TORCH = find_spec("torch") is not None
NEED_TORCH = ("torch", "stable_baselines3", "sb3_contrib")
LEFT_OUT = ("agents", "ecosystem")  # folders of tests whose commands import it in processes of their own
REASON = "needs PyTorch"


class _Absent:
    """Has what imports PyTorch in this repository skipped; libraries that can do without it go on."""

    root = str(Path(__file__).parents[1])

    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in NEED_TORCH:
            frame = sys._getframe(1)
            while frame and "importlib" in frame.f_code.co_filename:
                frame = frame.f_back
            if frame and frame.f_code.co_filename.startswith(self.root):
                pytest.skip(REASON, allow_module_level=True)


class _AbsentVecEnv:
    """In the place of `hoof_env.Sb3VecEnv`, for files of which not every test makes one."""

    def __new__(cls, *args, **settings):
        pytest.skip(REASON)


if not HAS_TORCH:
    sys.meta_path.insert(0, _Absent())
    hoof_env.Sb3VecEnv = _AbsentVecEnv


def made_once(request, tmp_path_factory, name, make):
    """Return the path of a file or folder that one process of this run makes for all, by `make(path)`."""
    folder = tmp_path_factory.getbasetemp()
    if hasattr(request.config, "workerinput"):
        folder = folder.parent  # all processes of this run share it
    path = folder / name
    with FileLock(folder / f"{name}.lock"):
        if not path.exists():
            unfinished = folder / f"{name}.unfinished"
            shutil.rmtree(unfinished, ignore_errors=True)  # of a process that was killed
            make(unfinished)
            unfinished.replace(path)
    return path


@pytest.fixture(scope="session")
def reproduced(request, tmp_path_factory):
    """Return the paper's four conditions by every solver, which one process computes for all, and what was
    said meanwhile."""
    from hoof_env.paper.reproduce import reproduce

    def make(path):
        said = []
        path.write_bytes(pickle.dumps((reproduce(said.append), said)))

    return pickle.loads(made_once(request, tmp_path_factory, "reproduction", make).read_bytes())


@pytest.fixture(scope="session")
def reproduction(reproduced):
    """Return the paper's four conditions by every solver."""
    return reproduced[0]


@pytest.fixture(scope="session")
def drawn(request, tmp_path_factory, reproduction):
    """Return the folder of the figures of `reproduction`, which one process draws for all."""
    from hoof_env.paper.figures import draw_all

    return made_once(request, tmp_path_factory, "figures", lambda path: draw_all(reproduction, path))


def pytest_ignore_collect(collection_path):
    here = Path(__file__).parent
    if not HAS_TORCH and collection_path in [here / name for name in LEFT_OUT]:
        return True
    return None


def pytest_collection_modifyitems(items):
    """Put the longest files first; the tests of each stay in their order."""
    here = Path(__file__).parent
    places = {here / name: place for place, name in enumerate(LONGEST)}
    items.sort(key=lambda item: places.get(item.path, len(places)))


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Keep what is collected and imported out of the garbage collector's way: it would go through it again
    and again and find nothing. Later it looks less often, which halves the time that it takes."""
    with paused():
        found = yield
    gc.freeze()
    gc.set_threshold(10_000, 20, 20)
    return found


def pytest_terminal_summary(terminalreporter):
    if not HAS_TORCH:
        skipped = sum(REASON in str(report.longrepr) for report in terminalreporter.stats.get("skipped", ()))
        folders = " and ".join(f"tests/{name}" for name in LEFT_OUT)
        terminalreporter.write_line(
            f"no PyTorch here: left out {folders}, and {skipped} files or tests elsewhere that import it"
        )

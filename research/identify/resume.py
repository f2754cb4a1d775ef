"""Jobs in processes, each kept in a file as soon as it is done, so that a killed search goes on.

`state/problem.json` in its folder says what is searched; `state/job-<id>.json` holds what a job came to.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
import platform
import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

from hoof_env import __version__
from hoof_env._output import staged
from hoof_env.errors import DataFileError, HoofEnvError, OutputError

T = TypeVar("T")

Run = Callable[[Callable[[Any], Any], Sequence[Any]], Iterable[Any]]  # function and tasks to results

_HINT = "name another folder or delete this one"
_ONE_THREAD = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")


@dataclass(frozen=True)
class State:
    """The files of one search in `folder`; `digest` marks those that belong to it."""

    folder: Path
    digest: str

    def finish(
        self,
        jobs: Sequence[Any],
        work: Callable[[Any], T],
        kind: type[T],
        run: Run,
        report: Callable[[T], None] = lambda _: None,
    ) -> list[T]:
        """What `jobs` come to, in their order: what is kept here, and the rest by `work`, kept as it comes.
        `work` makes of a job a dataclass of this `kind` with the job's `id`; `run` is from `processes`."""
        done: dict[str, Any] = {job.id: kept for job in jobs if (kept := self.load(job.id, kind))}
        for kept in done.values():
            report(kept)
        for made in run(work, [job for job in jobs if job.id not in done]):
            self.save(made)
            done[made.id] = made
            report(made)
        return [done[job.id] for job in jobs]

    def load(self, job: str, kind: type[T]) -> T | None:
        """What was kept of a job; None if there is nothing."""
        path = self.folder / f"job-{job}.json"
        if not path.exists():
            return None
        hint = f"delete it to repeat {path.stem}"
        data = read_json(path, hint)
        try:
            digest, fields = data["problem"], data["content"].items()
            content = kind(**{key: tuple(v) if isinstance(v, list) else v for key, v in fields})
        except (AttributeError, KeyError, TypeError):
            raise DataFileError(f"{path} is damaged; {hint}") from None
        if digest != self.digest:
            raise DataFileError(
                f"{path} belongs to another search (expected {self.digest}, got {digest!r}); {_HINT}"
            )
        return content

    def save(self, made: Any) -> None:
        """Keep what a job came to; a kill never leaves half of it."""
        write_json(self.folder, f"job-{made.id}", {"problem": self.digest, "content": asdict(made)})


def open_state(out: Path, problem: Mapping[str, Any], *, resume: bool, product: str) -> State:
    """Begin a search in `out`, or go on with the one that is there. `problem`, a JSON object, tells this
    search from another; `product` is the file that it ends with."""
    state = State(out / "state", digest_of(problem))
    file = state.folder / "problem.json"
    try:
        is_there, is_taken = file.is_file(), file.exists() or (out / product).exists()
    except OSError as error:
        raise OutputError(f"cannot write to {str(out)!r} ({error.strerror})") from None
    if is_taken and not resume:
        raise OutputError(
            f"{str(out)!r} already holds a search or what one found; name another folder, or go on with "
            "the same search by --resume"
        )
    if not resume:
        write_json(state.folder, "problem", problem)
        return state
    if not is_there:
        raise DataFileError(f"{str(out)!r} holds no search to resume; leave out --resume to begin one")
    there, here = read_json(file, f"nothing can be resumed: {_HINT}"), json.loads(json.dumps(problem))
    if there != here:
        was = there if isinstance(there, dict) else {}
        keys = (key for key in here if was.get(key) != here[key])
        differing = (f"{key} is {was.get(key)!r} there and {here[key]!r} here" for key in keys)
        raise DataFileError(f"{str(out)!r} holds another search: {'; '.join(differing)}; {_HINT}")
    return state


def digest_of(content: Any) -> str:
    """16 hexadecimal digits that tell one JSON value from another."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]


def versions() -> dict[str, str]:
    """Of what a search's numbers depend on."""
    packages = {name: version(name) for name in ("cma", "numpy", "numba")}
    return {"hoof-env": __version__, "Python": platform.python_version(), **packages}


def read_json(path: Path, hint: str) -> Any:
    """The content of a JSON file; where it is damaged the `hint` says what to do."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise DataFileError(f"cannot read {path}: {error.strerror or error}") from None
    except (ValueError, RecursionError):
        raise DataFileError(f"{path} is damaged; {hint}") from None


def write_json(folder: Path, name: str, content: Any) -> Path:
    """Write a JSON file whole or not at all; returns its path."""
    text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    with staged(folder) as stage:
        (stage / f"{name}.json").write_text(text, encoding="utf-8")
    return folder / f"{name}.json"


@contextmanager
def processes(count: int) -> Iterator[Run]:
    """A function that maps over tasks in up to `count` processes; one is this process itself.

    Tasks begin in their order, results come as they are done. At the end of the block, tasks that run are
    stopped and those that wait are dropped. The processes end with their parent, however it ends.
    """
    if count == 1:
        yield map
        return
    for variable in _ONE_THREAD:
        os.environ.setdefault(variable, "1")  # as the processes inherit it
    pool = ProcessPoolExecutor(count, multiprocessing.get_context("spawn"), initializer=_end_with_parent)

    def run(function: Callable[[Any], Any], tasks: Sequence[Any]) -> Iterator[Any]:
        handler = signal.signal(signal.SIGINT, signal.SIG_IGN)  # as the processes inherit it
        try:
            futures = [pool.submit(function, task) for task in tasks]
        finally:
            signal.signal(signal.SIGINT, handler)
        try:
            for future in as_completed(futures):
                yield future.result()
        except BrokenProcessPool:
            raise HoofEnvError(
                "a process died (out of memory, or killed); what is done is kept and goes on with --resume"
            ) from None

    try:
        yield run
    finally:
        for process in list((pool._processes or {}).values()):
            process.terminate()
        pool.shutdown(cancel_futures=True)


def _end_with_parent() -> None:
    parent: Any = multiprocessing.parent_process()

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()

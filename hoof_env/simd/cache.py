"""Where a compiled kernel is kept, and how processes that need the same one share the work.

numba keeps what it compiles in files, but processes that begin together, as the workers of a learner do, each
compile it for themselves. Here one compiles, under a lock beside the kernel's files, and the others wait and
then load. Everything that leans on numba's private names is in this module.

The files are pickles, which can run any code. They are read only if nobody else could have written them
(`hoof_env.simd.trust`), and only whole: an index has a digest of itself and of the files that it names.
"""

from __future__ import annotations

import gc
import hashlib
import os
import pickle
import re
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import numba.core.caching
import numba.core.config
from filelock import FileLock, Timeout
from numba.core.compiler_lock import global_compiler_lock
from numba.core.utils import _dynamic_module

from hoof_env.errors import OutputError
from hoof_env.simd import trust

MECHANICS = ("simd", "leg", "ground", "gait", "dynamics")
"""The rooms of this package whose sources end up in kernels, folders or files."""

LONGEST_WAIT = 600.0
"""Seconds to wait for another process, which may be stopped; then the kernel is compiled here."""

COMPILED: list[str] = []
"""Names of the kernels that this process has compiled."""

_HELD: set[str] = set()
"""Locks of kernels that are compiled now. While one is, a module that is imported for it may make an
environment that needs it, too."""

_caching: Any = numba.core.caching
_config: Any = numba.core.config
_Given: Any = getattr(_caching, "UserProvidedCacheLocator", None) or _caching._UserProvidedCacheLocator


def given_folder() -> str:
    """What NUMBA_CACHE_DIR was when numba was imported, or nothing."""
    return str(_config.CACHE_DIR)


class _GivenFolder(_Given):
    """The folder named by NUMBA_CACHE_DIR, from which kernels are loaded even where nothing can be written,
    as in an image of a container. numba would pass over such a folder in silence."""

    def ensure_cache_path(self) -> None:
        pass


class _FilesInGivenFolder(_caching.CompileResultCacheImpl):
    _locator_classes: ClassVar[list[Any]] = [_GivenFolder]


class _Files(_caching.IndexDataCacheFile):
    """The index of a kernel's files and the files themselves. What is damaged counts as not there, and `say`
    tells so: an index is a pickled version, a digest of the rest, and the rest, a pickle of the source stamp
    and, for each signature, the name and the digest of its file."""

    FORMAT = "hoof-env.1"
    _OTHER_VERSION = re.compile(rb"\x80.\x95.{8}\x8c.[\w.+-]+\x94\.", re.DOTALL)

    def __init__(self, impl: Any, stamp: Any, say: Callable[[str], None]) -> None:
        super().__init__(impl.locator.get_cache_path(), impl.filename_base, stamp)
        # numba alone, and older versions of this package, take it for one of another numba
        self._start = pickle.dumps(f"{self._version}+{self.FORMAT}", protocol=-1)
        self._say, self._told = say, set[str]()

    def _tell(self, path: str, what: str) -> None:
        if path not in self._told:
            self._told.add(path)
            self._say(f"{what} {path} is damaged: compiling it again")

    def save(self, key: Any, data: Any) -> None:
        """Write the file first: an index never names what is not there yet."""
        entries, content = self._load_index(), self._dump(data)
        taken = {name for name, _ in entries.values()}
        free = (self._data_name(k) for k in range(1, len(taken) + 2))
        name = entries[key][0] if key in entries else next(name for name in free if name not in taken)
        with self._open_for_write(self._data_path(name)) as file:
            file.write(content)
        entries[key] = name, _sha(content)
        self._save_index(entries)

    def load(self, key: Any) -> Any:
        name, digest = self._load_index().get(key, (None, b""))
        if name is None:
            return None
        try:
            content = trust.read(self._data_path(name))
        except FileNotFoundError:
            return None
        if _sha(content) != digest:
            self._tell(self._data_path(name), "the compiled kernel")
            return None
        return pickle.loads(content)

    def _load_index(self) -> dict[Any, tuple[str, bytes]]:
        try:
            content = trust.read(self._index_path)
        except FileNotFoundError:
            return {}
        if not content.startswith(self._start) and self._OTHER_VERSION.match(content):
            return {}  # of numba, or of this format
        rest = content.removeprefix(self._start)
        digest, rest = rest[:32], rest[32:]
        if self._own(rest) != digest:
            self._tell(self._index_path, "the index of compiled kernels")
            return {}
        stamp, entries = pickle.loads(rest)
        return dict(entries) if stamp == self._source_stamp else {}

    def _save_index(self, entries: dict[Any, tuple[str, bytes]]) -> None:
        rest = self._dump((self._source_stamp, entries))
        with self._open_for_write(self._index_path) as file:
            file.write(self._start + self._own(rest) + rest)

    def _own(self, content: bytes) -> bytes:
        """Digest of an index of this name: another kernel's in its place would be sound by itself."""
        return _sha(self._index_name.encode() + content)

    @contextmanager
    def _open_for_write(self, path: str) -> Iterator[Any]:
        """As numba's; the file is for its owner alone to write, whatever the umask says."""
        with super()._open_for_write(path) as file:
            trust.close(file.name)
            yield file


def _sha(content: bytes) -> bytes:
    return hashlib.sha256(content).digest()


class KernelCache(_caching.FunctionCache):
    """The files of one kernel; `identity` tells apart kernels of one source that contain different functions.
    Raises OutputError where no folder is writable, or others could have written what is there."""

    def __init__(self, function: Callable[..., Any], say: Callable[[str], None], identity: str = "") -> None:
        if given_folder():
            self._impl_class = _FilesInGivenFolder
        try:
            super().__init__(function)
        except (RuntimeError, OSError) as error:
            raise _no_folder(os.path.dirname(function.__code__.co_filename), error) from None
        # numba looks for changes in the file of a kernel alone, but a kernel contains those that it calls
        own = Path(function.__code__.co_filename).parent
        stamp = self._impl.locator.get_source_stamp(), _sources(), _digest(own)
        self._cache_file = _Files(self._impl, stamp, say)
        if not given_folder():
            trust.close_new(self.cache_path)
        self._say, self._kernel, self._identity = say, function.__name__, identity
        self._lock: Any = None

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        # numba's own has a digest of what a function encloses, which changes with every process
        return sig, codegen.magic_tuple(), self._identity

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """As numba's; where there is nothing to load, it returns once this process may compile."""
        for folder in filter(None, (given_folder(), self.cache_path)):
            trust.check_folder(folder)
        if (overload := self._load(sig, target_context)) is not None:
            return overload
        try:
            os.makedirs(given_folder() or self.cache_path, 0o755, exist_ok=True)
            os.makedirs(self.cache_path, 0o755, exist_ok=True)
            tempfile.TemporaryFile(dir=self.cache_path).close()
        except OSError as error:
            raise _no_folder(given_folder() or self.cache_path, error) from None
        return self._load(sig, target_context) if self._take_lock() else None

    def _load(self, sig: Any, target_context: Any) -> Any:
        sys.modules.setdefault(_dynamic_module.__name__, _dynamic_module)  # of functions without a module
        try:
            return super().load_overload(sig, target_context)
        except OutputError:
            raise
        except OSError:  # no such folder
            return None
        except Exception as error:  # a pickle that asks for what is not there raises anything
            reason = f"{type(error).__name__}: {error}".splitlines()[0]
            self._say(f"cannot load {self._kernel} ({reason}): compiling it again")
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        COMPILED.append(self._kernel)
        try:
            super().save_overload(sig, data)
        except OSError as error:
            raise _no_folder(given_folder() or self.cache_path, error) from None

    def _take_lock(self) -> bool:
        """Wait until no other process compiles this kernel; False where files cannot be locked."""
        path = os.path.join(self.cache_path, f"{self._impl.filename_base}.lock")
        if path in _HELD:  # by this thread, as no other compiles now
            return True
        lock = FileLock(path)
        waiting = f"waiting for another process, which compiles {self._kernel} ..."
        gave_up = f"waited {LONGEST_WAIT:.0f} s for {self._kernel}: compiling it here, too"
        for timeout, said in ((1.0, waiting), (LONGEST_WAIT, gave_up)):
            try:
                lock.acquire(timeout=timeout)
            except Timeout:
                self._say(said)
            except (OSError, NotImplementedError):
                return False
            else:
                self._lock = lock
                _HELD.add(path)
                return True
        return False

    def release(self) -> None:
        """Let other processes have the kernel, whether or not it could be compiled."""
        if self._lock is not None:
            _HELD.discard(self._lock.lock_file)
            self._lock.release()
            self._lock = None


def keep(dispatcher: Any, say: Callable[[str], None], identity: str = "") -> None:
    """Have numba's `dispatcher` keep what it compiles in files, one process at a time compiling a kernel; no
    folder is looked for before it compiles."""
    compile_now, files = dispatcher.compile, None

    def compile_once(signature: Any) -> Any:
        nonlocal files
        with global_compiler_lock:  # numba's, of threads; a kernel compiles those that it calls
            if files is None:
                files = dispatcher._cache = KernelCache(dispatcher.py_func, say, identity)
            collects = gc.isenabled()
            gc.disable()  # it would take a seventh of the time to find nothing
            try:
                return compile_now(signature)
            finally:
                files.release()
                if collects:
                    gc.enable()

    dispatcher.compile = compile_once


def _no_folder(folder: str, error: Exception) -> OutputError:
    return OutputError(
        f"cannot keep compiled kernels in {folder!r} ({error}); expected a writable folder: "
        "set the environment variable NUMBA_CACHE_DIR to one"
    )


@cache
def _sources() -> str:
    """Digest of everything in this package that kernels are made from."""
    rooms = [Path(__file__).parents[1] / room for room in MECHANICS]
    files = [room.with_suffix(".py") for room in rooms]
    return "".join(_digest(file if file.is_file() else room) for room, file in zip(rooms, files, strict=True))


@cache
def _digest(room: Path) -> str:
    """Digest of a module, or of those in a folder: a kernel may call any that lies beside it."""
    digest = hashlib.sha256()
    modules = [room] if room.is_file() else room.glob("*.py")
    for path in sorted(path for path in modules if path.is_file()):
        digest.update(path.read_bytes())
    return digest.hexdigest()

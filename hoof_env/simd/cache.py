"""Files of compiled kernels, and a lock so that only one of several processes compiles a kernel.

numba keeps what it compiles in files, but processes that begin together, as the workers of a learner do, each
compile it for themselves. Here one compiles, under a lock next to the kernel's files, and the others wait and
then load. Everything that depends on numba's private names is in this module.

The files are pickles, which can run any code. They are read only if no other user could have written them
(`hoof_env.simd.trust`), and only whole: an index has a digest of itself and of the files that it names.
"""

from __future__ import annotations

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
import numba.core.runtime
from filelock import FileLock, Timeout
from numba.core import entrypoints
from numba.core.compiler_lock import global_compiler_lock
from numba.core.utils import _dynamic_module

from hoof_env._collector import paused
from hoof_env.errors import OutputError
from hoof_env.simd import trust

PACKAGE = Path(__file__).parents[1]

MECHANICS = ("simd", "leg", "ground", "gait", "dynamics")
"""Modules and folders of this package that kernels are compiled from."""

CALLED = {"envs": ("tasks",)}
"""Further rooms whose functions the kernels of a room call."""

LONGEST_WAIT = 600.0
"""Longest wait [s] for another process, which may be stopped; then the kernel is compiled here."""

COMPILED: list[str] = []
"""Names of the kernels that this process has compiled."""

_HELD: set[str] = set()
"""Locks of kernels that are compiled now. While one is, a module that is imported for it may make an
environment that needs it, too."""

_caching: Any = numba.core.caching
_config: Any = numba.core.config
_runtime: Any = numba.core.runtime
_Given: Any = getattr(_caching, "UserProvidedCacheLocator", None) or _caching._UserProvidedCacheLocator


def given_folder() -> str:
    """Return NUMBA_CACHE_DIR as it was when numba was imported; empty if it was not set."""
    return str(_config.CACHE_DIR)


class _GivenFolder(_Given):
    """Folder named by NUMBA_CACHE_DIR. Kernels are loaded from it even if it is read-only, as in a
    container's image; numba would silently ignore such a folder."""

    def ensure_cache_path(self) -> None:
        pass


class _FilesInGivenFolder(_caching.CompileResultCacheImpl):
    _locator_classes: ClassVar[list[Any]] = [_GivenFolder]


class _Files(_caching.IndexDataCacheFile):
    """Index of a kernel's files and the files themselves. Damaged files count as missing, and `say` reports
    them. An index is a pickled version, a digest of the rest, and the rest: a pickle of the source stamp and,
    for each signature, of the name and the digest of its file."""

    FORMAT = "hoof-env.1"
    _OTHER_VERSION = re.compile(rb"\x80.\x95.{8}\x8c.[\w.+-]+\x94\.", re.DOTALL)

    def __init__(self, impl: Any, stamp: Any, say: Callable[[str], None]) -> None:
        super().__init__(impl.locator.get_cache_path(), impl.filename_base, stamp)
        # to plain numba, and to older versions of this package, this is the index of another numba version
        self._start = pickle.dumps(f"{self._version}+{self.FORMAT}", protocol=-1)
        self._say = say
        self._reported = set[str]()

    def _report(self, path: str, what: str) -> None:
        if path not in self._reported:
            self._reported.add(path)
            self._say(f"{what} {path} is damaged: compiling it again")

    def save(self, key: Any, data: Any) -> None:
        """Write the file first, then the index, so that an index never names a missing file."""
        entries = self._load_index()
        content = self._dump(data)
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
            self._report(self._data_path(name), "the compiled kernel")
            return None
        return pickle.loads(content)

    def _load_index(self) -> dict[Any, tuple[str, bytes]]:
        try:
            content = trust.read(self._index_path)
        except FileNotFoundError:
            return {}
        if not content.startswith(self._start) and self._OTHER_VERSION.match(content):
            return {}  # an index of another version of numba, or of this format
        # checked before it is unpickled
        rest = content.removeprefix(self._start)
        digest = rest[:32]
        rest = rest[32:]
        if self._digest_of(rest) != digest:
            self._report(self._index_path, "the index of compiled kernels")
            return {}
        stamp, entries = pickle.loads(rest)
        return dict(entries) if stamp == self._source_stamp else {}

    def _save_index(self, entries: dict[Any, tuple[str, bytes]]) -> None:
        rest = self._dump((self._source_stamp, entries))
        with self._open_for_write(self._index_path) as file:
            file.write(self._start + self._digest_of(rest) + rest)

    def _digest_of(self, content: bytes) -> bytes:
        """Return the digest of an index and its name: the index of another kernel must not pass for it."""
        return _sha(self._index_name.encode() + content)

    @contextmanager
    def _open_for_write(self, path: str) -> Iterator[Any]:
        """Open as numba does; only the owner may write the file, whatever the umask."""
        with super()._open_for_write(path) as file:
            trust.close(file.name)
            yield file


def _sha(content: bytes) -> bytes:
    return hashlib.sha256(content).digest()


class KernelCache(_caching.FunctionCache):
    """Files of one kernel; `identity` distinguishes kernels of one source.

    Raises:
        OutputError: no folder is writable, or others could have written the files.
    """

    def __init__(self, function: Callable[..., Any], say: Callable[[str], None], identity: str = "") -> None:
        if given_folder():
            self._impl_class = _FilesInGivenFolder
        try:
            super().__init__(function)
        except (RuntimeError, OSError) as error:
            raise _no_folder(os.path.dirname(function.__code__.co_filename), error) from None
        # numba looks for changes in the file of a kernel alone, but a kernel contains those that it calls
        folder = Path(function.__code__.co_filename).parent
        called = CALLED.get(folder.name, ()) if folder.parent == PACKAGE else ()
        digests = [_digest(room) for room in (folder, *(PACKAGE / name for name in called))]
        stamp = self._impl.locator.get_source_stamp(), _sources(), "".join(digests)
        self._cache_file = _Files(self._impl, stamp, say)
        if not given_folder():
            trust.close_new(self.cache_path)
        self._say = say
        self._kernel = function.__name__
        self._identity = identity
        self._lock: Any = None

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        # numba's key has a digest of what a function encloses, which changes with every process
        return sig, codegen.magic_tuple(), self._identity

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Load as numba does; if there is nothing to load, return once this process may compile."""
        for folder in filter(None, (given_folder(), self.cache_path)):
            trust.check_folder(folder)
        if (overload := self._load(sig, target_context)) is not None:
            return overload
        # find out before compiling, which takes half a minute, whether the result can be stored
        try:
            os.makedirs(given_folder() or self.cache_path, 0o755, exist_ok=True)
            os.makedirs(self.cache_path, 0o755, exist_ok=True)
            tempfile.TemporaryFile(dir=self.cache_path).close()
        except OSError as error:
            raise _no_folder(given_folder() or self.cache_path, error) from None
        # another process may have stored the kernel while this one waited
        return self._load(sig, target_context) if self._take_lock() else None

    def _load(self, sig: Any, target_context: Any) -> Any:
        # pickles of functions without a module name this one, which numba does not add to `sys.modules`
        sys.modules.setdefault(_dynamic_module.__name__, _dynamic_module)
        try:
            _define_symbols(target_context)
            with self._guard_against_spurious_io_errors():
                return self._load_overload(sig, target_context)
        except OutputError:
            raise
        except OSError:  # no such folder
            return None
        except Exception as error:
            # a pickle that names something missing may raise anything
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
        """Wait until no other process compiles this kernel; return False if files cannot be locked."""
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
        """Release the lock, also if the kernel could not be compiled."""
        if self._lock is not None:
            _HELD.discard(self._lock.lock_file)
            self._lock.release()
            self._lock = None


def keep(dispatcher: Any, say: Callable[[str], None], identity: str = "") -> None:
    """Make numba's `dispatcher` keep what it compiles in files, one process at a time compiling a kernel. No
    folder is looked for before it compiles."""
    compile_now = dispatcher.compile
    files = None

    def compile_once(signature: Any) -> Any:
        nonlocal files
        # numba's lock between threads; reentrant, because a kernel compiles those that it calls
        with global_compiler_lock:
            if files is None:
                files = dispatcher._cache = KernelCache(dispatcher.py_func, say, identity)
            try:
                with paused():
                    return compile_now(signature)
            finally:
                files.release()

    dispatcher.compile = compile_once


def _define_symbols(target_context: Any) -> None:
    """Define the symbols that machine code may refer to, but for those that modules define which a pickled
    kernel names.

    Before numba loads it refreshes its target context, which in half a second imports all that it can
    compile; it does so before it compiles, too.
    """
    _runtime.rtsys.initialize(target_context)
    entrypoints.init_all()  # other packages' extensions of numba


def _no_folder(folder: str, error: Exception) -> OutputError:
    return OutputError(
        f"cannot keep compiled kernels in {folder!r} ({error}); expected a writable folder: "
        "set the environment variable NUMBA_CACHE_DIR to one"
    )


@cache
def _sources() -> str:
    """Return the digest of everything in this package that kernels are made from."""
    rooms = [PACKAGE / room for room in MECHANICS]
    files = [room.with_suffix(".py") for room in rooms]
    return "".join(_digest(file if file.is_file() else room) for room, file in zip(rooms, files, strict=True))


@cache
def _digest(room: Path) -> str:
    """Return the digest of a module, or of those in a folder: a kernel may call any module next to it."""
    digest = hashlib.sha256()
    modules = [room] if room.is_file() else room.glob("*.py")
    for path in sorted(path for path in modules if path.is_file()):
        digest.update(path.read_bytes())
    return digest.hexdigest()

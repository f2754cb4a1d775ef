"""Digest of all code and all values that functions from outside this package reach, so that a stored kernel
is never used for other code.

Names are followed as the bytecode follows them: globals, enclosed variables, attributes of modules and
classes, and in turn the names of the functions that are found. A module that is passed on as a whole counts
as a whole. For the standard library and installed packages the version counts, too, because their code may
not be readable. What numba would compile, but cannot be read, is refused by name.
"""

from __future__ import annotations

import builtins
import dis
import enum
import hashlib
import platform
import site
import sys
import sysconfig
import types
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import cache
from importlib import metadata
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any
from weakref import WeakKeyDictionary

import numba
import numpy as np
from numba.core.caching import NullCache
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher

from hoof_env.errors import ParameterError
from hoof_env.simd.cache import MECHANICS

_PLAIN = (bool, int, float, complex, str, bytes, type(None), type(Ellipsis), np.generic)
_MISSING = object()
_FOLLOWED = (ModuleType, type, enum.Enum)
_NAMED_ONLY = ("numpy", "numba", "llvmlite", "scipy", "math", "cmath", "builtins")
"""Libraries with code that numba replaces by its own: only their versions count."""


def fingerprint(*values: Any) -> str:
    """Return a digest of everything that functions reach, which identifies the kernels that contain them. An
    edit of any of it changes the digest; it is the same in every process. Functions of the mechanics are only
    named: a digest of their sources is in every kernel's stamp.

    Raises:
        ParameterError: something cannot be read, such as a function in machine code.
    """
    digest = _Digest()
    for value in values:
        digest.add(value)
    return digest.hexdigest()


def refresh(*values: Any) -> None:
    """Make numba forget the compiled helpers of functions from outside, if something that they reach has
    changed since, as in a notebook. Their cache files are not read.

    The machine code of each version of a helper gets a name of its own: of two functions of one name the
    first is called.
    """
    reached = _Digest()
    for value in values:
        reached.add(value)
    for helper in reached.helpers.values():
        present = fingerprint(helper)
        if _compiled_as.get(helper) == present:
            continue
        _compiled_as[helper] = present
        function = helper.py_func
        name = _names.setdefault(function, function.__qualname__)
        function.__qualname__ = f"{name}.{present[:12]}"
        with global_compiler_lock:
            # numba looks for changes only in the helper's own file
            if hasattr(helper, "_cache"):
                helper._cache = NullCache()
            helper._make_finalizer()()
            helper._reset_overloads()


_compiled_as: WeakKeyDictionary[Any, str] = WeakKeyDictionary()
"""Helpers and their fingerprints when they were compiled."""

_names: WeakKeyDictionary[Any, str] = WeakKeyDictionary()
"""Functions and their qualified names before `refresh` changed them."""


class _Digest:
    """Walk through everything that is reached."""

    def __init__(self) -> None:
        self.sha = hashlib.sha256()
        self.known: dict[int, Any] = {}  # keeps the values alive, so that no id is used twice
        self.helpers: dict[int, Any] = {}

    def hexdigest(self) -> str:
        return self.sha.hexdigest()

    def put(self, text: str) -> None:
        self.sha.update(f"{text};".encode())

    def add(self, value: Any, name: str = "") -> None:
        """Add a value of any kind; `name` is its name in a refusal."""
        if isinstance(value, enum.Enum):
            self.put(f"{_named(type(value))} {value.name}")
            self.add(value.value, name)
        elif isinstance(value, np.ndarray):
            if value.dtype.hasobject:
                raise _unreadable(name, value)
            self.put(f"{value.dtype.descr if value.dtype.names else value.dtype} {value.shape}")
            self.sha.update(value.tobytes())
        elif isinstance(value, _PLAIN):
            self.put(f"{type(value).__name__} {value!r}")
        elif isinstance(value, tuple | list):
            self.put(f"{len(value)} of {_named(type(value))} {getattr(value, '_fields', '')}")
            for part in value:
                self.add(part, name)
        elif isinstance(value, set | frozenset):
            self.put(f"{len(value)} in any order: {sorted(_alone(part) for part in value)}")
        elif isinstance(value, Mapping):
            self.put(f"{len(value)} by name")
            for key, part in value.items():
                self.add(key, name)
                self.add(part, name)
        elif id(value) in self.known:
            self.put(f"again {_named(value)}")
        else:
            self.known[id(value)] = value
            self._add_code_of(value, name)

    def _add_code_of(self, value: Any, name: str) -> None:
        """Add something that has code: a function, a class, a module or the like."""
        if isinstance(value, Dispatcher):
            if not _is_ours(value.py_func) and not is_library(value.py_func):
                self.helpers[id(value)] = value
            self.put(f"compiled {sorted(value.targetoptions.items(), key=str)}")
            self.add(value.py_func, name)
        elif isinstance(function := _python_of(value), FunctionType):
            self._add_function(function)
        elif isinstance(value, ModuleType):
            self._add_module(value)
        elif isinstance(value, type):
            self._add_class(value)
        elif isinstance(value, types.BuiltinFunctionType | np.ufunc):
            if not is_library(value):
                raise _unreadable(name, value)
            self.put(f"{_named(value)} {version_of(_module_of(value))}")
        elif isinstance(value, numba.core.types.Type | np.dtype | slice):
            self.put(f"{type(value).__name__} {value!r}")
        elif _is_known_to_numba(value):
            raise _unreadable(name, value)
        else:
            # numba cannot compile it, so it cannot change a kernel
            self.put(_named(type(value)))

    def _add_function(self, function: FunctionType) -> None:
        self.put(f"{function.__module__}.{_names.get(function, function.__qualname__)}")
        enclosed = map(_content, function.__closure__ or ())
        cells = dict(zip(function.__code__.co_freevars, enclosed, strict=True))
        if is_library(function):
            self.put(version_of(_module_of(function)))
            if _top(_module_of(function)) in _NAMED_ONLY or _is_standard(function.__code__.co_filename):
                return
            # the version stands for what cannot be read
            with suppress(ParameterError):
                self._add_code(function.__code__, function.__globals__, cells)
            # a factory of one version makes many functions, which differ in what they enclose
            for name, value in cells.items():
                self._add_leniently(value, name)
            for value in (*(function.__defaults__ or ()), *(function.__kwdefaults__ or {}).values()):
                self._add_leniently(value, function.__qualname__)
            return
        if not _is_ours(function):
            self._add_code(function.__code__, function.__globals__, cells)
        for name, value in cells.items():
            # of an enclosed module only the attributes that the code reads count, in `_add_code`
            if not isinstance(value, ModuleType):
                self.add(value, name)
        for value in (*(function.__defaults__ or ()), *(function.__kwdefaults__ or {}).values()):
            self.add(value, function.__qualname__)

    def _add_code(self, code: CodeType, names: Mapping[str, Any], cells: Mapping[str, Any]) -> None:
        """Add the code of a function and of its inner functions, and what they name."""
        self.put(repr((code.co_names, code.co_varnames, code.co_freevars, code.co_argcount)))
        self.sha.update(code.co_code)
        for constant in code.co_consts:
            if isinstance(constant, CodeType):
                self._add_code(constant, names, cells)
            else:
                self.add(constant)
        for root, *attributes in _chains(code):
            value = cells.get(root, _MISSING) if root in cells else names.get(root, _MISSING)
            value = getattr(builtins, root, _MISSING) if value is _MISSING else value
            where = root
            for attribute in attributes:
                if not isinstance(value, _FOLLOWED) or _is_foreign(value):
                    break
                value = getattr(value, attribute, _MISSING)
                where = f"{where}.{attribute}"
            self.put(where)
            is_enclosed = root in cells and where == root and not isinstance(value, ModuleType)
            if value is _MISSING:
                self.put("nothing")
            # `_add_function` adds enclosed values itself
            elif not is_enclosed:
                self.add(value, where)

    def _add_module(self, module: ModuleType) -> None:
        """Add a module that is passed on as a whole: all that is in it."""
        self.put(module.__name__)
        if _is_foreign(module):
            self.put(version_of(module.__name__))
            return
        if _is_ours(module):
            return
        for name, value in sorted(vars(module).items()):
            if not name.startswith("__"):
                self.put(name)
                self._add_leniently(value, name)

    def _add_class(self, kind: type) -> None:
        self.put(_named(kind))
        if is_library(kind):
            self.put(version_of(_module_of(kind)))
            return
        if _is_ours(kind):
            return
        # a class of numba.experimental.jitclass keeps fields and methods there
        if struct := getattr(kind, "class_type", None):
            self.put(repr(struct.struct))
            for method in struct.jit_methods.values():
                self.add(method)
        for base in kind.__bases__:
            self.add(base)
        for name, value in sorted(vars(kind).items()):
            if not name.startswith("__") or name == "__init__":
                self.put(name)
                self._add_leniently(value, name)

    def _add_leniently(self, value: Any, name: str) -> None:
        """Add a value that may be reached, but need not be: if it cannot be read, its type counts."""
        try:
            self.add(value, name)
        except ParameterError:
            self.put(_named(type(value)))


def _chains(code: CodeType) -> Iterator[tuple[str, ...]]:
    """Return the names that code reads from outside, each with the attributes that are read of it at once:
    ("lab", "numbers", "GRIP")."""
    chain: list[str] = []
    for step in dis.get_instructions(code):
        if step.opname in ("EXTENDED_ARG", "CACHE"):
            continue
        if chain and step.opname in ("LOAD_ATTR", "LOAD_METHOD"):
            chain.append(step.argval)
            continue
        if chain:
            yield tuple(chain)
        is_enclosed = step.opname == "LOAD_DEREF" and step.argval in code.co_freevars
        chain = [step.argval] if is_enclosed or step.opname in ("LOAD_GLOBAL", "LOAD_NAME") else []
    if chain:
        yield tuple(chain)


def _python_of(value: Any) -> Any:
    """Return the Python function behind an object that numba or Python made of it."""
    if isinstance(value, staticmethod | classmethod):
        value = value.__func__
    if isinstance(value, property):
        value = value.fget
    # of a dispatcher, of an intrinsic and of a ufunc of numba's
    for name in ("py_func", "_defn", "_dispatcher"):
        inner = getattr(value, name, None)
        if inner is not None and not isinstance(value, FunctionType):
            return getattr(inner, "py_func", inner)
    return value


def _content(cell: Any) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # the cell is empty: its variable was not assigned yet
        return None


def _alone(value: Any) -> str:
    digest = _Digest()
    digest.add(value)
    return digest.hexdigest()


def _is_known_to_numba(value: Any) -> bool:
    try:
        numba.typeof(value)
    except Exception:
        return False
    return True


def _unreadable(name: str, value: Any) -> ParameterError:
    return ParameterError(
        f"{name or _named(value)}: expected functions of Python, numbers, texts, arrays of numbers and tuples"
        f" of these in what a term, entry or law reaches, got {_named(type(value))}, which cannot be read:"
        " after a change of it a stored kernel would be stale; hand over its number, or write it in Python"
    )


def _named(value: Any) -> str:
    """Return module and name, without anything that differs from process to process."""
    name = getattr(value, "__qualname__", None) or getattr(value, "__name__", None)
    return f"{getattr(value, '__module__', '')}.{name}" if name else type(value).__qualname__


# Origin of code


def _module_of(value: Any) -> str:
    if isinstance(value, ModuleType):
        return value.__name__
    if isinstance(value, np.ufunc):
        return str(getattr(value, "__module__", None) or "numpy")
    return str(getattr(value, "__module__", None) or "builtins")


def _top(module: str) -> str:
    return module.partition(".")[0]


def _is_ours(value: Any) -> bool:
    """True if it is of the mechanics: the sources of these are in every kernel's stamp."""
    return _module_of(value).split(".")[:2] in [["hoof_env", room] for room in MECHANICS]


def is_library(value: Any) -> bool:
    """True if it is of the standard library or of an installed package, this one aside."""
    if isinstance(value, FunctionType):
        return _is_installed(value.__code__.co_filename) and _top(_module_of(value)) != "hoof_env"
    return _is_library(_module_of(value))


def _is_foreign(value: Any) -> bool:
    """True if it is a module of a library: its attributes need not be followed."""
    return isinstance(value, ModuleType) and _is_library(value.__name__)


def _is_library(module: str) -> bool:
    """True if it is a module of a library. Its file decides: a user's file may have the name of a standard
    module."""
    if _top(module) == "hoof_env":
        return False
    found = sys.modules.get(module) or sys.modules.get(_top(module))
    file = getattr(found, "__file__", None)
    if file is None:
        places = getattr(found, "__path__", ())  # of a namespace package
        in_places = bool(len(places)) and all(_is_installed(str(place)) for place in places)
        return _top(module) in sys.stdlib_module_names or in_places
    return _is_installed(file)


@cache
def _library_folders() -> tuple[list[Path], list[Path]]:
    """Return the folders of the standard library, and those of installed packages."""
    standard = {sysconfig.get_path(name) for name in ("stdlib", "platstdlib")}
    installed = {sysconfig.get_path(name) for name in ("purelib", "platlib")}
    installed |= {*site.getsitepackages(), site.getusersitepackages()}
    standard_folders = sorted(Path(path).resolve() for path in standard if path)
    installed_folders = sorted(Path(path).resolve() for path in installed if path)
    return standard_folders, installed_folders


@cache
def _is_installed(file: str) -> bool:
    standard, installed = _library_folders()
    parents = Path(file).resolve().parents
    return file.startswith("<frozen ") or any(folder in parents for folder in (*standard, *installed))


@cache
def _is_standard(file: str) -> bool:
    standard, installed = _library_folders()
    parents = Path(file).resolve().parents
    inside = any(folder in parents for folder in standard)
    # site-packages lies in a folder of the standard library
    return file.startswith("<frozen ") or (inside and not any(folder in parents for folder in installed))


@cache
def version_of(module: str) -> str:
    """Return the version of the package to which a module belongs."""
    top = _top(module)
    file = getattr(sys.modules.get(top), "__file__", None)
    if top in sys.stdlib_module_names and (file is None or _is_standard(file)):
        return platform.python_version()
    try:
        return f"{top} {metadata.version(top)}"
    except metadata.PackageNotFoundError:
        # the package that is installed may have another name than the module: scikit-learn, sklearn
        distributions = metadata.packages_distributions().get(top, [])
    if distributions:
        return " ".join(f"{name} {metadata.version(name)}" for name in sorted(set(distributions)))
    return f"{top} {getattr(sys.modules.get(top), '__version__', '')}"

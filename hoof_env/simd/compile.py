"""Kernels: plain functions that are traced once, and compiled by LLVM to machine code.

A trace runs the function with values that write its instructions (`machines.Writer`). The text that results
is all that the machine code depends on, besides the processor and LLVM: its digest is the name under which
the code is found, in this process and in files (`objects`). Without fast-math, so that a result does not
depend on how the compiler arranged a loop.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from functools import cache
from typing import Any, get_type_hints
from weakref import WeakValueDictionary

import llvmlite.binding as llvm
import numpy as np
from llvmlite.binding.ffi import ObjectRef
from llvmlite.binding.newpassmanagers import NewPassManager

from hoof_env.errors import HoofEnvError, ParameterError
from hoof_env.simd import objects
from hoof_env.simd.machines import Eager, Place, Writer, running_on
from hoof_env.simd.memory import AXES, Arrays, Given, Matrix, Pointer
from hoof_env.simd.values import Index, Lanes, Mask, Number, Whole, word

LEVEL = 2
"""LLVM's level of optimisation: without its vectorisers, because the code is already in vectors."""

CODE_MODEL = "jitdefault"
"""LLVM's code model: constants may lie anywhere. MCJIT allocates code and constants separately, and in a
process with fragmented memory they are far apart; the small model, 3 to 6 % faster, crashed such a
process."""

PROCESSOR = "HOOF_ENV_CPU"
"""Environment variable: the processor to compile for, by LLVM's name, such as x86-64 or haswell."""

RECENT = 64
"""Number of unused kernels whose machine code stays loaded, in case an environment is made again."""

COMPILED: list[str] = []
"""Names of the kernels that this process has compiled, not read from files."""


class CompilerError(HoofEnvError):
    """LLVM refused a kernel, which is an error of this package."""


def host() -> tuple[str, str]:
    """Return LLVM's names of the processor and its features."""
    given = os.environ.get(PROCESSOR)
    return (given, "") if given else (llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten())


def _new_target() -> Any:
    cpu, features = host()
    target = llvm.Target.from_triple(llvm.get_process_triple())
    return target.create_target_machine(
        cpu=cpu, features=features, opt=LEVEL, reloc=relocation(target.name), codemodel=CODE_MODEL, jit=True
    )


def relocation(architecture: str) -> str:
    """Return LLVM's relocation model for an architecture, the same as numba's for compiled objects."""
    return "static" if architecture.startswith("x86") else "default"


@cache
def target() -> Any:
    """Return LLVM's machine for this processor, started at the first call."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    if os.environ.get(PROCESSOR):
        _check_processor()
    return _new_target()


def _check_processor() -> None:
    """Check that LLVM knows the processor of the environment variable. LLVM reports an unknown processor on
    the standard error only, and ends the process when it compiles for it.

    Raises:
        ParameterError: the processor is unknown.
    """
    try:
        error = os.dup(2)
    except OSError:  # there is no standard error
        return
    reading, writing = os.pipe()
    try:
        os.dup2(writing, 2)
        _new_target()
    finally:
        os.dup2(error, 2)
        os.write(writing, b"\n")  # so that the read does not block
        output = os.read(reading, 4096)
        for number in (error, reading, writing):
            os.close(number)
    if b"not a recognized processor" in output:
        raise ParameterError(
            f"{PROCESSOR}: expected a processor by LLVM's name, such as haswell or x86-64-v3, got"
            f" {os.environ[PROCESSOR]!r}"
        )


@cache
def _identity() -> str:
    """Return all that machine code depends on besides its text."""
    version = ".".join(map(str, llvm.llvm_version_info))
    return " ".join((llvm.get_process_triple(), *host(), version, str(LEVEL), CODE_MODEL))


def optimised(text: str, machine: Any = None) -> Any:
    """Return the module that LLVM parses from a text, after LLVM's passes, for this processor or another of
    LLVM's target machines.

    Raises:
        CompilerError: LLVM refuses the text.
    """
    machine = machine or target()
    try:
        module = llvm.parse_assembly(text)
        module.verify()
    except RuntimeError as error:
        words = str(error).strip().splitlines()
        hint = ""
        if "dominate" in str(error):
            hint = (
                "; a value that was made inside `when`, `cond` or `loop` is used outside: keep it in a `Cell`"
            )
        raise CompilerError(f"LLVM refuses a kernel{hint}: {' '.join(words[:3])}") from error
    module.triple, module.data_layout = machine.triple, str(machine.target_data)
    tuning = llvm.create_pipeline_tuning_options(speed_level=LEVEL)
    tuning.loop_vectorization = tuning.slp_vectorization = False
    passes = llvm.create_pass_builder(machine, tuning)
    manager = passes.getModulePassManager()
    manager.run(module, passes)
    # llvmlite 0.50 does not free it: its class inherits a `_dispose` without effect
    if type(manager)._dispose is ObjectRef._dispose:
        NewPassManager._dispose(manager)
    return module


def compiled(text: str, machine: Any = None) -> bytes:
    """Return the object of a module, machine code of this processor or of another machine."""
    machine = machine or target()
    return bytes(machine.emit_object(optimised(text, machine)))


class Code:
    """Machine code in memory, of one kernel; it stays as long as this object.

    Attributes:
        address: of its function.
    """

    def __init__(self, content: bytes) -> None:
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _new_target())
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(content))
        self._engine.finalize_object()
        self.address = self._engine.get_function_address("kernel")


_LOADED: WeakValueDictionary[str, Code] = WeakValueDictionary()
_RECENT: deque[Code] = deque(maxlen=RECENT)
_LOCK = threading.RLock()


if hasattr(os, "register_at_fork"):
    # no fork while another thread compiles: a child would wait for ever for llvmlite's lock
    os.register_at_fork(before=_LOCK.acquire, after_in_parent=_LOCK.release, after_in_child=_LOCK.release)


def code_of(text: str, name: str) -> Code:
    """Return the machine code of a module: loaded before, read from a file, or compiled."""
    with _LOCK:
        target()
        digest = hashlib.sha256(f"{_identity()}\n{text}".encode()).hexdigest()
        code = _LOADED.get(digest)
        if code is None:
            file = f"{name}-{digest[:40]}.o"
            content = objects.read(file)
            if content is None:
                content = compiled(text)
                COMPILED.append(name)
                objects.write(file, content)
            code = _LOADED[digest] = Code(content)
        _RECENT.append(code)
        return code


Parameter = Any
"""Type of a kernel's argument: `Arrays` for a result of `Arrays.hold`, `Matrix` for an array of doubles,
`float`, `int`."""


class Kernel:
    """Function that runs as machine code, traced at its first call.

    Args:
        function: the function, which takes values.
        parameters: types of its arguments; see `Parameter`.
        name: name for messages and files.
        is_threaded: True if several threads may run it at once, without Python's lock; a call takes a little
            longer.

    Attributes:
        call: the machine code as a function of ctypes, which checks no types; None before the first call.
    """

    def __init__(
        self,
        function: Callable[..., Any],
        parameters: Sequence[Parameter],
        name: str | None = None,
        is_threaded: bool = False,
    ) -> None:
        self.function = function
        self.parameters = tuple(parameters)
        self.name = name or function.__name__
        self.is_threaded = is_threaded
        self.call: Any = None

    def __call__(self, *arguments: Any) -> Any:
        if BLOCKS and _HERE.machine is not None:
            return _run(self.function, self.parameters, arguments, _HERE.machine)
        if self.call is None:
            self.compile()
        if Matrix not in self.parameters:
            return self.call(*arguments)
        if len(arguments) != len(self.parameters):
            raise TypeError(f"{self.name}: expected {len(self.parameters)} arguments, got {len(arguments)}")
        given: list[Any] = []
        for kind, argument in zip(self.parameters, arguments, strict=True):
            given += _array(argument) if kind is Matrix else [argument]
        return self.call(*given)

    def compile(self) -> None:
        """Trace the kernel and find its machine code, unless that was done before."""
        if self.call is not None:
            return
        text, result = traced(self.function, self.parameters)
        kinds: list[Any] = []
        for kind in self.parameters:
            kinds += _CTYPES[kind] if isinstance(kind, type) else [ctypes.c_void_p]
        code = code_of(text, self.name)
        make: Any = ctypes.CFUNCTYPE if self.is_threaded else ctypes.PYFUNCTYPE
        call = make(result, *kinds)(code.address)
        call.code = code  # the machine code lives as long as the function
        self.call = call

    def run_now(self, *arguments: Any, exact: bool = True) -> Any:
        """Run the kernel on NumPy, step by step, as a debugger can follow; see `machines.Eager`."""
        return _run(self.function, self.parameters, arguments, Eager(exact))


_CTYPES: dict[Any, list[Any]] = {
    Matrix: [ctypes.c_void_p, *[ctypes.c_int64] * AXES],
    float: [ctypes.c_double],
    int: [ctypes.c_int64],
}


def _array(array: Any) -> list[Any]:
    """Return an array of the caller as arguments of machine code.

    Raises:
        TypeError: it is not a writable contiguous array of doubles.
    """
    expected = "expected a contiguous array of doubles that may be written"
    if not isinstance(array, np.ndarray):
        raise TypeError(f"{expected}, got {type(array).__name__}")
    flags = array.flags
    if array.dtype != np.float64 or not (flags.c_contiguous and flags.writeable) or array.ndim > AXES:
        raise TypeError(f"{expected}, got {array.dtype} of shape {array.shape}, {flags}")
    return [array.ctypes.data, *array.shape, *[0] * (AXES - array.ndim)]


def traced(function: Callable[..., Any], parameters: Sequence[Parameter]) -> tuple[str, Any]:
    """Return the instructions of a kernel, and the type of ctypes of its result."""
    declared: list[str] = []
    with running_on(Writer()) as machine:
        given: list[Any] = []
        for k, kind in enumerate(parameters):
            x = f"%a{k}"
            if isinstance(kind, Arrays):
                declared.append(f"ptr noalias readonly {x}")
                given.append(Given(kind, x))
            elif kind is Matrix:
                declared += [f"ptr noalias {x}", *(f"i64 {x}_{axis}" for axis in range(AXES))]
                given.append(Matrix(Pointer(x), tuple(Index(f"{x}_{axis}") for axis in range(AXES))))
            elif kind is float:
                declared.append(f"double {x}")
                given.append(Lanes(x, 0))
            else:
                declared.append(f"i64 {x}")
                given.append(Index(x))
        result = function(*given)
        if isinstance(result, Mask):
            result = result.to_whole()
        of_nothing: tuple[str, str, Any] = ("void", "", None)
        kind, x, ctype = of_nothing
        if isinstance(result, Lanes):
            kind, x, ctype = "double", result.x, ctypes.c_double
        elif result is not None:
            kind, x, ctype = "i64", str(word(result)), ctypes.c_int64
        machine.do(f"ret {kind} {x}")
        return machine.text("kernel", declared, kind), ctype


def _run(
    function: Callable[..., Any], parameters: Sequence[Parameter], arguments: Sequence[Any], machine: Any
) -> Any:
    """Run the function of a kernel on a machine that computes at once; return the result of the machine
    code."""
    with running_on(machine), np.errstate(all="ignore"):
        given: list[Any] = []
        for kind, argument in zip(parameters, arguments, strict=True):
            if isinstance(kind, Arrays):
                given.append(Given(kind, argument))
            elif kind is Matrix:
                _array(argument)
                given.append(Matrix(Pointer(Place(argument.reshape(-1))), argument.shape))
            else:
                given.append(Lanes(float(argument), 0) if kind is float else int(argument))
        result = function(*given)
        if isinstance(result, Lanes):
            return float(result.x)
        return int(result.x) if isinstance(result, Mask) else result


# Blocks in which kernels are not run as machine code


class _Here(threading.local):
    machine: Any = None


_HERE = _Here()

BLOCKS: list[Any] = []
"""Machines of the open blocks of all threads. While the list is not empty, code that calls a kernel's `call`
directly, to save the cost of a check, must call the kernel itself."""


def on_numpy(exact: bool = True) -> AbstractContextManager[None]:
    """Let every kernel that this thread calls in the block run on NumPy, where a debugger can follow: slower
    by ten thousand times, with the same bits.

    Args:
        exact: False for products that are rounded before they enter a sum: twice as fast, other last digits.
    """
    return on_machine(Eager(exact))


@contextmanager
def on_machine(machine: Any) -> Iterator[None]:
    """Let every kernel that this thread calls in the block run on a machine that computes at once, `Eager` or
    one like it. This thread makes all calls, also those that several would share."""
    before, _HERE.machine = _HERE.machine, machine
    BLOCKS.append(machine)
    try:
        yield
    finally:
        _HERE.machine = before
        BLOCKS.remove(machine)


def is_on_machine() -> bool:
    """Return True in a block of `on_numpy` or `on_machine`."""
    return _HERE.machine is not None


def kernel(function: Callable[..., Any]) -> Kernel:
    """Make a kernel of a function with annotated arguments: `Matrix`, `Number` or `Whole`."""
    kinds = {Matrix: Matrix, Number: float, Lanes: float, Whole: int, Index: int}
    hints = get_type_hints(function)
    names = function.__code__.co_varnames[: function.__code__.co_argcount]
    return Kernel(function, [kinds[hints[name]] for name in names])

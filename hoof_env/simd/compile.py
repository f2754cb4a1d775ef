"""Kernels: traced once, optimised by LLVM, kept as objects in files. No pickles; the name of a file is the digest
of all that the machine code follows from: the instructions as traced, the processor, and LLVM's version."""

from __future__ import annotations

import ctypes
import hashlib
import os
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import cache, wraps
from pathlib import Path
from typing import Any, TypeVar

import llvmlite
import llvmlite.binding as llvm

from hoof_env.simd.machines import Writer, running_on
from hoof_env.simd.memory import Matrix, Pointer, Record
from hoof_env.simd.values import Index, Lanes, Mask, rounded

F = TypeVar("F", bound=Callable[..., Any])

QUIET = "HOOF_ENV_QUIET"
LEVEL = 3
VECTORISE = False  # the code is vectors already
COMPILED: list[str] = []
"""Names of the kernels that this process has compiled."""

TIMES: list[dict[str, Any]] = []
"""What each kernel took: seconds of the processor of each part."""


def inline_llvm(function: F) -> F:
    """Mark a part of kernels. What it takes and what it returns enters sums rounded, as what numba passes to a
    function does; that is all this does."""

    @wraps(function)
    def part(*arguments: Any) -> Any:
        return rounded(function(*map(rounded, arguments)))

    return part  # type: ignore[return-value]


inline_source = inline_llvm


@cache
def _machine() -> tuple[Any, Any, str]:
    """Return LLVM's target machine and linker, and what identifies them."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    cpu = llvm.get_host_cpu_name()
    features = llvm.get_host_cpu_features().flatten()
    target = llvm.Target.from_default_triple().create_target_machine(
        cpu=cpu, features=features, opt=LEVEL, reloc="pic", codemodel="small"
    )
    linker = llvm.create_lljit_compiler(
        llvm.Target.from_default_triple().create_target_machine(cpu=cpu, features=features, jit=True)
    )
    return target, linker, f"{target.triple} {cpu} {features} {llvmlite.__version__} {LEVEL} {VECTORISE}"


def folder() -> Path:
    """Return the folder of stored objects."""
    given = os.environ.get("TRACED_CACHE") or Path(__file__).parents[2] / "objects"
    return Path(given)


def object_code(text: str) -> bytes:
    """Compile a module to an object."""
    target, _, _ = _machine()
    module = llvm.parse_assembly(text)
    module.verify()  # of a value that left its branch, above all
    module.triple, module.data_layout = target.triple, str(target.target_data)
    tuning = llvm.create_pipeline_tuning_options(speed_level=LEVEL)
    tuning.loop_vectorization = tuning.slp_vectorization = VECTORISE
    passes = llvm.create_pass_builder(target, tuning)
    manager = passes.getModulePassManager()
    manager.run(module, passes)
    return bytes(target.emit_object(module))


_NUMBER = [0]


def linked(content: bytes, name: str) -> tuple[Any, int]:
    """Return what keeps an object loaded, and the address of its function."""
    _NUMBER[0] += 1
    library = llvm.JITLibraryBuilder().add_object_img(content).add_current_process().export_symbol(name)
    tracker = library.link(_machine()[1], f"{name}{_NUMBER[0]}")
    return tracker, tracker[name]


KINDS: dict[str, tuple[str, Any]] = {
    "pointer": ("ptr", ctypes.c_void_p),
    "double": ("double", ctypes.c_double),
    "index": ("i64", ctypes.c_int64),
}


def traced(function: Callable[..., Any], arguments: Sequence[Any], name: str) -> str:
    """Return the instructions of a kernel.

    Args:
        function: the kernel.
        arguments: for each argument what it is: "pointer", "addresses", "double", "index" or "truth"; or a
            record type with the fields of it that are known, as a tuple.
        name: of the function.
    """
    machine = Writer()
    declared, given = [], []
    for k, kind in enumerate(arguments):
        x = f"%a{k}"
        if isinstance(kind, tuple):
            declared.append(f"ptr noalias {x}")
            given.append(Record(x, *kind))
            continue
        declared.append(f"{KINDS.get(kind, ('i64',))[0] if kind != 'addresses' else 'ptr'} {x}")
        if kind == "matrix":
            declared[-1] = f"ptr noalias {x}, i64 {x}r, i64 {x}c"
            given.append(Matrix(Pointer(x), Index(f"{x}r"), Index(f"{x}c")))
        elif kind == "pointer":
            given.append(Pointer(x))
        elif kind == "addresses":
            given.append(Pointer(x, "i64"))
        elif kind == "double":
            given.append(Lanes(x, 0))
        else:
            given.append(Index(x))
    with running_on(machine):
        result = function(*given)
        if result is None:
            machine.do("ret void")
            kind = "void"
        else:
            x = result.x if isinstance(result, (Index, Mask)) else int(result)
            kind = "i1" if isinstance(result, Mask) else "i64"
            machine.do(f"ret {kind} {x}")
    return machine.text(name, declared, kind)


def kernel(function: F) -> F:
    """Leave a function of the paper's solver as it is: the sketch does not trace these."""
    return function


class Kernel:
    """Kernel that is traced and compiled, or loaded, at its first call."""

    def __init__(self, function: Callable[..., Any], arguments: Sequence[Any], returns: bool = False) -> None:
        self.__name__ = function.__name__
        self.function = function
        self.arguments = arguments
        self.returns = returns
        self.call: Any = None

    def __call__(self, *arguments: Any) -> Any:
        if self.call is None:
            self.compile()
        return self.call(*arguments)

    def compile(self) -> None:
        times: dict[str, Any] = {"name": self.__name__}
        now = time.process_time()
        text = traced(self.function, self.arguments, "kernel")
        times["trace"] = time.process_time() - now
        now = time.process_time()
        identity = _machine()[2]
        times["target"] = time.process_time() - now
        key = hashlib.sha256(f"{identity}\n{text}".encode()).hexdigest()
        file = folder() / f"{self.__name__}-{key[:32]}.o"
        now = time.process_time()
        try:
            content = file.read_bytes()
        except FileNotFoundError:
            content = object_code(text)
            times["llvm"] = time.process_time() - now
            COMPILED.append(self.__name__)
            file.parent.mkdir(parents=True, exist_ok=True)
            with tempfile.NamedTemporaryFile(dir=file.parent, delete=False) as new:
                new.write(content)
            os.replace(new.name, file)
        now = time.process_time()
        self.tracker, self.address = linked(content, "kernel")
        times["load"] = time.process_time() - now
        kinds: list[Any] = []
        for kind in self.arguments:
            if kind == "matrix":
                kinds += [ctypes.c_void_p, ctypes.c_int64, ctypes.c_int64]
            else:
                kinds.append(KINDS.get(kind, (0, ctypes.c_int64))[1] if isinstance(kind, str) else ctypes.c_void_p)
                if kind == "addresses":
                    kinds[-1] = ctypes.c_void_p
        result = ctypes.c_int64 if self.returns else None
        self.call = ctypes.CFUNCTYPE(result, *kinds)(self.address)
        times |= {"ir": len(text), "lines": text.count("\n"), "object": len(content)}
        self.text, self.content = text, content
        TIMES.append(times)
        if os.environ.get("TRACED_SAY"):
            print(times, file=sys.stderr)

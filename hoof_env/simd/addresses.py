"""Machine code that other programs call with addresses, and in threads of theirs.

These operations have no meaning on NumPy, where there are no addresses: a function that uses them becomes a
kernel, but runs on no machine that computes at once.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import llvmlite.binding as llvm

from hoof_env.simd.machines import CURRENT
from hoof_env.simd.memory import Pointer
from hoof_env.simd.values import Index, Mask, Whole, word

SSE_FLUSHES = 0x8040
"""Bits of MXCSR by which an x86 processor takes numbers below the normal ones for 0: FTZ and DAZ."""

ARM_FLUSHES = 1 << 24 | 1 << 19
"""Bits of FPCR by which an ARM processor does: FZ and FZ16."""


def numbers_at(address: Whole, item: str) -> Pointer:
    """Return the numbers at an address, of one of LLVM's types that `memory.ITEMS` names."""
    return Pointer(CURRENT.machine.pointer(word(address)), item)


def words_at(address: Whole) -> Pointer:
    """Return the whole numbers of 64 bits at an address."""
    return numbers_at(address, "i64")


def new_words(count: int) -> Pointer:
    """Return memory on the stack for whole numbers."""
    return Pointer(CURRENT.machine.slot("i64", count), "i64")


def new_text(text: str) -> Pointer:
    """Return memory on the stack with a text, which ends with a byte 0."""
    content = text.encode() + b"\0"
    content += b"\0" * (-len(content) % 8)
    words = new_words(len(content) // 8)
    for k in range(len(content) // 8):
        set_word(words, k, int.from_bytes(content[8 * k : 8 * k + 8], sys.byteorder, signed=True))
    return words


def set_word(words: Pointer, k: Whole, value: Whole) -> None:
    """Store a whole number."""
    machine = CURRENT.machine
    machine.store(machine.at(words.x, word(k), "i64"), word(value), "i64")


def address_of(words: Pointer) -> Index:
    """Return the address of memory."""
    return Index(CURRENT.machine.new(f"ptrtoint ptr {words.x} to i64"))


def lower_half(words: Pointer, k: int) -> Index:
    """Return the first four bytes of a word as a whole number that is not negative."""
    machine = CURRENT.machine
    return Index(machine.widened(machine.load(machine.at(words.x, k, "i64"), "i32")))


def copy_bytes(to: Whole, start: Whole, count: Whole) -> None:
    """Copy bytes from one address to another."""
    machine = CURRENT.machine
    machine.declared["memcpy"] = "declare void @llvm.memcpy.p0.p0.i64(ptr, ptr, i64, i1)"
    one, other = (machine.pointer(word(address)) for address in (to, start))
    machine.do(f"call void @llvm.memcpy.p0.p0.i64(ptr {one}, ptr {other}, i64 {word(count)}, i1 false)")


def call_at(address: Whole, argument: Whole) -> Index:
    """Call the function at an address with a whole number or an address; return its result, another."""
    machine = CURRENT.machine
    function = machine.pointer(word(address))
    return Index(machine.new(f"call i64 {function}(i64 {word(argument)})"))


def replaced(words: Pointer, k: int, old: Whole, new: Whole) -> Mask:
    """Replace a word if it is `old`, in one operation that no other thread divides; return whether it was."""
    machine = CURRENT.machine
    place = machine.at(words.x, k, "i64")
    pair = machine.new(f"cmpxchg ptr {place}, i64 {word(old)}, i64 {word(new)} seq_cst seq_cst")
    return Mask(machine.new(f"extractvalue {{ i64, i1 }} {pair}, 1"), 0)


@contextmanager
def subnormal_numbers() -> Iterator[None]:
    """Compute with numbers below the normal ones in what is traced in the block, also in threads of a program
    that takes them for 0, and leave the thread as it was."""
    architecture = llvm.get_process_triple().partition("-")[0]
    before, restore = _without_flushes(architecture)
    before()
    yield
    restore()


def _without_flushes(architecture: str) -> tuple[Callable[[], None], Callable[[], None]]:
    """Return functions that write the instructions before and after the block."""
    machine = CURRENT.machine
    if architecture in ("x86_64", "i686", "amd64"):
        for name in ("stmxcsr", "ldmxcsr"):
            machine.declared[name] = f"declare void @llvm.x86.sse.{name}(ptr)"
        found, wanted = machine.slot("i32"), machine.slot("i32")

        def before() -> None:
            machine.do(f"call void @llvm.x86.sse.stmxcsr(ptr {found})")
            bits = machine.new(f"and i32 {machine.load(found, 'i32')}, {~SSE_FLUSHES}")
            machine.store(wanted, bits, "i32")
            machine.do(f"call void @llvm.x86.sse.ldmxcsr(ptr {wanted})")

        return before, lambda: machine.do(f"call void @llvm.x86.sse.ldmxcsr(ptr {found})")
    if architecture in ("aarch64", "arm64"):
        machine.declared["get.fpcr"] = "declare i64 @llvm.aarch64.get.fpcr()"
        machine.declared["set.fpcr"] = "declare void @llvm.aarch64.set.fpcr(i64)"
        control = machine.slot("i64")

        def before() -> None:
            found = machine.new("call i64 @llvm.aarch64.get.fpcr()")
            machine.store(control, found, "i64")
            bits = machine.new(f"and i64 {found}, {~ARM_FLUSHES}")
            machine.do(f"call void @llvm.aarch64.set.fpcr(i64 {bits})")

        def restore() -> None:
            machine.do(f"call void @llvm.aarch64.set.fpcr(i64 {machine.load(control, 'i64')})")

        return before, restore
    return (lambda: None), (lambda: None)

"""Handler of XLA's typed foreign function interface: machine code that XLA calls for a control step.

XLA gives the address of a call frame, whose words are named below; the structs are in
`xla/ffi/api/c_api.h`, version 0.x of the interface. The handler copies the actions into the arrays of the
environments, calls the kernel of a step, and copies the outcome out; it calls Python for Python's part
alone. The first operand is a handle: the address of `Word`s, how often these were used, and the address
subtracted from `SUM`. The second is the address of the `Word`s whose functions are called: no other address
is followed. Actions are the third.
"""

from __future__ import annotations

from enum import IntEnum, auto
from functools import cache

from hoof_env.simd import Cell, Whole, loop, when
from hoof_env.simd.addresses import (
    address_of,
    call_at,
    copy_bytes,
    lower_half,
    new_text,
    new_words,
    numbers_at,
    replaced,
    set_word,
    subnormal_numbers,
    words_at,
)
from hoof_env.simd.compile import Kernel
from hoof_env.simd.memory import Pointer
from hoof_env.simd.values import Index


class _Counted(IntEnum):
    @staticmethod
    def _generate_next_value_(name: str, start: int, count: int, last: list[int]) -> int:
        return count


class Word(_Counted):
    """Places of Python's messages to the handler, in an array of whole numbers. An address and a number of
    bytes follow for each output after the rewards."""

    USES = auto()  # number of uses so far; BUSY during one, GONE without environments
    CHECK = auto()  # 1: Python has something to do before the next step
    ATTEND = auto()  # 1: Python has something to do after the next step, whatever its code
    IS_DIRECT = auto()  # 1: the kernel is called here; 0: by Python
    KERNEL = auto()  # address of the kernel of a step
    HELD = auto()  # its argument
    PYTHON = auto()  # address of the function that runs Python: 0 if all went well
    ACTIONS = auto()  # address of the actions, and their size
    ACTION_BYTES = auto()
    OBSERVATIONS = auto()  # address of the observations, and their size
    OBSERVATION_BYTES = auto()
    LAST = auto()  # address of a copy of the observations before restarts, 0 without
    STEP_REWARDS = auto()  # address of the kernel's rewards
    REWARDS = auto()  # of the rewards of the last step, as doubles, and their number
    REWARD_COUNT = auto()
    ENDS = auto()  # of `terminated` and `truncated`, a byte each, and their number in words
    END_WORDS = auto()
    STALE = auto()  # address of the message about an old handle
    MESSAGE = auto()  # address of Python's message
    OUTPUTS = auto()  # number of outputs after the rewards


HANDLE = 3
"""Words of a handle."""

SUM = 0x686F_6F66_2D65_6E76
"""Sum of the first and the last word of a handle."""

NO_HANDLE = (
    "handle: expected the one that envs.xla() or the last call of these environments returned, got another"
    " environment's, or other numbers in its place, such as zeros"
)

BUSY, GONE = -1, -2

BEFORE, INSTEAD = -3, -2
"""Reasons for which Python is called: before a step, and in place of it. Any other number is the code of a
step whose kernel was run."""

EXECUTE = 3
"""Stage of a call frame in which the function is to run."""

METADATA = 1
"""Type of the extension of a call frame by which XLA asks for the version of the interface."""

INVALID_ARGUMENT = 3

ERROR_SIZE = 28
"""Size of the arguments of an error [bytes]."""

FRAME_EXTENSION, FRAME_API, FRAME_STAGE, FRAME_COUNT, FRAME_INPUTS, FRAME_RESULTS, FRAME_OUTPUTS = (
    1,
    2,
    4,
    7,
    9,
    12,
    14,
)
"""Words of a call frame."""

OLDEST_VERSION = 1 << 32
"""Version 0.1 of the interface, used by jax 0.5.0, which asks without naming it; its structs have the words
above."""

API_VERSION, API_ERROR = 4, 6
"""Words of XLA's functions: the version of the interface, and the function that makes an error."""

TYPE, DATA = 2, 3
"""Words of a buffer: the type of its numbers, and their address."""

DOUBLE = 12
"""Type of doubles."""


@cache
def handler() -> Kernel:
    """Return the handler, one for all environments of this process."""
    kernel = Kernel(handle, [int], "xla_handler")
    kernel.compile()
    return kernel


def handle(frame: Index) -> Whole:
    """Answer a call of XLA; return the address of an error, 0 without."""
    call = words_at(frame)
    error = Cell(0)
    is_question = Cell(0)

    @when(call[FRAME_EXTENSION] != 0)
    def _() -> None:
        extension = words_at(call[FRAME_EXTENSION])

        @when(lower_half(extension, 1) == METADATA)
        def _() -> None:
            is_question.value = 1
            version = Cell(OLDEST_VERSION)

            @when(call[FRAME_API] != 0)
            def _() -> None:
                version.value = words_at(call[FRAME_API])[API_VERSION]

            set_word(words_at(extension[3]), 3, version.value)

    @when((is_question.value == 0) & (lower_half(call, FRAME_STAGE) == EXECUTE))
    def _() -> None:
        with subnormal_numbers():
            message = answer(call)

            @when(message != 0)
            def _() -> None:
                arguments = new_words(4)
                set_word(arguments, 0, ERROR_SIZE)
                set_word(arguments, 1, 0)
                set_word(arguments, 2, message)
                set_word(arguments, 3, INVALID_ARGUMENT)
                error.value = call_at(words_at(call[FRAME_API])[API_ERROR], address_of(arguments))

    result: Whole = error.value
    return result


def answer(call: Pointer) -> Index:
    """Take a step if there are actions, and return results if there are outputs for them; return the address
    of an error's message, 0 without."""
    inputs, outputs = words_at(call[FRAME_INPUTS]), words_at(call[FRAME_OUTPUTS])
    given, own = words_at(words_at(inputs[0])[DATA]), words_at(words_at(inputs[1])[DATA])
    message = Cell(0)
    is_handle = (given[0] == own[0]) & (given[HANDLE - 1] == SUM - given[0])

    @when(is_handle)
    def _() -> None:
        message.value = use(call, given, outputs)

    @when(~is_handle)
    def _() -> None:
        message.value = address_of(new_text(NO_HANDLE))

    found: Index = message.value
    return found


def use(call: Pointer, given: Pointer, outputs: Pointer) -> Index:
    """Answer a call with a handle; return the address of an error's message, 0 without."""
    inputs = words_at(call[FRAME_INPUTS])
    words, uses = words_at(given[0]), given[1]
    message = Cell(words[Word.STALE])

    @when(replaced(words, Word.USES, uses, BUSY))
    def _() -> None:
        failed = Cell(0)

        @when(words[Word.CHECK] != 0)
        def _() -> None:
            failed.value = call_at(words[Word.PYTHON], BEFORE)

        @when((failed.value == 0) & (call[FRAME_COUNT] == 3))
        def _() -> None:
            copy_bytes(words[Word.ACTIONS], words_at(inputs[2])[DATA], words[Word.ACTION_BYTES])
            failed.value = take_step(words)

        @when((failed.value == 0) & (call[FRAME_RESULTS] > 1))
        def _() -> None:
            write_results(words, outputs)

        result = words_at(words_at(outputs[0])[DATA])
        set_word(result, 0, given[0])
        set_word(result, 1, uses + 1)
        set_word(result, 2, given[2])
        message.value = 0

        @when(failed.value != 0)
        def _() -> None:
            message.value = words[Word.MESSAGE]

        set_word(words, Word.USES, uses + 1)

    found: Index = message.value
    return found


def take_step(words: Pointer) -> Index:
    """Take a control step; return 0 unless it failed."""
    failed = Cell(0)

    @when(words[Word.IS_DIRECT] == 0)
    def _() -> None:
        failed.value = call_at(words[Word.PYTHON], INSTEAD)

    @when(words[Word.IS_DIRECT] != 0)
    def _() -> None:
        code = call_at(words[Word.KERNEL], words[Word.HELD])
        copy_bytes(words[Word.REWARDS], words[Word.STEP_REWARDS], words[Word.REWARD_COUNT] * 8)
        ends = numbers_at(words[Word.ENDS], "i64")
        for n in loop(words[Word.END_WORDS]):
            set_word(ends, n, 0)

        @when(words[Word.LAST] != 0)
        def _() -> None:
            copy_bytes(words[Word.LAST], words[Word.OBSERVATIONS], words[Word.OBSERVATION_BYTES])

        @when((code != 0) | (words[Word.ATTEND] != 0))
        def _() -> None:
            failed.value = call_at(words[Word.PYTHON], code)

    found: Index = failed.value
    return found


def write_results(words: Pointer, outputs: Pointer) -> None:
    """Copy the results of the last step into the outputs: rewards after the handle, then the rest."""
    rewards, buffer = numbers_at(words[Word.REWARDS], "double"), words_at(outputs[1])

    @when(lower_half(buffer, TYPE) == DOUBLE)
    def _() -> None:
        copy_bytes(buffer[DATA], words[Word.REWARDS], words[Word.REWARD_COUNT] * 8)

    @when(lower_half(buffer, TYPE) != DOUBLE)
    def _() -> None:
        singles = numbers_at(buffer[DATA], "float")
        for n in loop(words[Word.REWARD_COUNT]):
            singles[n] = rewards[n]

    for n in loop(words[Word.OUTPUTS]):
        place = n * 2 + len(Word)
        copy_bytes(words_at(outputs[n + 2])[DATA], words[place], words[place + 1])

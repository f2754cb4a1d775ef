"""Constants and rows of memory that terms and entries declare, and maps from actions to those of a body."""

from __future__ import annotations

import keyword
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import wraps
from typing import Any, NamedTuple, TypeVar

from hoof_env.errors import ParameterError, UnknownArgumentError, brief, check_number
from hoof_env.simd.user_functions import check_function

LARGEST = 1e12
"""Largest absolute value of a constant, and of a row at a start."""


def _check_name(kind: str, name: Any) -> None:
    """Check a name that functions read or take.

    Raises:
        ParameterError: it is not the name of a variable.
    """
    if not isinstance(name, str) or not name.isidentifier() or keyword.iskeyword(name):
        raise ParameterError(f"{kind}: expected the name of a variable, got {brief(name)}")


def _is_text_by_name(pair: Any) -> bool:
    """True if something is a name and a text."""
    is_pair = isinstance(pair, tuple) and len(pair) == 2
    return is_pair and all(isinstance(text, str) for text in pair) and bool(pair[0])


Part = TypeVar("Part", bound=type)


def without_scalar(kind: Part) -> Part:
    """Let a class refuse the argument `scalar`, which it had once, in words."""
    made: Any = kind.__init__  # type: ignore[misc]

    @wraps(made)
    def begin(self: Any, *arguments: Any, **named: Any) -> None:
        if "scalar" in named:
            raise UnknownArgumentError(
                f"{kind.__name__}: scalar is gone: write np.where for `if`, and NumPy's functions for those"
                " of `math`"
            )
        made(self, *arguments, **named)

    kind.__init__ = begin  # type: ignore[misc]
    return kind


@dataclass(frozen=True)
class Constant:
    """Constant of a term or an entry, an argument of its function and of `gymnasium.make`.

    Attributes:
        name: name of the function's argument, and in the setting `constants`. Terms and entries with a
            constant of one name share it.
        value: default.
        unit: unit.
        meaning: meaning, for the manual page.
        low, high: smallest and largest value.

    Raises:
        ParameterError: a name that is none of a variable, or a value out of range.
    """

    name: str
    value: float
    unit: str
    meaning: str
    low: float = -LARGEST
    high: float = LARGEST

    def __post_init__(self) -> None:
        _check_name("constant", self.name)
        check_number(f"constant {self.name!r}", self.value, low=self.low, high=self.high)


@dataclass(frozen=True)
class Kept:
    """Number that a term keeps from step to step, a row of `step.episode.own.<term>`.

    Attributes:
        name: name of the row.
        begin: value at the start of an episode.
        unit: unit.
        meaning: meaning, for the manual page.

    Raises:
        ParameterError: a name that is none of a variable, or a value out of range.
    """

    name: str
    begin: float
    unit: str
    meaning: str

    def __post_init__(self) -> None:
        _check_name("kept", self.name)
        check_number(f"kept {self.name!r}", self.begin, low=-LARGEST, high=LARGEST)


def _is_reserved(form: str) -> bool:
    """Return whether a form of actions is one of the package, of now or before."""
    return form in ("rates", "offsets") or form.startswith("offsets of ")


@without_scalar
@dataclass(frozen=True)
class ActionMap:
    """Map from actions of one's own to those of the body.

    Attributes:
        form: tag of the meaning of actions, which states, records and policies contain.
        actions: meaning of each action at 1, by its name; the space is a box from -1 to 1.
        compute: function of the actions, `action[k]` in [-1, 1], and the scene of an entry, which returns a
            tuple with all actions of the body, which are clipped; see `reward.Term.compute`.

    Raises:
        ParameterError: a form that the package has, no actions, or `compute` is not a function of two
            arguments.
    """

    form: str
    actions: Mapping[str, str]
    compute: Callable[[Any, Any], Any]

    def __post_init__(self) -> None:
        if not isinstance(self.form, str) or not self.form or _is_reserved(self.form):
            raise ParameterError(f"action_map: form: expected a text of its own, got {brief(self.form)}")
        # Kernels are found by what they contain, and a mapping has no hash; a copy is given the pairs.
        pairs = tuple(self.actions.items()) if isinstance(self.actions, Mapping) else self.actions
        if not isinstance(pairs, tuple) or not pairs or not all(map(_is_text_by_name, pairs)):
            raise ParameterError(
                f"{self.title}: actions: expected meanings by name, got {brief(self.actions)}"
            )
        object.__setattr__(self, "actions", pairs)
        check_function(f"{self.title}: compute", self.compute, 2)

    @property
    def title(self) -> str:
        """Name of the map in messages."""
        return f"action_map {self.form!r}"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the actions."""
        return tuple(dict(self.actions))


def check_parts(title: str, kind: type[Constant] | type[Kept], parts: Any) -> tuple[Any, ...]:
    """Return constants or rows of a term or entry as a tuple.

    Raises:
        ParameterError: something else, or a name twice.
    """
    given = tuple(parts) if isinstance(parts, (list, tuple)) else (parts,)
    names = [part.name for part in given if isinstance(part, kind)]
    if len(set(names)) < len(given):
        raise ParameterError(
            f"{title}: expected a list of hoof_env.{kind.__name__}, names once, got {brief(parts)}"
        )
    return given


def check_arguments(title: str, function: Any, first: int, constants: tuple[Constant, ...]) -> None:
    """Check that a function takes some arguments, and constants by name behind them.

    Raises:
        ParameterError: it does not.
    """
    check_function(title, function, first + len(constants))
    names = function.__code__.co_varnames[first : first + len(constants)]
    wanted = tuple(constant.name for constant in constants)
    if names != wanted:
        raise ParameterError(
            f"{title}: expected the constants {', '.join(wanted)} as its last arguments, got"
            f" ({', '.join(names)})"
        )


class Own(NamedTuple):
    """Declarations of the terms and entries of a task, on which its memory and its record depend.

    Attributes:
        kept: names of the rows of each term that keeps some, by its name.
        constants: names of all constants.
        taken: names of those that each term and each entry takes; empty without any.
    """

    kept: tuple[tuple[str, tuple[str, ...]], ...] = ()
    constants: tuple[str, ...] = ()
    taken: tuple[tuple[str, ...], ...] = ()

    @property
    def fields(self) -> tuple[Any, ...]:
        """Fields of the task's record."""
        return (("constants", "f8", (len(self.constants),)),) if self.constants else ()


def constants_of(terms: Iterable[Any], entries: Iterable[Any]) -> dict[str, Constant]:
    """Return the constants of terms and entries, by name.

    Raises:
        ParameterError: two of one name differ.
    """
    found: dict[str, Constant] = {}
    for part in (*terms, *entries):
        for constant in part.constants:
            known = found.setdefault(constant.name, constant)
            if known != constant:
                raise ParameterError(
                    f"{part.title}: constant {constant.name!r}: expected that of another term or entry,"
                    f" {known}, got {constant}"
                )
    return found


def own_of(terms: Iterable[Any], entries: Iterable[Any]) -> Own:
    """Return what terms and entries declare."""
    terms = tuple(terms)
    entries = tuple(entries)
    kept = tuple((term.name, tuple(row.name for row in term.keeps)) for term in terms if term.keeps)
    constants = tuple(constants_of(terms, entries))
    taken = tuple(tuple(one.name for one in part.constants) for part in (*terms, *entries))
    return Own(kept, constants, taken if constants else ())


def check_constants(given: Any, known: Mapping[str, Constant]) -> list[float]:
    """Return the values of all constants, in order.

    Args:
        given: the setting `constants`, values by name; None for the defaults.
        known: constants of the task.

    Raises:
        ParameterError: an unknown constant, or a value out of range.
    """
    changes = {} if given is None else given
    if not isinstance(changes, Mapping) or not set(changes) <= set(known):
        names = f"some of {', '.join(known)}" if known else "none, as no term or entry has one"
        raise ParameterError(f"constants: expected a mapping with {names}, got {brief(given)}")
    return [
        check_number(
            f"constants[{name!r}]", changes.get(name, constant.value), low=constant.low, high=constant.high
        )
        for name, constant in known.items()
    ]

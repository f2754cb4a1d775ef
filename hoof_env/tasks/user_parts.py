"""Constants and state that terms and entries declare, and maps from user-defined actions to body actions."""

from __future__ import annotations

import keyword
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from hoof_env.errors import ParameterError, brief, check_number
from hoof_env.simd.user_functions import check_function

MAX_VALUE = 1e12
"""Largest absolute value of a constant, and of a row at a start."""


def _check_name(kind: str, name: Any) -> None:
    """Check a name that functions read or take.

    Raises:
        ParameterError: it is not the name of a variable.
    """
    if not isinstance(name, str) or not name.isidentifier() or keyword.iskeyword(name):
        raise ParameterError(f"{kind}: expected the name of a variable, got {brief(name)}")


def _is_text_by_name(pair: Any) -> bool:
    """Return whether a pair is a name and a text."""
    is_pair = isinstance(pair, tuple) and len(pair) == 2
    return is_pair and all(isinstance(text, str) for text in pair) and bool(pair[0])


@dataclass(frozen=True)
class Constant:
    """Constant of a term or an entry, an argument of its function and of `gymnasium.make`.

    Attributes:
        name: name of the function's argument, and in the setting `constants`. Terms and entries with a
            constant of the same name share it.
        value: default.
        unit: unit.
        meaning: meaning, for the manual page.
        low, high: smallest and largest value.

    Raises:
        ParameterError: the name is not an identifier, or a value out of range.
    """

    name: str
    value: float
    unit: str
    meaning: str
    low: float = -MAX_VALUE
    high: float = MAX_VALUE

    def __post_init__(self) -> None:
        _check_name("constant", self.name)
        check_number(f"constant {self.name!r}", self.value, low=self.low, high=self.high)


@dataclass(frozen=True)
class TermState:
    """Number that a term carries from step to step, a row of `step.episode.own.<term>`.

    Attributes:
        name: name of the row.
        initial: value at the start of an episode.
        unit: unit.
        meaning: meaning, for the manual page.

    Raises:
        ParameterError: the name is not an identifier, or a value out of range.
    """

    name: str
    initial: float
    unit: str
    meaning: str

    def __post_init__(self) -> None:
        _check_name("state", self.name)
        check_number(f"state {self.name!r}", self.initial, low=-MAX_VALUE, high=MAX_VALUE)


def _is_reserved(form: str) -> bool:
    """Return whether the package uses a form of actions, or used it before."""
    return form in ("rates", "offsets") or form.startswith("offsets of ")


@dataclass(frozen=True)
class ActionMap:
    """Map from user-defined actions to body actions.

    Attributes:
        form: tag of the meaning of actions, which states, records and policies contain.
        actions: meaning of each action at 1, by its name; the space is a box from -1 to 1.
        compute: function of the actions, `action[k]` in [-1, 1], and the scene of an entry, which returns a
            tuple with all actions of the body, which are clipped; see `reward.Term.compute`.

    Raises:
        ParameterError: a form of the package, no actions, or `compute` is not a function of two
            arguments.
    """

    form: str
    actions: Mapping[str, str]
    compute: Callable[[Any, Any], Any]

    def __post_init__(self) -> None:
        if not isinstance(self.form, str) or not self.form or _is_reserved(self.form):
            raise ParameterError(f"action_map: form: expected a name of its own, got {brief(self.form)}")
        # Kernels are looked up by a hash of their parts, and a mapping has none; a copy is made of pairs.
        pairs = tuple(self.actions.items()) if isinstance(self.actions, Mapping) else self.actions
        if not isinstance(pairs, tuple) or not pairs or not all(map(_is_text_by_name, pairs)):
            raise ParameterError(
                f"{self.title}: actions: expected a mapping of names to meanings, got {brief(self.actions)}"
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


def check_parts(title: str, kind: type[Constant] | type[TermState], parts: Any) -> tuple[Any, ...]:
    """Return the constants or the state of a term or entry as a tuple.

    Raises:
        ParameterError: an element of another class, or a name twice.
    """
    given = tuple(parts) if isinstance(parts, (list, tuple)) else (parts,)
    names = [part.name for part in given if isinstance(part, kind)]
    if len(set(names)) < len(given):
        raise ParameterError(
            f"{title}: expected a list of hoof_env.{kind.__name__}, each name once, got {brief(parts)}"
        )
    return given


def check_arguments(title: str, function: Any, first: int, constants: tuple[Constant, ...]) -> None:
    """Check that the last arguments of a function are its constants, by name and in order.

    Args:
        title: name of the function in messages.
        function: the function.
        first: number of arguments before the constants.
        constants: the declared constants.

    Raises:
        ParameterError: they are not.
    """
    check_function(title, function, first + len(constants))
    names = function.__code__.co_varnames[first : first + len(constants)]
    wanted = tuple(constant.name for constant in constants)
    if names != wanted:
        raise ParameterError(
            f"{title}: expected the constants {', '.join(wanted)} as its last arguments, got"
            f" ({', '.join(names)})"
        )


class Declarations(NamedTuple):
    """Declarations of the terms and entries of a task, on which its memory and its record depend.

    Attributes:
        state: names of the numbers in each term's state, by the term's name.
        constants: names of all constants.
        arguments: names of the constants that each term and each entry takes; empty without constants.
    """

    state: tuple[tuple[str, tuple[str, ...]], ...] = ()
    constants: tuple[str, ...] = ()
    arguments: tuple[tuple[str, ...], ...] = ()

    @property
    def fields(self) -> tuple[Any, ...]:
        """Fields of the task's record."""
        return (("constants", "f8", (len(self.constants),)),) if self.constants else ()


def constants_of(terms: Iterable[Any], entries: Iterable[Any]) -> dict[str, Constant]:
    """Return the constants of terms and entries, by name.

    Raises:
        ParameterError: two constants of the same name differ.
    """
    found: dict[str, Constant] = {}
    for part in (*terms, *entries):
        for constant in part.constants:
            known = found.setdefault(constant.name, constant)
            if known != constant:
                raise ParameterError(
                    f"{part.title}: constant {constant.name!r}: expected the one of another term or entry,"
                    f" {known}, got {constant}"
                )
    return found


def declared_by(terms: Iterable[Any], entries: Iterable[Any]) -> Declarations:
    """Return the declarations of terms and entries."""
    terms = tuple(terms)
    entries = tuple(entries)
    state = tuple((term.name, tuple(row.name for row in term.state)) for term in terms if term.state)
    constants = tuple(constants_of(terms, entries))
    arguments = tuple(tuple(one.name for one in part.constants) for part in (*terms, *entries))
    return Declarations(state, constants, arguments if constants else ())


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

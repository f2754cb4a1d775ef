"""Errors name what came and what was expected, and an exception is of the kind a caller would catch."""

from decimal import Decimal
from fractions import Fraction

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hoof_env import Terrain
from hoof_env.errors import (
    MAX_LETTERS,
    MAX_LINES,
    MIN_POSITIVE,
    DataFileError,
    GeometryError,
    HoofEnvError,
    MissingExtraError,
    OutputError,
    ParameterError,
    brief,
    check_choice,
    check_number,
    finite,
    parse_pairs,
)

numbers = st.floats(allow_nan=True, allow_infinity=True) | st.integers()


@given(value=numbers, bounds=st.tuples(st.integers(-9, 9), st.integers(-9, 9)), exclusive=st.booleans())
@example(value=2e-296, bounds=(0, 1), exclusive=True)
@settings(deadline=None)
def test_a_number_is_returned_or_named(value, bounds, exclusive):
    low, high = sorted(bounds)
    fits = -1e300 < value < 1e300 and low <= value <= high and not (exclusive and value == low)
    if fits and exclusive and low == 0 and value < MIN_POSITIVE:
        with pytest.raises(ParameterError, match=f"^x: expected {MIN_POSITIVE:g} or more, got {value!r}$"):
            check_number("x", value, low=low, high=high, exclusive_low=exclusive)
    elif fits:
        result = check_number("x", value, low=low, high=high, exclusive_low=exclusive)
        assert type(result) is float
        assert result == value
    else:
        with pytest.raises(ParameterError) as error:
            check_number("x", value, low=low, high=high, exclusive_low=exclusive)
        message, bracket = str(error.value), "(" if exclusive else "["
        assert message.startswith("x: expected ")
        assert message.endswith(f" {bracket}{low}, {high}], got {value!r}")


@pytest.mark.parametrize(
    "value",
    [
        True, False, np.True_, np.array(True), b"1", "1", "one", bytearray(b"1"), memoryview(b"1"),
        np.str_("1"), np.array("1"), None, [1], (), {}, 1j, np.complex128(1), np.zeros(1), np.zeros(2),
        10**400, np.nan, np.timedelta64(1, "s"),
    ],
)  # fmt: skip
def test_a_value_other_than_a_number_is_refused(value):
    with pytest.raises(ParameterError, match=r"x: expected a finite number in \[-inf, inf\], got "):
        check_number("x", value)


@pytest.mark.parametrize("value", [np.float32(0.5), np.int64(3), 2, Decimal("0.25"), np.array(3)])
def test_other_kinds_of_number_are_taken(value):
    assert check_number("x", value) == float(value)


@pytest.mark.parametrize(
    "value",
    [
        True, [True, False], np.ones(2, bool), "1", ["1", "2"], np.array(["1"]), [Fraction(1, 2), "1"],
        [Fraction(1, 2), True], 1j, [1j, 0.0], np.ones(2, complex), [None, 1.0], {}, [[1.0], [1.0, 2.0]],
        [np.nan], np.inf, 10**400, [10**400, 1],
    ],
)  # fmt: skip
def test_values_other_than_numbers_are_refused(value):
    with pytest.raises(ParameterError, match="x: expected finite numbers, got "):
        finite("x", value)


@pytest.mark.parametrize(
    "value", [3, [1, 2.5], [], np.ones((2, 3), np.int8), [Fraction(1, 2), 1], [10**30, 1]]
)
def test_numbers_become_doubles(value):
    numbers = finite("x", value)
    assert numbers.dtype == np.float64
    assert (numbers == np.array(value, float)).all()


def test_a_choice_is_returned_or_named():
    assert check_choice("way", "left", {"right": 1, "left": 2}) == "left"
    for value in ("up", None, 3, ["left"]):
        with pytest.raises(ParameterError) as error:
            check_choice("way", value, ("right", "left"))
        assert str(error.value).startswith("way: expected ")
        assert str(error.value).endswith(f"left, right, got {value!r}")


def test_every_error_is_ours_and_of_a_common_kind():
    kinds = {ParameterError: ValueError, GeometryError: ParameterError, DataFileError: ValueError}
    for error, also in (kinds | {OutputError: OSError}).items():
        assert issubclass(error, HoofEnvError)
        assert issubclass(error, also)


DEEP = "[" * 30000 + "]" * 30000


@pytest.mark.parametrize("item", [f"terrain={DEEP}", '{"a":' * 30000 + "1" + "}" * 30000])
def test_deep_nesting_is_refused_in_few_words(item):
    with pytest.raises(ParameterError, match="nested too deep") as refused:
        parse_pairs("--env-kwargs", [item])
    assert len(str(refused.value)) < 500


def test_a_positive_number_is_not_so_small_that_quotients_overflow():
    with pytest.raises(ParameterError, match="mass: expected 1e-12 or more, got 5e-324"):
        check_number("mass", 5e-324, low=0, exclusive_low=True)
    assert check_number("mass", 1e-12, low=0, exclusive_low=True) == 1e-12
    assert check_number("speed", 5e-324, low=0) == 5e-324


class Large:
    """Object whose text is long."""

    def __repr__(self):
        return f"Large({'0.5, ' * 100_000})"


class Broken:
    """Object without a text."""

    def __repr__(self):
        raise RuntimeError


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (3, "3"), ("run", "'run'"), ([1, 2.5], "[1, 2.5]"), (None, "None"),
        (np.eye(2), "array([[1., 0.], [0., 1.]])"),
        (Large(), "Large(...)"), (Broken(), "Broken(...)"), ([Large()], "[Large(...)]"),
        ({"terrain": Large()}, "{'terrain': Large(...)}"), ([0.5] * 1000, "[0.5, 0.5, 0.5, 0.5, ...]"),
        (np.zeros((50, 40)) + np.arange(40), "array of shape (50, 40)"),
        ([[1.5] * 500] * 2, "[[1.5, 1.5, 1.5, 1.5, ...], [1.5, 1.5, 1.5, 1.5, ...]]"),
    ],
)  # fmt: skip
def test_a_value_is_shown_briefly_and_a_large_object_named(value, text):
    assert brief(value) == text


@pytest.mark.parametrize(
    "kind", [HoofEnvError, ParameterError, DataFileError, OutputError, MissingExtraError]
)
def test_a_message_has_an_end_and_no_control_characters(kind):
    long = str(kind(f"begin {'x' * 600_000} remedy"))
    assert len(long) <= MAX_LETTERS
    assert long.startswith("begin x")
    assert long.endswith("x remedy")
    lines = str(kind("\n".join(f"line {k}" for k in range(1000)))).split("\n")
    assert len(lines) == MAX_LINES
    assert (lines[0], lines[-1]) == ("line 0", "line 999")
    assert str(kind("record \x1b[31mred\x9b.csv, \udcff: a\nb")) == (
        "record \\x1b[31mred\\x9b.csv, \\udcff: a\nb"
    )
    assert str(kind("speed: expected 1, got 2")) == "speed: expected 1, got 2"


def test_what_gymnasium_adds_to_a_message_is_left_out():
    terrain = Terrain(height=tuple(0.001 * (k % 7) for k in range(20_000)), spacing=0.01)
    with pytest.raises(ParameterError) as refused:
        gym.make("hoof_env/HorseLeg-v0", terain=terrain)
    assert str(refused.value).endswith("unexpected keyword argument 'terain'; did you mean terrain?")

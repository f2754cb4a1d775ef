"""Planar vectors in the engine's arrays, a complex number in two rows; and sums of whole rows.

Rows are named by constants, one loop a row: where a row number is computed, a loop over the lanes may stay scalar.
"""

from __future__ import annotations

from hoof_env._jit import inlined


@inlined
def vector(rows, name, lane):  # type: ignore[no-untyped-def]
    """The vector kept in rows `name` and `name + 1`."""
    return complex(rows[name, lane], rows[name + 1, lane])


@inlined
def put(rows, name, lane, z):  # type: ignore[no-untyped-def]
    """Keep a vector in rows `name` and `name + 1`."""
    rows[name, lane] = z.real
    rows[name + 1, lane] = z.imag


@inlined
def times(k, z):  # type: ignore[no-untyped-def]
    """k z for a real k, without the products by zero that complex multiplication would make of it."""
    return complex(k * z.real, k * z.imag)


@inlined
def across(z):  # type: ignore[no-untyped-def]
    """The vector turned left by a right angle, i z, without the products by zero."""
    return complex(-z.imag, z.real)


@inlined
def set_row(rows, to, start, factor, slope):  # type: ignore[no-untyped-def]
    """rows[to] = rows[start] + factor rows[slope]."""
    for lane in range(rows.shape[1]):
        rows[to, lane] = rows[start, lane] + factor * rows[slope, lane]


@inlined
def set_four_rows(rows, to, start, factor, slope):  # type: ignore[no-untyped-def]
    """`set_row` for four rows from each of these on."""
    set_row(rows, to, start, factor, slope)
    set_row(rows, to + 1, start + 1, factor, slope + 1)
    set_row(rows, to + 2, start + 2, factor, slope + 2)
    set_row(rows, to + 3, start + 3, factor, slope + 3)


@inlined
def set_six_rows(rows, to, start, factor, slope):  # type: ignore[no-untyped-def]
    """`set_row` for six rows from each of these on."""
    set_four_rows(rows, to, start, factor, slope)
    set_row(rows, to + 4, start + 4, factor, slope + 4)
    set_row(rows, to + 5, start + 5, factor, slope + 5)


@inlined
def fill_row(rows, name, value):  # type: ignore[no-untyped-def]
    """rows[name] = value."""
    for lane in range(rows.shape[1]):
        rows[name, lane] = value


@inlined
def copy_row(rows, to, start):  # type: ignore[no-untyped-def]
    """rows[to] = rows[start]."""
    for lane in range(rows.shape[1]):
        rows[to, lane] = rows[start, lane]


@inlined
def add_row(rows, to, others, name):  # type: ignore[no-untyped-def]
    """rows[to] += others[name]."""
    for lane in range(rows.shape[1]):
        rows[to, lane] += others[name, lane]

"""Planar vectors in the engine's arrays, a complex number in two rows; and sums of whole rows.

Rows are named by constants: a loop over lanes may stay scalar where a row's number is computed, or where it
is so short that the compiler unrolls it.
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
def set_six(rows, to, start, factor, slope, lane):  # type: ignore[no-untyped-def]
    """rows[to + k] = rows[start + k] + factor rows[slope + k] for k below 6, in one lane."""
    rows[to, lane] = rows[start, lane] + factor * rows[slope, lane]
    rows[to + 1, lane] = rows[start + 1, lane] + factor * rows[slope + 1, lane]
    rows[to + 2, lane] = rows[start + 2, lane] + factor * rows[slope + 2, lane]
    rows[to + 3, lane] = rows[start + 3, lane] + factor * rows[slope + 3, lane]
    rows[to + 4, lane] = rows[start + 4, lane] + factor * rows[slope + 4, lane]
    rows[to + 5, lane] = rows[start + 5, lane] + factor * rows[slope + 5, lane]


@inlined
def gather_row(rows, to, legs, name, weight, together):  # type: ignore[no-untyped-def]
    """rows[to] += weight legs[name]: lane by lane, or, where the lanes are the legs of one trunk, all of them
    one after the other, as in a loop over legs."""
    if together:
        total = rows[to, 0]
        for lane in range(legs.shape[1]):
            total += weight * legs[name, lane]
        for lane in range(legs.shape[1]):
            rows[to, lane] = total
    else:
        for lane in range(legs.shape[1]):
            rows[to, lane] += weight * legs[name, lane]

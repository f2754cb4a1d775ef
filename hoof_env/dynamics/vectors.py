"""Planar vectors in the engine's arrays: a complex number in two rows."""

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
def across(z):  # type: ignore[no-untyped-def]
    """The vector turned left by a right angle, i z, without the products by zero."""
    return complex(-z.imag, z.real)

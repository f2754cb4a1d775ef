"""Planar vectors in rows of memory, two rows a vector; and sums over the legs of a trunk."""

from __future__ import annotations

from hoof_env.simd import lane_sum, plane
from hoof_env.simd.compile import inlined


@inlined
def vector(rows, name):  # type: ignore[no-untyped-def]
    """The vector kept in rows `name` and `name + 1`."""
    return plane(rows[name], rows[name + 1])


@inlined
def put(rows, name, z):  # type: ignore[no-untyped-def]
    """Keep a vector in rows `name` and `name + 1`."""
    rows[name] = z.real
    rows[name + 1] = z.imag


@inlined
def add(rows, name, x, together):  # type: ignore[no-untyped-def]
    """rows[name] += x, lane by lane; or, where the lanes are the legs of one trunk, all of them one after the
    other, as in a loop over legs."""
    if together:
        rows[name] = lane_sum(rows[name], x)
    else:
        rows[name] = rows[name] + x


@inlined
def add_vector(rows, name, z, together):  # type: ignore[no-untyped-def]
    """`add` for a vector."""
    add(rows, name, z.real, together)
    add(rows, name + 1, z.imag, together)

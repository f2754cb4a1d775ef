"""Imports of a process before it is copied: numba, with its compiler set up by a first function."""

import numba

import hoof_env.simd.compile  # noqa: F401

numba.njit(error_model="numpy")(lambda x: x + 1.0)(1.0)

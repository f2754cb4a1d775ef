"""Random numbers of kernels: those of splitmix64, in any lane, and spread as uniform numbers are."""

from __future__ import annotations

import struct

import numpy as np
from scipy import stats

from hoof_env.simd import full_like, read, rows, write
from hoof_env.simd.compile import kernel
from hoof_env.simd.memory import address, doubles
from hoof_env.simd.noise import uniform

LANES = 8


def draw_one(keys, counts, out):
    memory = rows(doubles(1), 1, None)
    for row in range(keys.shape[0]):
        key, count = read(memory, address(keys), row, 1), read(memory, address(counts), row, 1)
        for k in range(out.shape[1]):
            write(uniform(key, count, k), address(out), row * out.shape[1] + k, 1)


def draw_lanes(keys, counts, out):
    memory = rows(doubles(LANES), LANES, None)
    width = out.shape[1]
    for row in range(0, keys.shape[0], LANES):
        key, count = read(memory, address(keys), row, 1), read(memory, address(counts), row, 1)
        for k in range(width):
            write(uniform(full_like(memory, key), count, k), address(out), row * width + k, width)


draw_one, draw_lanes = kernel(draw_one), kernel(draw_lanes)


def mixed(z):
    """The output function of splitmix64, as published."""
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & (2**64 - 1)
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & (2**64 - 1)
    return z ^ (z >> 31)


def expected(key, count, number):
    bits = [int.from_bytes(struct.pack("<d", x), "little") for x in (key, count)]
    seed = mixed((bits[0] + mixed(bits[1])) & (2**64 - 1))
    drawn = mixed((seed + (number + 1) * 0x9E3779B97F4A7C15) & (2**64 - 1))
    return 2 * (drawn >> 12) / 2**52 - 1


def drawn(n, width, seed=0):
    keys = np.random.default_rng(seed).random(n)
    counts = np.arange(n, dtype=np.float64) // 3
    one, many = np.zeros((n, width)), np.zeros((n, width))
    draw_one(keys, counts, one)
    draw_lanes(keys, counts, many)
    assert one.tobytes() == many.tobytes()
    return keys, counts, one


def test_they_are_those_of_splitmix64():
    keys, counts, found = drawn(64, 9)
    wanted = [[expected(key, count, k) for k in range(9)] for key, count in zip(keys, counts, strict=True)]
    assert np.array_equal(found, wanted)


def test_they_are_uniform_and_independent_of_their_neighbours():
    n = 8000
    _, _, found = drawn(n, 8)
    for numbers in (*found.T, *found[:8]):
        assert stats.kstest(numbers, "uniform", (-1, 2)).pvalue > 1e-4
    correlation = np.corrcoef(found.T) - np.eye(8)
    assert abs(correlation).max() < 5 / np.sqrt(n)
    # One key over time, as of an episode: not the neighbours of one another.
    times = np.arange(n, dtype=np.float64)
    episode = np.zeros((n, 2))
    draw_one(np.full(n, 0.37), times, episode)
    series = episode[:, 0]
    assert abs(np.corrcoef(series[1:], series[:-1])[0, 1]) < 5 / np.sqrt(n)
    assert stats.kstest(series, "uniform", (-1, 2)).pvalue > 1e-4

"""Random numbers of kernels: the bits of splitmix64, in any lane, uniformly distributed."""

from __future__ import annotations

import struct

import numpy as np
from scipy import stats

from hoof_env.simd import Matrix, full, loop, read, write
from hoof_env.simd.compile import kernel
from hoof_env.simd.noise import uniform

LANES = 8


def drawing(lanes, width):
    """A kernel that draws for each key and count `width` numbers, for `lanes` rows at a time."""

    @kernel
    def draw(keys: Matrix, counts: Matrix, out: Matrix) -> None:
        for row in loop(0, keys.shape[0], lanes):
            key, count = read(keys.first, row, 1, lanes), read(counts.first, row, 1, lanes)
            for k in range(width):
                write(uniform(key, count, k), out.first, row * width + k, width)

    return draw


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
    drawing(1, width)(keys, counts, one)
    drawing(LANES, width)(keys, counts, many)
    assert one.tobytes() == many.tobytes()
    few = np.zeros((64, width))
    drawing(LANES, width).run_now(keys[:64], counts[:64], few)
    assert few.tobytes() == one[:64].tobytes()
    return keys, counts, one


def test_numbers_agree_with_splitmix64():
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
    drawing(1, 2)(np.full(n, 0.37), times, episode)
    series = episode[:, 0]
    assert abs(np.corrcoef(series[1:], series[:-1])[0, 1]) < 5 / np.sqrt(n)
    assert stats.kstest(series, "uniform", (-1, 2)).pvalue > 1e-4


def test_a_count_may_be_one_for_all_lanes():
    @kernel
    def draw(keys: Matrix, count: Matrix, out: Matrix) -> None:
        shared = read(count.first, 0, 1, 0)
        key = read(keys.first, 0, 1, LANES)
        write(uniform(key, shared, 3), out.first, 0, 1)
        write(uniform(key, full(shared, LANES), 3), out.first, LANES, 1)

    keys, out = np.random.default_rng(5).random(LANES), np.zeros((2, LANES))
    draw(keys, np.array([7.0]), out)
    assert out[0].tolist() == out[1].tolist() == [expected(key, 7.0, 3) for key in keys]

"""Which sets of kernels stay in memory, and that threads may ask for them."""

from __future__ import annotations

import gc
import sys
import threading
import weakref

import pytest

from hoof_env.simd.kept import MOST, Kept, Kernels


def test_what_is_from_outside_goes_once_nothing_uses_it_but_for_the_last():
    kept, made = Kept(), [0]

    def make():
        made[0] += 1
        return Kernels()

    ours = weakref.ref(kept.get("ours", make, False))
    refs = [weakref.ref(kept.get(key, make, True)) for key in range(MOST + 3)]
    gc.collect()
    assert [one() is not None for one in refs] == [False] * 3 + [True] * MOST
    assert ours() is kept.get("ours", make, False)
    assert refs[-1]() is kept.get(MOST + 2, make, True)
    assert made[0] == MOST + 4
    in_use = kept.get("used", make, True)
    for key in range(MOST + 3):
        kept.get(key, make, True)
    assert kept.get("used", make, True) is in_use


@pytest.mark.parametrize("from_outside", [False, True])
def test_threads_that_ask_at_once_get_the_same_set(from_outside):
    """Without a lock two threads make a set each, and one takes from the row of the last what another has
    taken."""
    kept, errors, switch = Kept(), [], sys.getswitchinterval()
    made: dict[int, int] = dict.fromkeys(range(8), 0)
    found: list[list] = [[] for _ in range(8)]
    gate = threading.Barrier(6)

    def make(key):
        made[key] += 1
        return Kernels(key=key)

    def ask():
        try:
            gate.wait()
            for turn in range(300):
                key = turn % 8
                found[key].append(kept.get(key, lambda key=key: make(key), from_outside))
        except Exception as error:
            errors.append(error)

    threads = [threading.Thread(target=ask) for _ in range(6)]
    sys.setswitchinterval(1e-6)
    try:
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    finally:
        sys.setswitchinterval(switch)
    assert errors == []
    assert set(made.values()) == {1}  # `found` uses all of them
    assert all(one is row[0] for row in found for one in row)

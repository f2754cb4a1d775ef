"""The garbage collector is off while libraries are loaded, and afterwards works as before."""

import gc
import weakref

import pytest

from hoof_env._collector import MANY, paused


class Node:
    """An object that refers to itself: only the collector can free it."""

    def __init__(self):
        self.me = self


@pytest.fixture
def thawed():
    """Nothing is frozen, as in a user's process; what tests have frozen is frozen again."""
    frozen = gc.get_freeze_count()
    gc.unfreeze()
    gc.collect()
    yield
    if frozen:
        gc.freeze()


def test_it_is_off_and_on_again_even_after_an_error():
    with paused():
        assert not gc.isenabled()
    assert gc.isenabled()
    with pytest.raises(KeyError), paused():
        raise KeyError
    assert gc.isenabled()
    gc.disable()
    try:
        with paused():
            pass
        assert not gc.isenabled()  # as it was
    finally:
        gc.enable()


def test_many_objects_become_old_without_a_look_at_them(thawed):
    looked = []
    gc.callbacks.append(lambda phase, info: looked.append(info["generation"]))
    try:
        with paused():
            kept = [[] for _ in range(2 * MANY)]
        assert len(kept) == 2 * MANY
        assert 2 not in looked
    finally:
        gc.callbacks.pop()
    assert not gc.get_freeze_count()
    assert any(kept[-1] is one for one in gc.get_objects(generation=2))


def test_garbage_is_found_by_a_full_collection_after_a_pause(thawed):
    with paused():
        node = weakref.ref(Node())
        kept = [[] for _ in range(2 * MANY)]
    assert kept
    assert node() is not None
    gc.collect()
    assert node() is None


def test_few_objects_stay_young_and_what_is_frozen_stays_frozen(thawed):
    with paused():
        young = []
    assert not any(young is one for one in gc.get_objects(generation=2))
    gc.freeze()
    before = gc.get_freeze_count()
    try:
        with paused():
            kept = [[] for _ in range(2 * MANY)]
        assert kept
        assert gc.get_freeze_count() >= before - 100
    finally:
        gc.unfreeze()

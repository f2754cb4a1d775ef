"""Environments on several threads: errors, forks, interrupts; their bits are in `test_bits.py`."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import textwrap

import gymnasium as gym
import numpy as np
import pytest
from family import actions, same

from hoof_env.errors import ParameterError
from hoof_env.simd import threads

LEG = "hoof_env/HorseLeg-v0"


@pytest.fixture(autouse=True)
def many_processors(monkeypatch):
    monkeypatch.setattr(threads, "available", lambda: 8)


def make(n, num_threads, env_id=LEG, **settings):
    return gym.make_vec(env_id, num_envs=n, num_threads=num_threads, episode_seconds=0.3, **settings)


def _actions(envs, seed, steps):
    return actions(seed, steps, envs.num_envs, env_id=envs.unwrapped.task.id)


def rolled(envs, steps=40, seed=1):
    """All that a rollout gives; episodes end and begin in it."""
    return [envs.step(taken) for taken in _actions(envs, seed, steps)]


def test_a_bad_action_stops_all_blocks():
    envs = make(40, 4).unwrapped
    envs.reset(seed=0)
    before = envs.get_state()
    envs.batch.rows.actions[:] = 0.0
    envs.batch.rows.actions[39, 2] = np.nan  # of the last block alone
    with pytest.raises(ParameterError, match="finite"):
        envs.batch.step(envs._generators.all)
    same(envs.get_state(), before)


def test_a_copy_has_no_more_threads_than_there_are_processors(monkeypatch):
    envs = make(40, 4).unwrapped
    envs.reset(seed=4)
    kept = pickle.dumps(envs)
    monkeypatch.setattr(threads, "available", lambda: 3)
    assert pickle.loads(kept).engine.num_threads == 3
    same(rolled(pickle.loads(kept)), rolled(envs))


def in_a_process(n, program):
    """Run a program with `envs`, n environments on two threads that have been reset, in a process of its
    own."""
    begin = f"""
        import os, signal, sys, threading, time, warnings
        sys.path.insert(0, "tests/envs")
        import gymnasium as gym, hoof_env
        from hoof_env.simd import threads
        threads.available = lambda: 2
        from family import actions, same
        envs = gym.make_vec("{LEG}", num_envs={n}, num_threads=2).unwrapped
        envs.reset(seed=0)
    """
    code = textwrap.dedent(begin) + textwrap.dedent(program)
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_a_forked_process_has_threads_of_its_own():
    """Its parent's are not in it; a pool that it thought it had would never answer."""
    in_a_process(
        40,
        """
        envs.step(actions(0, 40))
        kept = envs.get_state()
        expected = envs.step(actions(1, 40))
        envs.set_state(kept)
        warnings.simplefilter("ignore", DeprecationWarning)  # fork beside threads
        child = os.fork()
        same(envs.step(actions(1, 40)), expected)
        sys.exit(child and os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
        """,
    )


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT to send")
def test_an_interrupt_leaves_an_environment_that_goes_on():
    """Ctrl-C between and in steps: whenever it comes, a state is put back and goes on to the same bits."""
    in_a_process(
        400,
        """
        kept, taken = envs.get_state(), actions(1, 400)
        expected = envs.step(taken)
        heard = 0
        for k in range(20):
            threading.Timer(0.01 + 0.001 * k, os.kill, (os.getpid(), signal.SIGINT)).start()
            try:
                begun = time.monotonic()
                while time.monotonic() < begun + 10.0:
                    envs.step(taken)
            except KeyboardInterrupt:
                heard += time.monotonic() < begun + 2.0
            envs.set_state(kept)
            same(envs.step(taken), expected)
        sys.exit(heard != 20)
        """,
    )

"""What the tests of `Horse-v0` share."""

import gymnasium as gym
import numpy as np
from family import HORSE

from hoof_env.tasks.horse_gaits import FASTEST, LIMITS, Stride, reference_gaits

SPEEDS = (1.853, 2.62)  # Froude numbers 0.25 and 0.5
SEEDS = 40


def random_gaits(n, seed=0):
    """Some that a search might try."""
    rng = np.random.default_rng(seed)
    gaits = np.tile(reference_gaits(np.array([1.85]))[0], (n, 1))
    low, high = np.transpose([(0.1, FASTEST), (-10.0, 10.0), *[*LIMITS.values()] * 2])
    return np.clip(gaits + rng.uniform(-0.05, 0.05, gaits.shape), low, high)


def played(act, **settings):
    """Returns and summaries of `SEEDS` episodes of ten seconds side by side."""
    envs = gym.make_vec(HORSE, num_envs=SEEDS, autoreset_mode="SAME_STEP", **settings)
    seen, _ = envs.reset(seed=0)
    total, ended, found = np.zeros(SEEDS), np.zeros(SEEDS, bool), [None] * SEEDS
    for step in range(500):
        taken = np.broadcast_to(np.asarray(act(seen, 0.02 * step), np.float32), (SEEDS, 16))
        seen, rewards, failed, truncated, infos = envs.step(taken)
        total += np.where(ended, 0.0, rewards)
        for env in np.flatnonzero((failed | truncated) & ~ended):
            figures = infos["final_info"]["episode_summary"]
            found[env] = {name: figures[name][env] for name in figures if not name.startswith("_")}
        ended |= failed | truncated
    return total, found


def die(seen, time):
    """The fore legs folded: the sooner it falls, the less else it pays."""
    action = np.zeros((4, 4))
    action[:2] = (1.0, -1.0, -1.0, 1.0)
    return action.ravel()


def stride_phases(env):
    """Phases of the legs in the stride of the gait that the kernels follow, without the footfall, as complex
    numbers of size 1."""
    theta, gait = env.engine.state["crank_angle"][:, 0], env.batch.rows.named.gait[:, 0]
    found = []
    for i in range(4):
        first = 2 + 7 * (i // 2)
        stride, lead = Stride(*gait[first : first + 2]), gait[1] * (i < 2)
        phase, begin = (complex(*stride.phase(np.cos(x), np.sin(x))) for x in (theta[i], 0.0))
        found.append(phase / begin * np.exp(-2j * np.pi * lead) * (-1) ** i)
    return np.array(found)

"""A leg that carries itself: it hops on a boom, and stock PPO learns to hop in 150,000 steps.

python examples/hop.py                           train PPO for two minutes, and play 100 episodes
python examples/hop.py --steps 0                 play the zero action, the gait in which an episode begins
python examples/hop.py --seed 1 --blind          train an agent that sees crank and gait alone

docs/hop.md says why it is made like this.
"""

import argparse

import gymnasium as gym
import numpy as np
import torch
from stable_baselines3 import PPO

import hoof_env

HOP = hoof_env.GaitParameters(crank_speed=9.66, swing_offset=1.02, swing_sin=0.158, swing_cos=-0.49)
"""Gait at the apex of a hop, the mean of 133 apexes of a gait that was found by search."""

hoof_env.register(
    "my_lab/Hop-v0",
    base="leg",
    trunk="boom",
    drive="motor",
    # Hard ground, into which a sole sinks by 1 cm, and a pastern of 0.25 m on a spring.
    stiffness=2e6,
    exponent=1.5,
    hoof_stiffness=4200.0,
    hoof_damping=104.0,
    hoof_length=0.25,
    crank_rate=20.0,
    swing_rate=3.0,
    reward_weights={"progress": 10.0, "peak": 1.0, "loading": 20.0, "failure": 5.0, "support": 0.0},
    start={"gait": HOP, "crank_angle": (3.0, 3.7), "height": (1.95, 2.15), "speed": (0.0, 4.0)},
)

EPISODES = 100
BLIND = ("crank", "gait")


def play(policy, **kwargs):
    """Return the summaries of `EPISODES` episodes, and their returns."""
    envs = gym.make_vec("my_lab/Hop-v0", num_envs=EPISODES, **kwargs)
    observations, _ = envs.reset(seed=1000)
    returns, running, ends = np.zeros(EPISODES), np.ones(EPISODES, bool), []
    while running.any():
        actions = policy(observations)
        observations, rewards, terminated, truncated, infos = envs.step(actions)
        returns += rewards * running
        for i in np.flatnonzero(running & (terminated | truncated)):
            told = infos["episode_summary"]
            ends.append({name: told[name][i] for name in told if not name.startswith("_")})
            ends[-1]["fell"] = float(terminated[i])
        running &= ~(terminated | truncated)
    return ends, returns


def main():
    """Train, play and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=150_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--blind", action="store_true", help="observe crank and gait alone")
    given = parser.parse_args()
    kwargs = {"observation": BLIND} if given.blind else {}
    torch.set_num_threads(1)  # small networks are fastest so
    agent = PPO("MlpPolicy", gym.make("my_lab/Hop-v0", **kwargs), seed=given.seed, device="cpu")
    if given.steps:
        agent.learn(given.steps)
    trained = (lambda seen: agent.predict(seen, deterministic=True)[0]) if given.steps else None
    ends, returns = play(trained or (lambda seen: np.zeros((len(seen), 4), np.float32)), **kwargs)
    mean = {name: np.mean([end[name] for end in ends]) for name in ("fell", "speed_m_s", "duty_factor")}
    stances = [end for end in ends if end["stances"]]
    weight = gym.make("my_lab/Hop-v0").unwrapped.weight
    peak = np.mean([end["stance_peak_sum_n"] / end["stances"] for end in stances]) / weight
    print(
        f"return {returns.mean():.0f}, falls {mean['fell']:.0%}, {mean['speed_m_s']:.2f} m/s,"
        f" duty factor {mean['duty_factor']:.2f}, stance peak {peak:.1f} weights"
    )


if __name__ == "__main__":
    main()

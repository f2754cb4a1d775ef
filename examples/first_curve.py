"""A first learning curve: pip install "hoof-env[train,plot]", then python examples/first_curve.py"""

import gymnasium as gym
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.monitor import Monitor

from hoof_env.envs.open_loop import load_open_loop
from hoof_env.envs.policies import Scripted, make_policy
from hoof_env.policies.actor import Actor

ENV_ID = "hoof_env/HorseLeg-v0"
torch.set_num_threads(1)  # more are slower with small networks, many times on a busy machine
model = PPO("MlpPolicy", Monitor(gym.make(ENV_ID), "first_curve"), seed=0, device="cpu")  # defaults
model.learn(200_000)
model.save("first_curve.zip")


def play(policy, episodes=20):
    """Return the mean return of a policy, in episodes with the start that it prescribes."""
    env = gym.make(ENV_ID)
    actor = Actor(policy, env)
    total = 0.0
    for seed in range(1000, 1000 + episodes):
        observation, _ = env.reset(seed=seed, options=actor.start)
        actor.begin()
        ended = False
        while not ended:
            observation, reward, failed, through, _ = env.step(actor.act(observation))
            total, ended = total + reward, failed or through
    return total / episodes


env = gym.make(ENV_ID)
beside = {
    "zero action, which keeps the gait": Scripted(lambda observation, time: np.zeros(4), env.unwrapped.dt),
    "scripted run": make_policy("run", env),
    "best gait without feedback": load_open_loop(ENV_ID, env),
}
returns, steps = np.loadtxt("first_curve.monitor.csv", delimiter=",", skiprows=2, usecols=(0, 1)).T
plt.plot(np.cumsum(steps), returns, label="PPO, as it explores")
for colour, (name, policy) in enumerate(beside.items(), 1):
    level = play(policy)
    plt.axhline(level, color=f"C{colour}", linestyle="--", label=f"{name}: {level:.1f}")
learnt = play(model)
plt.plot(steps.sum(), learnt, "oC0", label=f"PPO, without noise: {learnt:.1f}")
plt.xlabel("steps")
plt.ylabel("return of an episode")
plt.legend()
plt.savefig("first_curve.png")
print(f"return {returns[:10].mean():.1f} in the beginning, {learnt:.1f} at the end: first_curve.png")

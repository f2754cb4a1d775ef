"""A first learning curve: pip install "hoof-env[train,plot]", then python examples/first_curve.py"""

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

from hoof_env import Sb3VecEnv

torch.set_num_threads(1)  # more are slower with small networks, many times on a busy machine
envs = VecMonitor(Sb3VecEnv("hoof_env/HorseLeg-v0", num_envs=64), "first_curve")
scaled = VecNormalize(envs, norm_obs=False, gamma=0.998)
settings = {"n_steps": 500, "batch_size": 2000, "n_epochs": 4, "gamma": 0.998, "gae_lambda": 0.995}
model = PPO("MlpPolicy", scaled, learning_rate=0.003, policy_kwargs={"log_std_init": -1.0}, **settings)
model.learn(640_000)
model.save("first_curve.zip")

returns = np.loadtxt("first_curve.monitor.csv", delimiter=",", skiprows=2, usecols=0)
smooth = np.convolve(returns, np.ones(64) / 64, "valid")
plt.plot(500e-6 * np.arange(64, len(returns) + 1), smooth)  # an episode is 500 steps
plt.xlabel("million steps")
plt.ylabel("return, mean of 64 episodes")
plt.savefig("first_curve.png")
print(f"return {smooth[0]:.1f} in the beginning, {smooth[-1]:.1f} at the end: first_curve.png")

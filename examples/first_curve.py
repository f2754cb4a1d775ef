"""A first learning curve: pip install "hoof-env[train,plot]", then python examples/first_curve.py"""

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from stable_baselines3 import PPO
from stable_baselines3.common.monitor import load_results
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

from hoof_env import Sb3VecEnv

envs = VecMonitor(Sb3VecEnv("hoof_env/HorseLeg-v0", num_envs=64), "first_curve")
scaled = VecNormalize(envs, norm_obs=False, gamma=0.998)
settings = {"n_steps": 500, "batch_size": 2048, "n_epochs": 4, "gamma": 0.998, "gae_lambda": 0.995}
model = PPO("MlpPolicy", scaled, learning_rate=0.003, policy_kwargs={"log_std_init": -1.0}, **settings)
model.learn(640_000)
model.save("first_curve/model.zip")

episodes = load_results("first_curve")
smooth = episodes["r"].rolling(64).mean()
plt.plot(500e-6 * episodes.index, smooth)  # an episode is 500 steps
plt.xlabel("million steps")
plt.ylabel("return, mean of 64 episodes")
plt.savefig("first_curve/curve.png")
print(
    f"return {smooth.iloc[64]:.1f} in the beginning, {smooth.iloc[-1]:.1f} at the end: first_curve/curve.png"
)

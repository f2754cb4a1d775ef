"""A pony that must keep its time: hoof-env's leg, smaller, and paid for a speed instead of a distance."""

from pathlib import Path

import gymnasium as gym
from gymnasium.envs.registration import WrapperSpec

PONY = str(Path(__file__).with_name("pony.json"))
WEIGHTS = {"progress": 1.0, "peak": 0.5, "energy": 0.1, "support": 0.0}
LEG = {"preset": PONY, "trunk_mass": 30.0, "target_speed": None, "reward_weights": WEIGHTS}


class OnTime(gym.Wrapper, gym.utils.RecordConstructorArgs):
    """Instead of progress [m] pays up to 1 per second, the more the nearer the speed is to `speed` [m/s]."""

    def __init__(self, env: gym.Env, speed: float) -> None:
        gym.utils.RecordConstructorArgs.__init__(self, speed=speed)
        gym.Wrapper.__init__(self, env)
        self.speed = speed

    def step(self, action):
        observation, reward, *flags, info = self.env.step(action)
        progress, wanted = info["reward_progress"], self.speed * self.unwrapped.dt
        info["reward_time"] = self.unwrapped.dt * max(0.0, 1.0 - abs(progress / wanted - 1.0))
        return observation, reward - progress + info["reward_time"], *flags, info


ON_TIME = WrapperSpec("OnTime", "hoof_pony:OnTime", {"speed": 2.0})
gym.register("hoof_pony/OnTime-v0", "hoof_env:HorseLegEnv", kwargs=LEG, additional_wrappers=(ON_TIME,))

"""A task of one's own, outside the package: a term of the reward, an entry of the observation and a law of
contact.

python examples/own_task.py
"""

import gymnasium as gym
import numpy as np

import hoof_env
from hoof_env.simd.math import root_power


def friction(step, weight):
    """Charge sliding under load: the power of friction at toe and heel [kW]."""
    toe = step.leg.report.toe
    heel = step.leg.report.heel
    return 0.001 * weight * (toe.friction * toe.slide + heel.friction * heel.slide)


def comfort(step, weight):
    """Reward a trunk that hardly accelerates."""
    smooth = np.exp(-abs(step.trunk.report.acceleration.imag) / 9.81)
    return np.where(step.failed > 0.0, 0.0, weight * smooth)


def vertical_acceleration(scene):
    """Return the vertical acceleration of the trunk [m/s^2]."""
    return scene.trunk.report.acceleration.imag


def turf(penetration, rate, inverse_approach_speed, ground):
    """Return a normal force [N] that grows stiffer with depth and loses more on the way out than Eq. 14."""
    spring = ground.stiffness * root_power(penetration, 12) * (1.0 + penetration / 0.05)
    damping = ground.chi * np.where(rate < 0.0, 2.0 * rate, rate) * inverse_approach_speed
    return spring * np.maximum(1.0 + damping, 0.0)


hoof_env.register(
    "my_lab/Turf-v0",
    base="leg",
    terms=[
        hoof_env.Term("friction", 0.5, "1/kJ", "power of friction", friction),
        hoof_env.Term("comfort", 0.1, "-", "per step without acceleration", comfort),
    ],
    entries=[
        hoof_env.Entry(
            "vertical acceleration",
            "feel",
            "m/s^2",
            vertical_acceleration,
            hoof_env.Scale("tanh(x / 9.81)", lambda x, scene: x / 9.81, saturates=True),
        )
    ],
    contact_law=turf,
    stiffness=5e4,
)

if __name__ == "__main__":
    env = gym.make("my_lab/Turf-v0")
    envs = gym.make_vec("my_lab/Turf-v0", num_envs=64)
    observation, info = env.reset(seed=0)
    envs.reset(seed=0)
    for _ in range(50):
        observation, reward, *_, info = env.step(np.zeros(4, np.float32))
        rewards = envs.step(np.zeros((64, 4), np.float32))[1]
        assert reward == rewards[0]  # the same bits alone and among many
    rubbed = info["reward_friction"]
    rode = info["reward_comfort"]
    print(f"reward {reward:.4f}, of which {rubbed:.4f} for friction and {rode:.4f} for comfort")

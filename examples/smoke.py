"""Every environment, alone and among many, in a minute or two: a test of an installation.

python examples/smoke.py
"""

import gymnasium as gym

import hoof_env

for env_id in sorted(name for name in gym.registry if name.startswith("hoof_env/")):
    env = gym.make(env_id)
    env.reset(seed=0)
    env.action_space.seed(0)
    for _ in range(20):
        env.step(env.action_space.sample())
    if "MO" not in env_id:  # Gymnasium's vectors have no room for rewards that are vectors
        envs = gym.make_vec(env_id, num_envs=8)
        envs.reset(seed=0)
        envs.action_space.seed(0)
        envs.step(envs.action_space.sample())
    print(f"{env_id}: works")
print(f"hoof-env {hoof_env.__version__}")

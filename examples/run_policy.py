"""Play a policy without a learning library: python examples/run_policy.py POLICY.onnx"""

import json
import sys

import gymnasium
import numpy as np
import onnxruntime

from hoof_env.policies.record import environment_of

if len(sys.argv) != 2:
    sys.exit(__doc__)
policy = onnxruntime.InferenceSession(sys.argv[1])
about = policy.get_modelmeta().custom_metadata_map
record = {"env_id": about["env_id"], "env_kwargs": json.loads(about["env_kwargs"])}
env_id, arguments = environment_of(sys.argv[1], record)  # a file must not import a module
env = gymnasium.make(env_id, **arguments)
for seed in range(1000, 1003):
    observation, _ = env.reset(seed=seed)
    total, done = 0.0, False
    while not done:
        (actions,) = policy.run(["action"], {"observation": observation[np.newaxis]})
        observation, reward, terminated, truncated, _ = env.step(actions[0])
        total, done = total + np.sum(reward), terminated or truncated
    print(f"{env_id}, episode {seed}: return {total:.2f}")

"""Environments as pure functions of JAX, with gymnax's form: `jit`, `vmap`, `grad`.

    import jax
    import hoof_env.jax

    env, params = hoof_env.jax.make("hoof_env/HorseLeg-v0")
    key = jax.random.key(0)
    observation, state = env.reset(key, params)
    observation, state, reward, done, info = env.step(key, state, action, params)

The source of the kernels runs on a machine of JAX's (`machine`). Needs the extra `jax`.
"""

from hoof_env.envs.xla import loaded_jax

loaded_jax()

from hoof_env.jax.environment import JaxEnv, Params, State, make  # noqa: E402

__all__ = ["JaxEnv", "Params", "State", "make"]

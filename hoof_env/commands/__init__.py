"""Sub-commands of `hoof-env`, see `hoof_env.cli`."""

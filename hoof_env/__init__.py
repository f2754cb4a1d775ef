from hoof_env._version import __version__

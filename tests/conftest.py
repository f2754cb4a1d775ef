"""For all tests: compiling says nothing, whose lines some tests would count."""

import os

from hoof_env._jit import QUIET

os.environ.setdefault(QUIET, "1")

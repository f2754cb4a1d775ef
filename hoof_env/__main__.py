"""`python -m hoof_env` is the command `hoof-env`."""

import sys

from hoof_env.cli import main

sys.exit(main())

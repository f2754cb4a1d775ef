"""Lets the tests here import what they share, `family`, however pytest finds them."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parent))

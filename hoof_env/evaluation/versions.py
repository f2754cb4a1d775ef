"""Versions on which a result depends."""

from __future__ import annotations

import platform
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version

PACKAGES = ("hoof-env", "numpy", "gymnasium", "llvmlite", "stable-baselines3", "sb3-contrib", "torch")


def versions() -> dict[str, str]:
    """Return Python, platform, and the packages on which a result depends."""
    packages = {"python": platform.python_version(), "platform": f"{platform.system()} {platform.machine()}"}
    for package in PACKAGES:
        with suppress(PackageNotFoundError):
            packages[package] = version(package)
    return packages

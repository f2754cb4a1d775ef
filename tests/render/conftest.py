"""The run that pictures show."""

import pytest

from tests.render.drawn import simulate


@pytest.fixture(scope="session")
def run():
    """Four seconds of a run, see `simulate`."""
    return simulate(4.0)

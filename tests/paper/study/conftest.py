"""The study's sweeps with few points each, for tests that read what it finds and not how finely it looks."""

import numpy as np
import pytest

from hoof_env.paper.study import laws, numerics, sensitivity

SWEEPS = {
    (numerics, "BETA_SWEEP"): np.linspace(0, 40, 9),
    (numerics, "STEP_SWEEP"): np.array([500, 1000, 2000]),
    (laws, "RESTITUTIONS"): np.array([0, 0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0]),
    (laws, "FLOORS"): np.geomspace(1e-4, 3.0, 13),
    (sensitivity, "LEVELS"): np.linspace(-20e-3, 20e-3, 5),
    (sensitivity, "FRICTIONS"): np.array([0.0, 0.4, 1.0]),
    (sensitivity, "FAST"): np.array([2e-3, 1e-2, 10.0]),
}


@pytest.fixture(scope="module")
def few_points():
    with pytest.MonkeyPatch.context() as patch:
        for (part, name), values in SWEEPS.items():
            patch.setattr(part, name, values)
        yield

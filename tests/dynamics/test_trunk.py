"""The trunk alone, leg at rest in the air, against textbook motion: fall, oscillator, drag."""

import numpy as np
import pytest

from hoof_env.constants import GRAVITY
from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Limb, Prescribed, Trunk
from hoof_env.gait import GaitParameters
from tests.dynamics.scenes import LEG

STILL = GaitParameters(0.0, 0.4, 0.0, 0.0)
NOTHING = {"share": 0.0, "stiffness": 0.0, "damping": 0.0, "drag": 0.0, "height": 30.0}


def play(trunk, seconds, h=1e-4, **start):
    engine = TrunkEngine(Limb(LEG, drive=Prescribed()), trunk, sim_dt=h)
    engine.reset(STILL, **start)
    trace = {name: np.ravel(values) for name, values in engine.run(steps=round(seconds / h)).items()}
    assert not trace["result"].any()
    assert not (trace["toe_normal"] + trace["heel_normal"]).any()
    return trace, trunk.mass + LEG.mass


@pytest.mark.parametrize(("share", "near"), [(1.0, 1e-3), (0.25, 1e-3), (0.0, 1e-10)])
def test_it_falls_with_the_share_of_its_weight_and_keeps_its_speed(share, near):
    trace, _ = play(Trunk(**{**NOTHING, "share": share}), 1.0, vx=2.0)
    fall = share * GRAVITY * trace["time"] ** 2 / 2
    assert trace["x"] == pytest.approx(2.0 * trace["time"], abs=1e-10)
    assert trace["y"] == pytest.approx(30.0 - fall, abs=near)
    assert trace["vy"] == pytest.approx(-share * GRAVITY * trace["time"], abs=1e-8)


@pytest.mark.parametrize("damping", [200.0, 1130.0, 3000.0])
def test_spring_and_damper_are_an_oscillator(damping):
    trunk = Trunk(**{**NOTHING, "stiffness": 4000.0, "damping": damping})
    trace, mass = play(trunk, 1.0, y=30.5)
    roots = np.roots([mass, damping, 4000.0]).astype(complex)
    weights = np.linalg.solve(np.array([[1, 1], roots]), [0.5, 0.0])
    exact = (np.exp(np.outer(trace["time"], roots)) @ weights).real
    assert trace["y"] - 30.0 == pytest.approx(exact, abs=1e-3)


def test_the_spring_rests_below_its_height_by_the_share_of_the_weight():
    trunk = Trunk(**{**NOTHING, "share": 0.5, "stiffness": 4000.0, "damping": 1130.0})
    trace, mass = play(trunk, 6.0, h=1e-3)
    assert 30.0 - trace["y"][-1] == pytest.approx(0.5 * mass * GRAVITY / 4000.0, rel=1e-6)


@pytest.mark.parametrize("kind", ["rail", "suspended"])
def test_drag_slows_it_exponentially(kind):
    trunk = Trunk(**{**NOTHING, "kind": kind, "drag": 60.0})
    trace, mass = play(trunk, 2.0, vx=5.0)
    assert trace["vx"] == pytest.approx(5.0 * np.exp(-60.0 / mass * trace["time"]), rel=1e-3)

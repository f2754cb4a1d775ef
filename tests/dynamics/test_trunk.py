"""The trunk alone, leg at rest in the air, against textbook motion: fall, oscillator, drag."""

import numpy as np
import pytest

from hoof_env.dynamics.engine import LegEngine
from hoof_env.dynamics.result import Result
from hoof_env.dynamics.trace import new_trace
from hoof_env.dynamics.trunk import GRAVITY, TRUNK, Trunk
from hoof_env.errors import ParameterError
from hoof_env.gait.parameters import GaitParameters
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import load_geometry

LEG = load_geometry("first_fit")
STILL = GaitParameters(0.0, 0.4, 0.0, 0.0)
NOTHING = {"share": 0.0, "stiffness": 0.0, "damping": 0.0, "drag": 0.0, "height": 30.0}


def play(trunk, seconds, h=1e-4, **start):
    engine = LegEngine(LEG, trunk, Ground(), h)
    engine.reset(STILL, **start)
    trace = new_trace(round(seconds / h))
    engine.advance(STILL.to_array(), trace)
    assert (trace["grf"] == 0).all()
    return trace, trunk.mass + LEG.mass


def test_it_floats_when_nothing_pulls():
    trace, _ = play(Trunk(**NOTHING), 1.0, speed=2.0)
    assert trace["trunk_x"] == pytest.approx(2.0 * trace["t"], abs=1e-10)
    assert trace["trunk_y"] == pytest.approx(30.0, abs=1e-10)


@pytest.mark.parametrize("share", [1.0, 0.25])
def test_it_falls_with_the_share_of_its_weight(share):
    trace, _ = play(Trunk(**{**NOTHING, "share": share}), 1.0)
    fall = share * GRAVITY * trace["t"] ** 2 / 2
    assert trace["trunk_y"] == pytest.approx(30.0 - fall, abs=1e-3)
    assert trace["trunk_vy"] == pytest.approx(-share * GRAVITY * trace["t"], abs=1e-8)


@pytest.mark.parametrize("damping", [200.0, 1130.0, 3000.0])
def test_spring_and_damper_are_an_oscillator(damping):
    trunk = Trunk(**{**NOTHING, "stiffness": 4000.0, "damping": damping})
    trace, mass = play(trunk, 1.0, height=30.5)
    roots = np.roots([mass, damping, 4000.0]).astype(complex)
    weights = np.linalg.solve(np.array([[1, 1], roots]), [0.5, 0.0])
    exact = (np.exp(np.outer(trace["t"], roots)) @ weights).real
    assert trace["trunk_y"] - 30.0 == pytest.approx(exact, abs=1e-3)


def test_the_spring_rests_below_its_height_by_the_share_of_the_weight():
    trunk = Trunk(**{**NOTHING, "share": 0.5, "stiffness": 4000.0, "damping": 1130.0})
    trace, mass = play(trunk, 6.0, h=1e-3)
    assert 30.0 - trace["trunk_y"][-1] == pytest.approx(0.5 * mass * GRAVITY / 4000.0, rel=1e-6)


@pytest.mark.parametrize("kind", ["rail", "suspended"])
def test_drag_slows_it_exponentially(kind):
    trunk = Trunk(**{**NOTHING, "kind": kind, "drag": 60.0})
    trace, mass = play(trunk, 2.0, speed=5.0)
    assert trace["trunk_vx"] == pytest.approx(5.0 * np.exp(-60.0 / mass * trace["t"]), rel=1e-3)


def test_the_record_holds_the_settings():
    trunk = Trunk("rail", 70.0, 0.3, stiffness=1.0, damping=2.0, drag=3.0, height=1.6, pitch_inertia=9.0)
    record = trunk.to_record(leg_mass=7.0, gravity=GRAVITY)
    assert dict(zip(TRUNK.names, record.item(), strict=True)) == {
        "kind": 1, "mass": 70.0, "total_mass": 77.0, "share": 0.3, "stiffness": 1.0, "damping": 2.0,
        "height": 1.6, "drag": 3.0, "gravity": GRAVITY,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"kind": "loose"}, "trunk: expected one of fixed, free, rail, suspended, got 'loose'"),
        ({"mass": 0.0}, "trunk_mass: expected"),
        ({"share": 1.1}, r"trunk_share: expected a finite number in \[0, 1\], got 1.1"),
        ({"stiffness": -1.0}, "trunk_stiffness: expected"),
        ({"damping": float("nan")}, "trunk_damping: expected"),
        ({"drag": -1.0}, "trunk_drag: expected"),
        ({"height": 0.0}, "trunk_height: expected"),
        ({"pitch_inertia": 0.0}, "trunk_pitch_inertia: expected"),
    ],
)
def test_bad_settings_are_named(settings, message):
    with pytest.raises(ParameterError, match=message):
        Trunk(**settings)


def test_one_leg_does_not_bear_a_free_trunk():
    with pytest.raises(ParameterError, match="trunk: expected one of fixed, rail, suspended, got 'free'"):
        LegEngine(LEG, Trunk("free"), Ground())


@pytest.mark.parametrize(
    ("stiffness", "damping", "drag"),
    [(4.0, 0.0, 0.0), (0.1, 1.95, 0.0), (2.0, 1.0, 0.0), (0.0, 0.0, 2.0)],
    ids=["spring", "mostly damper", "both", "drag"],
)
def test_a_suspension_too_quick_for_the_step_is_refused_at_its_limit(stiffness, damping, drag, monkeypatch):
    """In units of m / h^2 and m / h: just inside the motion stays bounded, just outside it would not."""
    h, m = 1e-3, 80.0 + LEG.mass

    def scaled(part):
        spring, rates = stiffness * m / h**2, {"damping": damping * m / h, "drag": drag * m / h}
        settings = {"stiffness": spring, **rates}
        return Trunk(**{**NOTHING, **{name: part * value for name, value in settings.items()}})

    def furthest(trunk):
        engine = LegEngine(LEG, trunk, Ground(), h)
        engine.reset(STILL, height=30.1, speed=0.1)
        trace = new_trace(2000)
        if engine.advance(STILL.to_array(), trace) is not Result.OK:
            return np.inf
        return max(np.abs(trace["trunk_vx"]).max(), np.abs(trace["trunk_y"] - 30.0).max())

    assert furthest(scaled(0.99)) < 10.0
    with pytest.raises(ParameterError, match=r"trunk_(stiffness, trunk_damping|drag): expected"):
        furthest(scaled(1.01))
    monkeypatch.setattr(Trunk, "check_step", lambda *_: None)
    assert furthest(scaled(1.01)) > 1e3

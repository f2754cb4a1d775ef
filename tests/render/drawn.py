"""Instants of a run and pictures of them, for the tests of this folder."""

from __future__ import annotations

import numpy as np

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Limb, Trunk
from hoof_env.gait import load_gait
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import load_geometry
from hoof_env.record.columns import columns_of_engine
from hoof_env.record.instant import BodyInstant, Instant, leg_instants
from hoof_env.record.surroundings import Surroundings
from hoof_env.render.renderer import Renderer
from tests.legs import FIRST_FIT

GEOMETRY = load_geometry(FIRST_FIT)
SCENE = (slice(90, None), slice(0, 640))  # rows and columns of the scene, below its key and left of the panel
KEY = (slice(10, 31), slice(0, 64))  # of the key's arrow
VERMILION, BLUE, PURPLE, LINE = (213, 94, 0), (0, 114, 178), (204, 121, 167), (112, 95, 66)


def simulate(seconds: float) -> list[list[Instant]]:
    """Instants of the run's start and of every control step of 20 ms after it."""
    engine = TrunkEngine(Limb(GEOMETRY), Trunk(height=GEOMETRY.hip_height), Ground())
    gait = load_gait("run")
    engine.reset(gait)
    rows = leg_instants(columns_of_engine(engine.run(gait.to_array(), round(seconds * 1000))))
    return [rows[:1], *(rows[k : k + 20] for k in range(1, len(rows), 20))]


def renderer(mode: str = "rgb_array", trunk: str = "rail", **options) -> Renderer:
    kept = {name: options.pop(name) for name in ("fps", "size") if name in options}
    held = "suspended" if "weight_n" in options else trunk
    return Renderer(Surroundings(GEOMETRY, trunk=held, **options), mode, **kept)


def body(leg: Instant) -> BodyInstant:
    """The instant of a trunk on one leg."""
    return BodyInstant(*leg[:6], legs=(leg,))


def add(picture: Renderer, step: list[Instant]) -> None:
    """Show a renderer what happened to one leg."""
    picture.add([body(leg) for leg in step])


def points(picture: Renderer, leg: Instant) -> dict[str, complex]:
    """Where a renderer draws the named points of a leg."""
    return picture._scene.look_at(body(leg))[0]


def draw(*steps: list[Instant], **options) -> np.ndarray:
    """A frame of a fresh renderer that has seen `steps`."""
    picture = renderer(**options)
    for step in steps:
        add(picture, step)
    return picture.frame()


def loaded(run, toe: float, friction: float = 0.0, heel: float = 0.0, **changes) -> list[Instant]:
    """The start, in flight, with made-up forces on toe and heel, the toe 5 cm inside the ground."""
    now = run[0][0]
    middle = (toe * now.toe_x + heel * now.heel_x) / max(toe + heel, 1.0)
    made_up = {
        "toe_normal": toe, "toe_friction": friction, "toe_force_x": friction, "toe_force_y": toe,
        "heel_normal": heel, "heel_force_y": heel, "toe_y": -0.05, "toe_depth": 0.05,
        "force_x": friction, "force_y": toe + heel, "cop_x": middle, "cop_y": -0.05,
    }  # fmt: skip
    return [now._replace(**made_up | changes)]


def pixels(frame, colour, where=SCENE):
    """Rows and columns of the pixels of a colour."""
    rows, columns = np.nonzero((frame[where] == colour).all(axis=-1))
    return rows + (where[0].start or 0), columns + (where[1].start or 0)

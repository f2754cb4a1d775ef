"""Pictures of bodies by kind: the scene, the panel and a page's drawing that show a body.

A body names the kind of its picture (`tasks.body.Body.picture`); `picture_of` finds the picture. A body that
needs another one adds it to `PICTURES`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Protocol

from hoof_env.dynamics.parts import ONE_LEG, TRUNKS
from hoof_env.errors import ParameterError, check_choice
from hoof_env.record.instant import BodyInstant
from hoof_env.record.surroundings import Surroundings

if TYPE_CHECKING:
    from hoof_env.render.brush import Brush
    from hoof_env.render.drawing import Drawing
    from hoof_env.render.panel import Stances

# Scenes and panels need pygame, which a server may lack: methods that make them import them.


class Scene(Protocol):
    """Interface of scenes: the body on its ground."""

    def reset(self) -> None:
        """Forget the instants of the last episode."""

    def add(self, instants: Sequence[BodyInstant]) -> None:
        """Add the instants since the last call, in the order of time."""

    def draw(self, canvas: Any, now: BodyInstant, full_scale: float) -> None:
        """Draw an instant on a surface of pygame; `full_scale` is the force of the longest arrow [N]."""


class Panel(Protocol):
    """Interface of panels: numbers and curves next to the scene.

    Attributes:
        full_scale: force at the top of the curves [N], which arrows of the scene share.
    """

    full_scale: float

    @property
    def stances(self) -> Stances:
        """Stances of the episode and their peaks; of several legs, of the leg with the highest force."""

    def reset(self) -> None:
        """Forget the instants of the last episode."""

    def add(self, instants: Sequence[BodyInstant]) -> None:
        """Add the instants since the last call, in the order of time."""

    def draw(self, canvas: Any, now: BodyInstant) -> None:
        """Draw an instant on a surface of pygame, over the scene."""


class Picture(Protocol):
    """Interface of pictures.

    Attributes:
        trunks: kinds of trunk that the scene can draw; see `dynamics.parts.TRUNKS`.
    """

    trunks: tuple[str, ...]

    def scene(self, brush: Brush, here: Surroundings, size: tuple[int, int], right: int) -> Scene:
        """Make the scene in a picture of `size`, whose `right` pixels it leaves free."""

    def panel(self, brush: Brush, box: tuple[int, int, int, int], here: Surroundings) -> Panel:
        """Make the panel in a box (left, top, width, height) of the picture."""

    def drawing(self, here: Surroundings, numbers: int) -> Drawing:
        """Make the drawing of a page whose rows start with `numbers` numbers."""


class LegPicture:
    """Picture of a leg under the bar of a trunk, with gait and force of one hoof.

    A suspended trunk hangs on a spring, one on a boom shows the boom's end, one on a rail has wheels, a fixed
    one is bolted, and nothing holds a floating one.
    """

    trunks: tuple[str, ...] = ONE_LEG

    def scene(self, brush: Brush, here: Surroundings, size: tuple[int, int], right: int) -> Scene:
        """Make the scene; see `Picture`."""
        from hoof_env.render.panel import unit_of
        from hoof_env.render.scene import LegScene

        unit = unit_of(here.lift_off_n)
        return LegScene(
            brush, here.geometry, here.terrain, size, right, here.trunk, unit, here.hips, here.hoof_length
        )

    def panel(self, brush: Brush, box: tuple[int, int, int, int], here: Surroundings) -> Panel:
        """Make the panel; see `Picture`."""
        from hoof_env.gait import limits_of
        from hoof_env.render.panel import LegPanel

        if len(here.hips) > 1:
            raise ParameterError(f"picture: expected 'legs' for {len(here.hips)} legs, got 'leg'")
        weight = here.weight_n if here.trunk in ("suspended", "boom", "floating") else 0.0
        return LegPanel(brush, box, weight, here.lift_off_n, limits_of(here.geometry))

    def drawing(self, here: Surroundings, numbers: int) -> Drawing:
        """Make the drawing of a page; see `Picture`."""
        from hoof_env.render.drawing import Drawing

        return Drawing(here, numbers)


class LegsPicture(LegPicture):
    """Picture of two to nine legs under the bar of a trunk, with forces of all hooves and their footfall."""

    def panel(self, brush: Brush, box: tuple[int, int, int, int], here: Surroundings) -> Panel:
        """Make the panel; see `Picture`."""
        from hoof_env.render.legs_panel import MAX_LEGS, LegsPanel

        if len(here.hips) > MAX_LEGS:
            raise ParameterError(f"picture: expected at most {MAX_LEGS} legs, got {len(here.hips)}")
        return LegsPanel(brush, box, tuple(here.hips), here.weight_n, here.lift_off_n)


class HorsePicture(LegsPicture):
    """Picture of a horse, with forces of all hooves and their footfall."""

    trunks: tuple[str, ...] = TRUNKS

    def scene(self, brush: Brush, here: Surroundings, size: tuple[int, int], right: int) -> Scene:
        """Make the scene; see `Picture`."""
        from hoof_env.render.horse_scene import HorseScene

        return HorseScene(brush, here.geometry, here.terrain, size, right)

    def drawing(self, here: Surroundings, numbers: int) -> Drawing:
        """Make the drawing of a page; see `Picture`."""
        from hoof_env.render.drawing import HorseDrawing

        return HorseDrawing(here, numbers)


PICTURES: dict[str, Picture] = {"leg": LegPicture(), "legs": LegsPicture(), "horse": HorsePicture()}
"""Pictures by kind."""


def picture_of(here: Surroundings) -> Picture:
    """Return the picture of a body; raise `ParameterError` for an unknown kind."""
    return PICTURES[check_choice("picture", here.picture, PICTURES)]

"""Pictures that bodies ask for: which scene, which panel, and which drawing on a page show a body.

A body names its picture (`tasks.body.Body.picture`), and whatever draws asks the picture. A new body takes
one of these, or brings another.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from hoof_env.dynamics.parts import ONE_LEG, TRUNKS

if TYPE_CHECKING:
    from hoof_env.render.brush import Brush
    from hoof_env.render.drawing import Drawing
    from hoof_env.render.instant import Surroundings

# Scenes and panels need pygame, which a server or a cluster may lack: they are imported where they are made.


class Picture(Protocol):
    """Interface of pictures.

    Attributes:
        trunks: kinds of trunk that the scene can draw, see `dynamics.parts.TRUNKS`.
    """

    trunks: tuple[str, ...]

    def scene(self, brush: Brush, here: Surroundings, size: tuple[int, int], right: int) -> Any:
        """Make the scene in a picture of `size`, whose `right` pixels it leaves free."""

    def panel(self, brush: Brush, box: tuple[int, int, int, int], here: Surroundings) -> Any:
        """Make the panel in a box (left, top, width, height) of the picture."""

    def drawing(self, here: Surroundings, numbers: int) -> Drawing:
        """Make the drawing of a page whose rows begin with `numbers` numbers."""


class LegPicture:
    """Picture of a leg under the bar of a trunk, with gait and force of one hoof."""

    trunks: tuple[str, ...] = ONE_LEG

    def scene(self, brush: Brush, here: Surroundings, size: tuple[int, int], right: int) -> Any:
        """Make the scene, see `Picture`."""
        from hoof_env.render.panel import unit_of
        from hoof_env.render.scene import Scene

        unit = unit_of(here.lift_off_n)
        return Scene(brush, here.geometry, here.terrain, size, right, here.trunk, unit, len(here.hips))

    def panel(self, brush: Brush, box: tuple[int, int, int, int], here: Surroundings) -> Any:
        """Make the panel, see `Picture`."""
        from hoof_env.gait import limits_of
        from hoof_env.render.panel import Panel

        weight = here.weight_n if here.trunk == "suspended" else 0.0
        return Panel(brush, box, weight, here.lift_off_n, limits_of(here.geometry))

    def drawing(self, here: Surroundings, numbers: int) -> Drawing:
        """Make the drawing of a page, see `Picture`."""
        from hoof_env.render.drawing import Drawing

        return Drawing(here, numbers)


class LegsPicture(LegPicture):
    """Picture of several legs under the bar of a trunk, with forces of all hooves and their footfall."""

    def panel(self, brush: Brush, box: tuple[int, int, int, int], here: Surroundings) -> Any:
        """Make the panel, see `Picture`."""
        from hoof_env.render.legs_panel import LegsPanel

        return LegsPanel(brush, box, tuple(here.hips), here.weight_n, here.lift_off_n)


class HorsePicture(LegsPicture):
    """Picture of a horse, with forces of all hooves and their footfall."""

    trunks: tuple[str, ...] = TRUNKS

    def scene(self, brush: Brush, here: Surroundings, size: tuple[int, int], right: int) -> Any:
        """Make the scene, see `Picture`."""
        from hoof_env.render.horse_scene import HorseScene

        return HorseScene(brush, here.geometry, here.terrain, size, right)

    def drawing(self, here: Surroundings, numbers: int) -> Drawing:
        """Make the drawing of a page, see `Picture`."""
        from hoof_env.render.drawing import HorseDrawing

        return HorseDrawing(here, numbers)

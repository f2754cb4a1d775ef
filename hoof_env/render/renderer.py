"""Pictures of a body in motion: an off-screen RGB array, or a window.

Drawing is done in software on an off-screen surface; only render mode "human" opens a display. Every
number in the picture is read from instants (`record.instant`); no mechanics are computed here.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import logger
from gymnasium.error import DependencyNotInstalled, ResetNeeded
from numpy.typing import NDArray

from hoof_env.errors import HoofEnvError, check_choice, check_number
from hoof_env.record.instant import BodyInstant
from hoof_env.record.surroundings import Surroundings
from hoof_env.render.picture import picture_of
from hoof_env.render.size import USUAL_SIZE, check_size

if TYPE_CHECKING:
    from hoof_env.render.panel import Stances

MODES = ("rgb_array", "human")


class Renderer:
    """Renderer of a body, the ground, the forces on hooves and a panel with numbers and curves.

    Args:
        here: surroundings; the kind of picture that they name makes scene and panel.
        mode: one of `MODES`.
        fps: frames per second that a window is held to [Hz].
        size: width and height of the picture [pixels].

    Attributes:
        here: surroundings.

    Raises:
        ParameterError: an unknown mode, or a value out of range.
        DependencyNotInstalled: pygame is missing.
    """

    def __init__(
        self,
        here: Surroundings,
        mode: str = "rgb_array",
        fps: float = 50.0,
        size: tuple[int, int] = USUAL_SIZE,
    ) -> None:
        self.here = here
        self.mode = check_choice("render_mode", mode, MODES)
        self.fps = check_number("fps", fps, low=0, exclusive_low=True)
        self.size = check_size(size)
        picture = picture_of(here)
        check_choice("trunk", here.trunk, picture.trunks)
        check_number("weight_n", here.weight_n, low=0)
        try:
            import pygame
        except ImportError:
            hint = 'pygame is not installed, run `pip install "hoof-env[render]"`'
            raise DependencyNotInstalled(hint) from None
        from hoof_env.render.brush import Brush

        self._pygame = pygame
        self._canvas = pygame.Surface(self.size, 0, 32)
        # In the layout of a frame, which makes the copy fast.
        self._packed = pygame.Surface(self.size, 0, 24, (0xFF, 0xFF00, 0xFF0000, 0))
        self.brush = brush = Brush(self.size)
        edge = round(16 * brush.unit)
        column = round(304 * brush.unit)
        box = (self.size[0] - edge - column, edge, column, round(508 * brush.unit))
        self._scene = picture.scene(brush, here, self.size, column + 2 * edge)
        self._panel = picture.panel(brush, box, here)
        self._window_open = False
        self._clock = pygame.time.Clock()
        self._closed = False
        self._now: Any = None

    @property
    def stances(self) -> Stances:
        """Stances of the episode and their peaks."""
        return self._panel.stances

    @property
    def latest(self) -> Any:
        """The instant that is drawn next; raise `ResetNeeded` if there is none."""
        if self._now is None:
            raise ResetNeeded("nothing to draw yet: reset the environment first")
        return self._now

    @property
    def is_empty(self) -> bool:
        return self._now is None

    def reset(self) -> None:
        """Forget the forces and the paths of the last episode."""
        self._now = None
        self._scene.reset()
        self._panel.reset()

    def add(self, news: Sequence[BodyInstant]) -> None:
        """Add the instants since the last call, in the order of time; skip instants that are not finite."""
        seen = [now for now in news if _is_finite(now)]
        if seen:
            self._now = seen[-1]
            self._scene.add(seen)
            self._panel.add(seen)

    def frame(self) -> NDArray[np.uint8] | None:
        """Draw the latest instant.

        "rgb_array" gives a fresh array of shape (height, width, 3), "human" None; the window shows the
        picture and the call waits so that frames come at `fps`. A window that was closed stays closed.
        """
        picture = self.draw()
        if self.mode == "human":
            self._show(picture)
            return None
        self._packed.blit(picture, (0, 0))
        return self._pygame.surfarray.pixels3d(self._packed).transpose(1, 0, 2).copy()

    def close(self) -> None:
        """Close the window, if there is one, permanently. A second call has no effect."""
        self._closed = True
        if self._window_open:
            self._window_open = False
            self._pygame.display.quit()

    def draw(self) -> Any:
        """Draw the latest instant; return the surface, which the next call paints over."""
        now = self.latest
        self._scene.draw(self._canvas, now, self._panel.full_scale)
        self._panel.draw(self._canvas, now)
        return self._canvas

    def _show(self, picture: Any) -> None:
        if self._closed:
            return
        display = self._pygame.display
        if display.get_surface() is None:  # at the first frame, or after a pygame.quit() elsewhere
            open_window(self.size, "hoof-env")
            self._window_open = True
        if any(event.type == self._pygame.QUIT for event in self._pygame.event.get()):
            self.close()
            return
        display.get_surface().blit(picture, (0, 0))
        display.flip()
        self._clock.tick(self.fps)


def open_window(size: tuple[int, int], title: str) -> Any:
    """Open pygame's window; return its surface.

    Without a display SDL falls back to an invisible driver: there is a warning, unless SDL_VIDEODRIVER
    selects it.

    Raises:
        HoofEnvError: no driver can be started.
    """
    import pygame

    advice = (
        "without one `hoof-env render` films, "
        'render_mode="rgb_array" gives pictures, xvfb-run or SDL_VIDEODRIVER=dummy draw unseen'
    )
    try:
        pygame.display.init()
        driver = pygame.display.get_driver()
        requested = os.environ.get("SDL_VIDEODRIVER", "").split(",")
        if driver in ("dummy", "offscreen") and driver not in requested:
            logger.warn(f"a window needs a display, and there is none: nobody sees this one; {advice}")
        window = pygame.display.set_mode(size)
    except pygame.error as error:
        raise HoofEnvError(f"a window needs a display, and none can be opened ({error}); {advice}") from None
    pygame.display.set_caption(title)
    return window


def _is_finite(now: BodyInstant) -> bool:
    """Return True if all numbers that the picture needs are finite."""
    of_legs = (sum(leg[:9]) + leg.force_x + leg.force_y for leg in now.legs)
    return math.isfinite(now.x + now.y + now.vx + now.vy + now.pitch + sum(of_legs))

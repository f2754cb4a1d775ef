"""Pictures of the substeps of a recording, which environments with a render mode return."""

from __future__ import annotations

from typing import Any

from hoof_env.episodes.batch import EpisodeBatch
from hoof_env.episodes.recording import Recording, surroundings_of
from hoof_env.record.instant import instants
from hoof_env.render.renderer import Renderer
from hoof_env.render.size import USUAL_SIZE


class DrawnRecording(Recording):
    """Substeps of one environment of a batch, and pictures of them.

    Attributes:
        size: width and height of pictures [pixels].
        renderer: renderer of the pictures, None before the first one.
    """

    def __init__(self, batch: EpisodeBatch, env: int = 0, size: tuple[int, int] = USUAL_SIZE) -> None:
        super().__init__(batch, env)
        self.size = size
        self.renderer: Renderer | None = None
        self._undrawn = 0  # number of ends since the last picture

    def begin(self) -> None:
        """Begin anew; see `Recording.begin`."""
        self._undrawn = 0
        super().begin()

    def add(self) -> None:
        """Save the memory at the end of a control step."""
        super().add()
        self._undrawn += 1

    def frame(self, mode: str, fps: float) -> Any:
        """Draw the substeps since the last picture, at most `recording.KEPT_SECONDS` of them. Return an array
        of shape (H, W, 3), None if the picture is drawn into a window.

        Args:
            mode: render mode, "rgb_array" or "human".
            fps: pictures per second.
        """
        if self.renderer is None:
            self.renderer = Renderer(surroundings_of(self.batch, self.env), mode, fps, self.size)
        if not self._ends:
            self.begin()
        # After the start of an episode, or more steps than it holds, the lines of the picture begin anew.
        if self._undrawn >= len(self._ends):
            self.renderer.reset()
        undrawn = min(self._undrawn, len(self._ends))
        if self.renderer.is_empty:
            undrawn = max(undrawn, 1)
        for k in range(-undrawn, 0):
            self.renderer.add(instants(self.columns(k), self.renderer.here.hips))
        self._undrawn = 0
        return self.renderer.frame()

    def close(self) -> None:
        """Release the engine, and close the window, if any."""
        super().close()
        if self.renderer is not None:
            self.renderer.close()
            self.renderer = None

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes without engine and window, which belong to this process and environment."""
        return super().__getstate__() | {"renderer": None}

"""Drive a leg, or a horse, by keyboard: `hoof-env play`.

`Game` is the whole of it without a window: it takes names of keys and advances an environment. `play` feeds
it from pygame's event loop and shows what the renderer draws, with the keys and the score below.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env import records
from hoof_env.errors import HoofEnvError, check_number, parse_pairs
from hoof_env.gait import PARAMETERS, GaitParameters

HELD = {
    "up": (0, 1), "down": (0, -1), "right": (1, 1), "left": (1, -1),
    "w": (2, 1), "s": (2, -1), "d": (3, 1), "a": (3, -1),
}  # fmt: skip
"""What a key does while it is held: which entry of the action it sets to 1, and with which sign."""

HELP = (
    (("up, down", "crank faster, slower"), ("left, right", "swing offset"), ("w, s", "swing sine")),
    (("a, d", "swing cosine"), ("1, 2 ...", "{gaits}"), ("0", "stop the crank")),
    (("space", "pause"), ("r", "start again"), ("q, esc", "quit")),
)
"""Three columns of keys and what they do, as the window says."""


class Game:
    """An environment driven by keys.

    Args:
        env: an environment of this package.
        seed: of the first episode; each further one takes the next.

    Attributes:
        action: of the last step, in [-1, 1]: four numbers, or those of each of a horse's legs.
        news: what happened since the last tick or restart.
        score: sum of the rewards of the episode, of all objectives alike.
        paused, ended, quit: whether it waits, the episode is over, or the player has left.
        why: how the episode ended, for people.
    """

    def __init__(self, env: Any, seed: int = 0) -> None:
        self._env, self._seed = env, seed
        self._leg: Any = env.unwrapped
        self.dt = records.surroundings(env).dt
        self.gaits: list[str] = sorted(self._leg.gaits)
        self._of_horse, self._gait = bool(records.surroundings(env).hips), ""
        self.paused = self.quit = False
        self.restart()

    def restart(self) -> None:
        """Begin a new episode with the gait that it starts in."""
        options = {"gait": self._gait} if self._gait else {}
        self._env.reset(seed=self._seed, options=options)
        self._seed += 1
        self.action: NDArray[np.float32] = np.zeros(self._env.action_space.shape, np.float32)
        self._wanted: Any = None
        self.news = self._happened()
        self.score = 0.0
        self.distance_from = self.news[0].x
        self.ended, self.why = False, ""
        self.begun = True

    def press(self, key: str) -> None:
        """A key went down; one that means nothing is ignored."""
        if key in ("q", "escape"):
            self.quit = True
        elif key == "r":
            self.restart()
        elif key == "space":
            self.paused = not self.paused
        elif key == "0":
            self._stop_the_crank()
        elif key.isdecimal() and 0 < int(key) <= len(self.gaits):
            self._gait = self.gaits[int(key) - 1]
            if self._of_horse:
                self.restart()
            else:
                self._wanted = self._leg.gaits[self._gait]

    def _stop_the_crank(self) -> None:
        """Keep the swing as it is; a horse's cranks cannot be stopped."""
        if not self._of_horse:
            state = self._leg.engine.state
            swing = (float(state[name][0, 0]) for name in PARAMETERS[1:])
            self._wanted = GaitParameters(0.0, *swing)

    def tick(self, held: Collection[str] = ()) -> None:
        """One control step with these keys held down; nothing moves while the game is paused or over."""
        self.news = []
        if self.paused or self.ended:
            return
        moves = [HELD[key] for key in held if key in HELD]
        if moves:
            self._wanted = None
        self.action = np.zeros_like(self.action)
        if self._wanted is not None:
            self.action = self._leg.action_for(self._wanted)
        for entry, way in moves:
            self.action[entry::4] = way  # of a horse in all legs alike
        _, reward, failed, truncated, info = self._env.step(self.action.copy())
        self.score += float(np.sum(reward))
        self.news = self._happened()
        self.ended = failed or truncated
        if self.ended:
            self.why = str(info.get("failure", "time is up"))

    @property
    def status(self) -> str:
        """What the game is doing, for people; empty while it runs."""
        if self.ended:
            return f"over: {self.why}; r starts again"
        return "paused; space goes on" if self.paused else ""

    def _happened(self) -> list[Any]:
        return records.instants_of(self._env, records.substeps(self._env))


def play(
    env_id: str,
    arguments: Sequence[str] = (),
    seed: int = 0,
    slow: float = 1.0,
    size: tuple[int, int] = (960, 540),
    most_ticks: int | None = None,
) -> Game:
    """Open a window and let a person play, `slow` times slower than life and `most_ticks` control steps at
    most; returns the game when it is left. Errors are those of `records.make_env` and
    `renderer.open_window`."""
    check_number("slow", slow, low=0.1, high=100)
    check_number("seed", seed, low=0)
    try:
        import pygame
    except ImportError:
        raise HoofEnvError('playing needs pygame-ce: pip install "hoof-env[render]"') from None
    from hoof_env.render.renderer import new_renderer, open_window

    with records.make_env(env_id, parse_pairs("--args", arguments)) as env:
        game = Game(env, seed)
        renderer = new_renderer(records.surroundings(env), 1 / game.dt, size)
        window = open_window((size[0], size[1] + _strip(size)), f"hoof-env play: {env_id}")
        try:
            clock = pygame.time.Clock()
            ticks = 0
            while not game.quit and (most_ticks is None or ticks < most_ticks):
                for event in pygame.event.get():
                    if event.type == pygame.QUIT:
                        game.quit = True
                    elif event.type == pygame.KEYDOWN:
                        game.press(pygame.key.name(event.key))
                if game.begun:  # an episode began
                    renderer.reset()
                    game.begun = False
                    renderer.add(game.news)
                down = pygame.key.get_pressed()
                game.tick([name for name in HELD if down[pygame.key.key_code(name)]])
                renderer.add(game.news)
                window.blit(renderer.draw(), (0, 0))
                _draw_strip(window, renderer, game, size)
                pygame.display.flip()
                clock.tick(1 / (game.dt * slow))
                ticks += 1
        finally:
            renderer.close()
            pygame.display.quit()
    return game


def _strip(size: tuple[int, int]) -> int:
    """Height of the strip with keys and score below a picture [pixels]."""
    return round(96 * min(size[0] / 960, size[1] / 540))


def _draw_strip(window: Any, renderer: Any, game: Game, size: tuple[int, int]) -> None:
    from hoof_env.render.brush import CRANK, FORCE, GREY, INK, PAPER

    brush = renderer.brush
    unit, top = brush.unit, size[1]
    window.fill(PAPER, (0, top, size[0], _strip(size)))
    rows = [top + y * unit for y in (20, 48, 76)]
    ahead = renderer.latest.x - game.distance_from
    for y, (text, colour) in zip(
        rows,
        (
            (f"score {game.score + 0.0:.2f}", INK),
            (f"way {ahead + 0.0:.2f} m", CRANK),
            (f"peak {renderer.stances.running_peak / 1000:.2f} kN", FORCE),
        ),
        strict=True,
    ):
        brush.write(window, text, (16 * unit, y), 25, colour)
    for column, left, width in zip(HELP, (190, 460, 760), (90, 66, 60), strict=True):
        for y, (keys, what) in zip(rows, column, strict=True):
            words = what.format(gaits=", ".join(game.gaits))
            brush.write(window, keys, (left * unit, y), 20, INK)
            brush.write(window, words, ((left + width) * unit, y), 20, GREY)
    if game.status:
        brush.write(window, game.status, (size[0] / 2, top - 20 * unit), 26, FORCE, "center")

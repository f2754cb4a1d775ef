"""The live page of `hoof-env view`, and pages that play a record without Python.

`simulation` plays an episode whose settings may change as it runs, `history` keeps the shown curves,
`figures` draws them, `tab` and `server` are the live page, and `playback` writes pages that stand alone.
Pages and films share instants and columns (`hoof_env.record`) and outlines (`hoof_env.render`).
"""

from pathlib import Path

from hoof_env.errors import HoofEnvError

try:
    Path.home()
except RuntimeError:
    # Bokeh asks for it when it is imported.
    raise HoofEnvError(
        "the page needs a home folder, where Bokeh looks for its settings, and this user has none: set HOME"
        " to a folder, as in HOME=. hoof-env view"
    ) from None

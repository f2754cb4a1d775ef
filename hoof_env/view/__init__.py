"""The live page of `hoof-env view`, and pages that play a record without Python.

`simulation` plays an episode that can be touched while it runs, `history` keeps what was shown, `drawing` and
`figures` say what is drawn, `tab` and `server` are the page, `playback` writes pages that stand alone. The
drawing data are those of films: instants and outlines of `hoof_env.render`, columns of `hoof_env.records`.
"""

"""Commands about a leg itself."""

from __future__ import annotations

import numpy as np

from hoof_env.commands.console import say


def lengths(preset: str | None = None) -> None:
    """Print how far each length of a leg can change alone, and how far its hoof reaches below the hip.

    Args:
        preset: the leg, a name or a JSON file; the package's default if left out.
    """
    from hoof_env.gait import GaitParameters, load_gait
    from hoof_env.leg.geometry import Geometry, load_geometry
    from hoof_env.leg.presets import DEFAULT_PRESET, read_preset
    from hoof_env.leg.ranges import length_ranges

    def reach(leg: Geometry, gait: GaitParameters) -> float:
        """Return the depth of the lowest foot below O in a turn of a gait [m]."""
        theta = np.linspace(0.0, 2 * np.pi, 181)
        offset, *waves = gait.to_array()[1:]
        swing = np.full_like(theta, offset)
        for order, (sine, cosine) in enumerate(zip(waves[::2], waves[1::2], strict=True), 1):
            swing += sine * np.sin(order * theta) + cosine * np.cos(order * theta)
        feet = [foot for foot in (leg.toe, leg.heel) if foot]
        poses = [leg.pose(at, turn) for at, turn in zip(theta, swing, strict=True)]
        return -min(float(pose.point(foot)[1]) for pose in poses for foot in feet)

    chosen = preset or DEFAULT_PRESET
    leg = load_geometry(chosen)
    say(f"{leg.name}: each length with the range in which the leg assembles while the others stay\n")
    for name, span in length_ranges(leg).items():
        change = f"{100 * (span.low / span.length - 1):+8.2f} % {100 * (span.high / span.length - 1):+8.2f} %"
        say(f"{name:6} {span.length:9.5f} m  {span.low:9.5f} to {span.high:9.5f} m  {change}")
    say(f"\nhip_height {leg.hip_height:.4g} m, of O above the ground")
    if "gaits" not in read_preset(chosen):
        return
    for name in read_preset(chosen)["gaits"]:
        depth = reach(leg, load_gait(name, chosen))
        say(f"{name}: the hoof reaches {depth:.4g} m below O, {depth / leg.hip_height:.2f} of hip_height")
    say(
        "Choose a hip_height below the reach: in the presets of this package it is 0.82 to 0.99 of it. The"
        "\nrest lifts the trunk or is pressed into the ground. To change several lengths, change one after"
        "\nthe other by small steps, and print the ranges again; Geometry.scaled changes all at once."
    )

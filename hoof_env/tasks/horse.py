"""The body of `Horse-v0`: a trunk on four legs, in the plane. `one_leg` is the other body there is.

A horse of 475 kg, its hips 1.4 m high. The legs are the linkage of the preset, scaled, with the segment
masses of Buchner and others (1997, see `leg.limb_masses`); springs of 24 kN/m at toe and heel give a limb
the stiffness of a horse's distal spring: 127 mm under 12.8 N/kg (McGuigan & Wilson 2003). Radius of gyration
and hips are assumed: the leg stands half a metre behind its crank centre, so that the fore feet are half a
metre before the trunk's centre and the hind feet 0.7 m behind.

A `size` other than 1 is a similar animal, with its motors and the filters of its commands: lengths go with
it, masses with its cube, stiffnesses with its square, speeds and times with its root, and all else by its
dimension. The ground's stiffness and the time steps are the world's and stay.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from itertools import product
from typing import Annotated, Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import FREE, GRAVITY, TRUNKS, Drive, HoofSpring, Limb, Limits, Motor, Trunk
from hoof_env.errors import ParameterError, check_choice, check_number, count
from hoof_env.gait import PARAMETERS, QUICK, WIDEST, FilterSettings
from hoof_env.ground.contact import Ground
from hoof_env.ground.terrain import Terrain
from hoof_env.leg.geometry import Geometry, load_geometry
from hoof_env.leg.limb_masses import with_limb_masses
from hoof_env.simd.layout import Block
from hoof_env.tasks.body import BodyKernels
from hoof_env.tasks.episode import ACTION, Episode
from hoof_env.tasks.horse_gaits import (
    ACTED,
    COUNT,
    LEGS,
    NAMES,
    SCRATCH_SIZE,
    GaitRows,
    checked_size,
    command_gait,
    commands_of,
    crank_angles,
    gait_numbers,
    horse_gaits,
    rates,
    refer_to_target,
    reference_constants,
    reference_gaits,
    reference_type,
    trunk_motion,
)
from hoof_env.tasks.leg_starts import (
    FLAT,
    Start,
    checked_options,
    hoof_points,
    start_anywhere,
    with_parameters,
)
from hoof_env.tasks.parameters import check_range, drive_of, ground_of
from hoof_env.tasks.settings import Settings

Floats = NDArray[np.float64]

HIP_HEIGHT = 1.4  # [m]
MASS = 475.0  # [kg]
GYRATION = 0.5  # radius of gyration of the trunk about its centre [m]
HIPS = {"fore": 1.0, "hind": -0.2}  # crank centres, forward from the trunk's centre [m]
STAND = -0.5  # of a hoof from its crank centre, in the middle of a stance [m]
PITCH = 0.5
HEIGHT = (0.75, 1.8)
CLEARANCE = 0.02
"""Where it has fallen: +-pitch [rad], heights of the trunk [m], of a joint over the ground [m]."""
GAP = 0.005  # between the lowest rigid hoof and the ground at a start [m]
HOOF_STIFFNESS = 24000.0  # of a horse of size 1, by default [N/m]
SAG = MASS * GRAVITY / (4 * HOOF_STIFFNESS)  # of two legs that bear the weight [m]
DEFAULT_MOTION: dict[str, Any] = {"vx": 1.0, "vy": 0.0, "pitch": 0.0, "pitch_rate": 0.0}
"""How a trunk starts in a gait that is not a reference gait."""

SPANS = (0.03, 0.04, 0.04, 0.04)
"""What actions of 1 change after a while: of the crank's speed [-], of the swing's offset, sine and cosine
[rad]."""

STEP_ERROR = 0.03
"""With 0.01 semi-implicit Euler would take three steps for a millisecond; speeds, peaks and duty factors of
the reference gaits are the same to a hundredth."""

FILTERS = {"quick": QUICK, "slow": FilterSettings()}  # of commands, by the setting `filters`

LEG_ONLY_SETTINGS = "trunk", "hip_height", "solver"
"""Settings of which a horse takes nothing but the default."""

OPTIONS = {
    "phase": (-1e6, 1e6), "speed": (-20.0, 20.0), "pitch": (-0.4, 0.4), "x": (-1e5, 1e5),
    "target_speed": (0.1, 20.0),
}  # fmt: skip
"""Numeric reset options and their ranges [strides, m/s, rad, m, m/s]; "gait" and "parameters" are the
others."""

COMMAND_STEP = 0.5
"""From one commanded speed to the next at most [m/s]: the reference gait changes at once with the command,
and after larger changes horses fall, see docs/evidence/horse.md."""

SPEED_SPREAD = 0.1
PITCH_SPREAD = 0.02
PHASE_SPREAD = 0.02
"""How far starts are from the gait: of the commanded speed [-], pitch [rad], each crank [strides]."""


class HorseEpisode(Episode):
    """Memory of an episode of a horse."""

    gait: GaitRows  # around which its actions lie
    offset: Annotated[Block, ACTION]  # what actions have made of it so far, 1 is the whole span


HORSE_KERNELS = BodyKernels(
    legs=COUNT,
    episode=HorseEpisode,
    task_fields=tuple(reference_type()),
    scratch_size=SCRATCH_SIZE,
    command=command_gait,
    on_switch=refer_to_target,
)

POLICIES = ("reference", "random", "bang-bang")
"""Names of the scripted policies."""


class Horse:
    """Four legs on a free trunk.

    Attributes:
        size, speed_scale: its length over that of a horse of 475 kg, and its speed likewise [-].
        gaits: that were found, as an animal of this size has them, by name.
        gait: around which actions lie whatever speed is commanded; None for those of `reference_gaits`.
        hips: places of the crank centres on the trunk [m], by leg.
        harmonics, filters, limits, step_error: of the engine.
        command_step: from one commanded speed to the next at most [m/s].
        start_names, gait_names: of what an episode starts with.
        action_names: of its actions, leg after leg.
    """

    kernels = HORSE_KERNELS
    leg_prefixes: tuple[str, ...] = tuple(f"{leg}_" for leg in LEGS)
    finite_fields: tuple[str, ...] = ("gait",)
    action_names: tuple[str, ...] = tuple(f"{leg}_{name}" for leg, name in product(LEGS, PARAMETERS))
    action_form = "offsets"
    step_error = STEP_ERROR
    start_names: tuple[str, ...] = ("phase", "speed", "pitch", "x")
    gait_names: tuple[str, ...] = NAMES

    def __init__(self, settings: Settings) -> None:
        s = settings
        self.size = checked_size(s.size)
        self.speed_scale = math.sqrt(self.size)
        if s.trunk != TRUNKS[FREE]:
            raise ParameterError(f'trunk: expected "free" of a horse, got {s.trunk!r}')
        self.geometry = load_geometry(s.preset)
        self.geometry = self.geometry.scaled(HIP_HEIGHT * self.size / self.geometry.hip_height)
        self.height = HIP_HEIGHT * self.size
        self.hips: Mapping[str, tuple[float, float]] = {
            leg: (HIPS[leg.partition("_")[2]] * self.size, 0.0) for leg in LEGS
        }
        self.gaits: Mapping[str, Any] = {
            name: gait.of_size(self.size) for name, gait in horse_gaits().items()
        }
        self.gait = None if s.gait is None else self.gaits[check_choice("gait", s.gait, self.gaits)]
        self.harmonics = 2 if s.harmonics is None else count("harmonics", s.harmonics, most=2)
        filters = "quick" if s.filters is None else check_choice("filters", s.filters, FILTERS)
        self.filters = FILTERS[filters].sped_up(1 / self.speed_scale)
        if s.hip_height is not None:
            raise ParameterError(
                f"hip_height: expected none of a horse, whose `size` it is, got {s.hip_height!r}"
            )
        self.command_step = COMMAND_STEP * self.speed_scale
        self.lowest, self.highest = (self.size * height for height in HEIGHT)
        spring = self._spring(s)
        self._softness = 0.0 if spring is None else HOOF_STIFFNESS * self.size**2 / spring.stiffness
        self.limits: Limits | None = Limits(
            (-PITCH, PITCH), (self.lowest, self.highest), CLEARANCE * self.size
        )

    def parts(self, s: Settings) -> tuple[Trunk, Ground, tuple[Limb, ...]]:
        """Trunk, ground and legs of some settings."""
        size = self.size
        mass = check_number("trunk_mass", s.trunk_mass, low=0, exclusive_low=True) * size**3
        inertia = mass * (GYRATION * size) ** 2
        trunk = Trunk("free", mass, drag=0.0, height=self.height, pitch_inertia=inertia)
        drive = self._drive(s)
        spring = self._spring(s)
        fore, hind = (
            Limb(_limb(self.geometry, pair, MASS * size**3), self.hips[f"left_{pair}"], drive, spring)
            for pair in HIPS
        )
        return trunk, self._ground(s, mass), (fore, fore, hind, hind)

    def _drive(self, s: Settings) -> Drive:
        drive = drive_of(s)
        size = self.size
        if not isinstance(drive, Motor):
            return drive
        return replace(
            drive, speed_gain=drive.speed_gain * size**4.5, torque_limit=drive.torque_limit * size**4,
            rotor_inertia=drive.rotor_inertia * size**5,
        )  # fmt: skip

    def _ground(self, s: Settings, mass: float) -> Ground:
        """The world's ground; only the speeds below which its laws are softened are the animal's."""
        ground = ground_of(s, mass)
        names = "approach_floor", "friction_slow", "friction_fast"
        return replace(ground, **{name: self.speed_scale * getattr(ground, name) for name in names})

    def _spring(self, s: Settings) -> HoofSpring | None:
        if s.hoof_stiffness is None:
            if s.hoof_damping is not None:
                raise ParameterError(
                    f"hoof_damping: expected a hoof_stiffness beside it, got {s.hoof_damping!r}"
                )
            return None
        stiffness = check_number("hoof_stiffness", s.hoof_stiffness, low=0, exclusive_low=True)
        if s.hoof_damping is None:
            damping = HoofSpring.with_ratio(stiffness, MASS / COUNT).damping
        else:
            damping = check_number("hoof_damping", s.hoof_damping, low=0, exclusive_low=True)
        return HoofSpring(stiffness * self.size**2, damping * self.size**2.5)

    def commanded_speeds(self, s: Settings) -> tuple[float, float]:
        """Lowest and highest commanded speed [m/s]."""
        return check_range("target_speed", s.target_speed, 0.1)

    def constants(self, engine: TrunkEngine, dt: float) -> dict[str, Any]:
        """Of the task's record: spans of actions and bounds of commands."""
        gait = 2 + 2 * self.harmonics
        low, high = np.transpose([*list(WIDEST.values())[:4], *[WIDEST["higher"]] * (gait - 4)])
        high[0] = rates(self.size)[1]
        half = np.zeros(gait)
        half[:ACTED] = SPANS
        return {
            "half": half, "low": low, "high": high, "height": self.height,
            "lowest": -np.inf, "highest": np.inf,  # the engine's own limits end episodes
            **reference_constants(self.speed_scale, follows=self.gait is None),
        }  # fmt: skip

    # Starts

    def check_options(self, options: Any, trunk: Trunk, settings: Settings) -> dict[str, Any]:
        """Reset options with their values checked; `ParameterError` of others."""
        checked = checked_options(options, OPTIONS)
        if checked.get("gait") is not None:
            checked["gait"] = gait_numbers("options['gait']", checked["gait"], self.gaits, self.size)
        return with_parameters(checked, settings)

    def draw(
        self, options: Mapping[str, Any], generators: Sequence[np.random.Generator], engine: TrunkEngine
    ) -> Start:
        """Starts of episodes, one for each generator, but for what the options fix: in the stride of the gait
        that `complete_start` takes, each crank, speed and pitch a little off."""
        n = len(generators)
        drawn = np.array([generator.random(3 + COUNT) for generator in generators])
        off = 2 * drawn - 1
        begun = {
            "phase": drawn[:, 0], "speed": 1 + SPEED_SPREAD * off[:, 1], "pitch": PITCH_SPREAD * off[:, 2],
            "x": np.zeros(n),
        }  # fmt: skip
        if engine.terrain != FLAT:
            begun["x"] = start_anywhere(engine.terrain, begun["x"], options, generators)
        begun |= {name: np.full(n, options[name]) for name in begun if name in options}
        commands = np.zeros((COUNT, 2 + 2 * self.harmonics, n))
        theta = PHASE_SPREAD * off[:, 3:].T
        return Start(begun, np.empty(0), commands, theta, {})

    def complete_start(
        self, start: Start, targets: Floats, options: Mapping[str, Any], engine: TrunkEngine
    ) -> None:
        """Complete starts with the gaits of the commanded speeds [m/s]. In a reference gait the trunk moves
        as it does in that, along the ground between its feet; in others it is as low as the springs of two
        legs give under the weight."""
        begun = start.values
        own = options.get("gait")
        start.gaits = self.reference(targets, own)
        start.theta[:] = crank_angles(start.gaits, begun["phase"], start.theta)
        start.commands[:] = commands_of(start.gaits, start.theta, start.commands.shape[1])
        is_known = own is None and self.gait is None
        motion = trunk_motion(targets / self.speed_scale, begun["phase"]) if is_known else DEFAULT_MOTION
        slope = self._slope(engine.terrain, begun["x"])
        if "speed" not in options:
            begun["speed"] = begun["speed"] * targets * motion["vx"]
        if "pitch" not in options:
            begun["pitch"] = begun["pitch"] + motion["pitch"] + slope
        x, y = self._hoofs(start, begun["pitch"], engine)
        hoof = (y * np.cos(slope) - x * np.sin(slope)).min((0, 1))
        # of the lowest hoof over the slope; below it is what the springs have given
        lift = hoof + self.height * motion["y"] if is_known else np.full(len(hoof), -SAG * self.size)
        lift = np.where(lift < 0, self._softness * lift, lift) + (0 if self._softness else GAP * self.size)
        ground = engine.terrain.height_at(begun["x"] + x)
        rate = start.gaits[:, 0]
        start.trunk = {
            "x": begun["x"], "y": (ground - y).max((0, 1)) + lift / np.cos(slope), "vx": begun["speed"],
            "vy": self.height * rate * motion["vy"] + begun["speed"] * np.tan(slope), "pitch": begun["pitch"],
            "pitch_rate": rate * motion["pitch_rate"],
        }  # fmt: skip

    @property
    def policy_names(self) -> list[str]:
        """Names of the scripted policies."""
        return list(POLICIES)

    def begin_episodes(self, episode: Any, which: NDArray[np.int64], start: Start) -> None:
        """Write the gaits around which actions lie, and offsets of 0."""
        episode.gait[:, which] = start.gaits.T
        episode.offset[:, which] = 0.0

    def _slope(self, terrain: Terrain, x: Floats) -> Floats:
        """Of the ground from the hind feet to the fore feet of animals at `x` [rad]."""
        fore, hind = ((HIPS[pair] + STAND) * self.size for pair in ("fore", "hind"))
        return np.arctan2(terrain.height_at(x + fore) - terrain.height_at(x + hind), fore - hind)

    def _hoofs(self, start: Start, pitch: Floats, engine: TrunkEngine) -> tuple[Floats, Floats]:
        """x and y of all toes and heels from the centre of trunks that pitch so [rad], in metres, shape
        (4, 2, n) each."""
        found = []
        n = len(pitch)
        for k in range(0, COUNT, 2):  # the legs of a pair have one profile and one hip
            gaits = np.concatenate(start.commands[k : k + 2], axis=1).T
            angles = start.theta[k : k + 2].ravel()
            turn = np.tile(pitch * self.geometry.travel, 2)
            points = hoof_points(engine.profiles[k], gaits, angles, turn)
            hip = engine.limbs[k].hip[0] * np.array([np.cos(pitch), np.sin(pitch)])
            found.append([at + of.reshape(2, 2, n) for at, of in zip(hip, points, strict=True)])
        x, y = np.array(found).transpose(1, 0, 3, 2, 4).reshape(2, COUNT, 2, n)
        return x, y

    # Gaits

    def reference(self, targets: Floats, given: Any = None) -> Floats:
        """Numbers of the gaits around which actions lie at commanded speeds [m/s], shape (n, 16)."""
        own = self.gait if given is None else given
        if own is not None:
            numbers = gait_numbers("gait", own, self.gaits, self.size)
            return np.array(np.broadcast_to(numbers, (len(targets), len(NAMES))))
        found = reference_gaits(np.asarray(targets) / self.speed_scale)
        found[:, 0] /= self.speed_scale
        return found

    def action_for(self, gait: Any, engine: TrunkEngine, dt: float) -> NoReturn:
        """There is none: `ParameterError`."""
        raise ParameterError(
            "action_for: expected an environment of one leg; actions of a horse lie around a gait, zeros are"
            f" that gait, and the argument gait= makes it one of {', '.join(self.gaits)}"
        )


@cache
def _limb(geometry: Geometry, pair: str, mass: float) -> Geometry:
    return with_limb_masses(geometry, pair, mass)

"""Body of `Horse-v0`: a trunk on four legs, in the plane. The body of one leg is in `one_leg`.

The horse has a mass of 475 kg and its hips are 1.4 m high. Its legs are the linkage of the preset, scaled,
with the segment masses of Buchner and others (1997; see `leg.limb_masses`). Springs of 24 kN/m at toe and
heel give a limb the stiffness of a horse's distal spring: 127 mm under 12.8 N/kg (McGuigan & Wilson 2003).
Radius of gyration and hips are assumed: the leg stands half a metre behind its crank centre, so that the fore
feet are half a metre before the trunk's centre and the hind feet 0.7 m behind.

A `size` other than 1 is a similar animal, motors and command filters included: lengths are proportional to
the size, masses to its cube, stiffnesses to its square, speeds and times to its root, and all other
quantities follow from their dimension. The ground's stiffness and the time steps do not scale.
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

from hoof_env.constants import GRAVITY
from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Drive, HoofSpring, Limb, Limits, Motor, Trunk
from hoof_env.errors import ParameterError, brief, check_choice, check_number, count
from hoof_env.gait import PARAMETERS, QUICK, WIDEST, FilterSettings
from hoof_env.ground.contact import Ground
from hoof_env.ground.terrain import Terrain
from hoof_env.leg.geometry import Geometry, load_geometry
from hoof_env.leg.limb_masses import with_limb_masses
from hoof_env.leg.mechanism_list import PAPER
from hoof_env.leg.presets import Preset, preset_label
from hoof_env.record.surroundings import Hips
from hoof_env.simd.layout import Block
from hoof_env.tasks.body import BodyKernels
from hoof_env.tasks.disturbances import MAX_STRENGTH
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
    kinematic_phases,
    kinematic_speeds,
    offset_name,
    part_followed,
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
from hoof_env.tasks.settings import ResolvedSettings, Settings

Floats = NDArray[np.float64]

HIP_HEIGHT = 1.4  # [m]
MASS = 475.0  # [kg]
GYRATION = 0.5  # radius of gyration of the trunk about its centre [m]
HIPS = {"fore": 1.0, "hind": -0.2}  # crank centres, forward from the trunk's centre [m]
STAND = -0.5  # x of a hoof from its crank centre, in the middle of a stance [m]
PITCH = 0.5
HEIGHT = (0.75, 1.8)
CLEARANCE = 0.02
"""Limits beyond which a horse has fallen: +-pitch [rad], lowest and highest trunk [m], lowest joint above the
ground [m]."""
GAP = 0.005  # clearance of the lowest rigid hoof at a start [m]
HOOF_STIFFNESS = 24000.0  # default for a horse of size 1 [N/m]
POWERS = {
    "trunk_mass": 3,
    "hoof_stiffness": 2,
    "hoof_damping": 2.5,
    "motor_gain": 4.5,
    "motor_torque": 4,
    "motor_inertia": 5,
}
"""Power of the size by which the settings that are given at size 1 grow. Torque is weight times length,
inertia mass times length squared; a gain is torque times time, damping stiffness times time."""
# Two legs with two hoof points each bear the weight.
SAG = MASS * GRAVITY / (4 * HOOF_STIFFNESS)  # compression of the springs at a start [m]
DEFAULT_MOTION: dict[str, Any] = {"vx": 1.0, "vy": 0.0, "pitch": 0.0, "pitch_rate": 0.0}
"""Motion of the trunk at a start in a gait that is not a reference gait, scaled as by `trunk_motion`."""

SPANS = (0.4, 0.04, 0.04, 0.04)
"""Changes under a constant action of 1: of the crank's speed [-], of the swing's offset, sine and cosine
coefficient [rad]. They are wide enough for the best known agents. With `COUPLING` the first updates of a
learner cost little, see docs/evidence/actions.md."""

PHASE_SPAN = 0.25
"""Shift of a leg's phase under a constant action of 1 where the footfall is free [strides]: two legs can be
half a stride away from where the gait has them, which is any footfall."""

STEP_ERROR = 0.03
"""Error after a contact for which the engine chooses its step [-]. With 0.01 semi-implicit Euler would take
three steps for a millisecond; speeds, peaks and duty factors of the reference gaits are the same to a
hundredth."""

FILTERS = {"quick": QUICK, "slow": FilterSettings()}  # command filters, by the setting `filters`
FOOTFALLS = ("fixed", "free")  # values of the setting `footfall`

LEG_ONLY_SETTINGS = "trunk", "hip_height", "hoof_length", "solver"
"""Settings of which a horse accepts only the default."""

OPTIONS = {
    "phase": (-1e6, 1e6),
    "speed": (-20.0, 20.0),
    "pitch": (-0.4, 0.4),
    "x": (-1e5, 1e5),
    "target_speed": (0.1, 20.0),
    "strength": (0.0, MAX_STRENGTH),
}
"""Numeric reset options and their ranges [strides, m/s, rad, m, m/s, -]; "gait", "parameters" and "pushes"
are not numeric."""

COMMAND_STEP = 0.5
"""Largest change from one commanded speed to the next [m/s]: the reference gait changes at once with the
command, and after larger changes horses fall, see docs/evidence/horse.md."""

SPEED_SPREAD = 0.1
PITCH_SPREAD = 0.02
PHASE_SPREAD = 0.02
"""Largest deviations of a start from its gait: of the speed relative to the commanded one [-], of the pitch
[rad], of each crank [strides]."""


class HorseEpisode(Episode):
    """Memory of an episode of a horse."""

    gait: GaitRows  # gait to which actions add offsets
    offset: Annotated[Block, ACTION]  # sum of the actions' offsets so far, in units of `SPANS`


HORSE_KERNELS = BodyKernels(
    legs=COUNT,
    episode=HorseEpisode,
    task_fields=(("is_free", "?"), ("followed", "f8"), *reference_type()),
    scratch_size=SCRATCH_SIZE,
    command=command_gait,
    on_switch=refer_to_target,
)

POLICIES = ("reference", "zero", "random", "bang-bang")
"""Names of the scripted policies."""


class Horse:
    """Four legs on a free trunk; see `body.Body`.

    Attributes:
        size: length relative to a horse of 475 kg [-].
        speed_scale: speed relative to a horse of 475 kg, the root of the size [-].
        gaits: stored gaits by name, converted to the size of the animal.
        policy_starts: see `body.Body`; of kinematic gaits.
        gait: gait to which actions add offsets at all commanded speeds; None for `reference_gaits`.
        is_free: True if the first action of a leg shifts its phase, False if it scales its crank's speed.
        lowest, highest: heights of the trunk beyond which the animal has fallen [m].

    Raises:
        ParameterError: a setting is out of range, or a horse does not accept it.
    """

    kernels = HORSE_KERNELS
    picture = "horse"
    step_error = STEP_ERROR
    start_names: tuple[str, ...] = ("phase", "speed", "pitch", "x")
    gait_names: tuple[str, ...] = NAMES

    def __init__(self, settings: Settings) -> None:
        s = settings
        self.size = checked_size(s.size)
        self.speed_scale = math.sqrt(self.size)
        if s.trunk != "free":
            raise ParameterError(f'trunk: expected "free" for a horse, got {brief(s.trunk)}')
        self.geometry = _leg_of(s.preset, self.size)
        self.height = HIP_HEIGHT * self.size
        self.hips: Hips = {f"{leg}_": (HIPS[leg.partition("_")[2]] * self.size, 0.0) for leg in LEGS}
        self.gaits: Mapping[str, Any] = {
            name: gait.of_size(self.size) for name, gait in horse_gaits().items()
        }
        self.policy_starts: Mapping[str, dict[str, Any]] = {
            name: {"gait": name, "target_speed": speed * self.speed_scale}
            for name, speed in kinematic_speeds().items()
        }
        for name, phase in kinematic_phases().items():
            self.policy_starts[name]["phase"] = phase
        self.gait = None if s.gait is None else self.gaits[check_choice("gait", s.gait, self.gaits)]
        self.harmonics = 2 if s.harmonics is None else count("harmonics", s.harmonics, most=2)
        filters = "quick" if s.filters is None else check_choice("filters", s.filters, FILTERS)
        self.filters = FILTERS[filters].sped_up(1 / self.speed_scale)
        footfall = "fixed" if s.footfall is None else check_choice("footfall", s.footfall, FOOTFALLS)
        self.is_free = footfall == "free"
        names = ("phase", *PARAMETERS[1:]) if self.is_free else PARAMETERS
        self.action_names: tuple[str, ...] = tuple(f"{leg}_{name}" for leg, name in product(LEGS, names))
        # The offset of the first action is in what that action moves
        self.renamed: Mapping[str, str] = {
            offset_name(leg, old): offset_name(leg, new)
            for leg, (old, new) in product(LEGS, zip(PARAMETERS, names, strict=True))
            if old != new
        }
        # The spans are in the tag, so that policies, states and datasets with different spans are refused.
        first = f"{PHASE_SPAN:g} strides" if self.is_free else f"{SPANS[0]:g}"
        self.action_form = f"offsets of {first} and {SPANS[1]:g} rad"
        if s.hip_height is not None:
            raise ParameterError(
                f"hip_height: expected `size` in place of it for a horse, got {brief(s.hip_height)}"
            )
        if s.hoof_length:
            raise ParameterError(
                f"hoof_length: expected 0 for a horse, whose gaits were found with hooves that sink, got "
                f"{brief(s.hoof_length)}"
            )
        self.command_step = COMMAND_STEP * self.speed_scale
        self.lowest, self.highest = (self.size * height for height in HEIGHT)
        spring = self._spring(s)
        # The sag at a start is proportional to it; 0 for rigid hooves.
        self._softness = 0.0 if spring is None else HOOF_STIFFNESS * self.size**2 / spring.stiffness
        self.limits: Limits | None = Limits(
            (-PITCH, PITCH), (self.lowest, self.highest), CLEARANCE * self.size
        )

    def scale_of(self, name: str) -> float:
        """Return the ratio of the animal's own value of a setting to its value at size 1, see `POWERS`."""
        return float(self.size ** POWERS.get(name, 0))

    def parts(self, s: ResolvedSettings) -> tuple[Trunk, Ground, tuple[Limb, ...]]:
        """Make trunk, ground and legs from settings; see `Body.parts`."""
        size = self.size
        given = check_number("trunk_mass", s.trunk_mass, low=0, exclusive_low=True)
        mass = given * self.scale_of("trunk_mass")
        # The legs keep their masses: `trunk_mass` is the mass of the trunk alone, which a reset may draw.
        inertia = mass * (GYRATION * size) ** 2
        trunk = Trunk("free", mass, drag=0.0, height=self.height, pitch_inertia=inertia)
        drive = self._drive(s)
        spring = self._spring(s)
        fore, hind = (
            Limb(_limb(self.geometry, pair, MASS * size**3), self.hips[f"left_{pair}_"], drive, spring)
            for pair in HIPS
        )
        return trunk, self._ground(s, mass), (fore, fore, hind, hind)

    def _drive(self, s: Settings) -> Drive:
        drive = drive_of(s)
        if not isinstance(drive, Motor):
            return drive
        return replace(
            drive,
            speed_gain=drive.speed_gain * self.scale_of("motor_gain"),
            torque_limit=drive.torque_limit * self.scale_of("motor_torque"),
            rotor_inertia=drive.rotor_inertia * self.scale_of("motor_inertia"),
        )

    def _ground(self, s: ResolvedSettings, mass: float) -> Ground:
        """Make the ground: only the threshold speeds of its laws scale with the animal."""
        ground = ground_of(s, mass)
        names = "approach_floor", "friction_slow", "friction_fast"
        return replace(ground, **{name: self.speed_scale * getattr(ground, name) for name in names})

    def _spring(self, s: Settings) -> HoofSpring | None:
        if s.hoof_stiffness is None:
            if s.hoof_damping is not None:
                raise ParameterError(
                    f"hoof_damping: expected a hoof_stiffness with it, got {brief(s.hoof_damping)}"
                )
            return None
        stiffness = check_number("hoof_stiffness", s.hoof_stiffness, low=0, exclusive_low=True)
        if s.hoof_damping is None:
            damping = HoofSpring.with_ratio(stiffness, MASS / COUNT).damping
        else:
            damping = check_number("hoof_damping", s.hoof_damping, low=0, exclusive_low=True)
        return HoofSpring(
            stiffness * self.scale_of("hoof_stiffness"), damping * self.scale_of("hoof_damping")
        )

    def commanded_speeds(self, s: Settings) -> tuple[float, float]:
        """Return the lowest and highest commanded speed [m/s]."""
        return check_range("target_speed", s.target_speed, *OPTIONS["target_speed"])

    def constants(self, engine: TrunkEngine, dt: float) -> dict[str, Any]:
        """Return the body's part of the task's record: spans of actions, bounds of commands, and the
        reference gaits."""
        gait = 2 + 2 * self.harmonics
        low, high = np.transpose([*list(WIDEST.values())[:4], *[WIDEST["higher"]] * (gait - 4)])
        high[0] = rates(self.size)[1]
        half = np.zeros(gait)
        half[:ACTED] = SPANS
        if self.is_free:
            half[0] = PHASE_SPAN
        return {
            "half": half,
            "low": low,
            "high": high,
            "height": self.height,
            # The engine's own limits end episodes; see `Horse.limits`.
            "lowest": -np.inf,
            "highest": np.inf,
            "is_free": self.is_free,
            "followed": part_followed(dt / self.speed_scale),
            **reference_constants(self.speed_scale, follows=self.gait is None),
        }

    # Starts

    def check_options(self, options: Any, trunk: Trunk, settings: Settings) -> dict[str, Any]:
        """Check reset options; return them with numbers and gaits converted.

        Raises:
            ParameterError: an unknown option or a bad value.
        """
        checked = checked_options(options, OPTIONS)
        if checked.get("gait") is not None:
            checked["gait"] = gait_numbers("options['gait']", checked["gait"], self.gaits, self.size)
        return with_parameters(checked, settings)

    def startable_share(self, options: Mapping[str, Any], trunk: Trunk) -> float:
        """Return 1: a horse starts in its gait at any crank angle."""
        return 1.0

    def draw(
        self, options: Mapping[str, Any], generators: Sequence[np.random.Generator], engine: TrunkEngine
    ) -> Start:
        """Draw the phase of the stride, and small deviations of speed, pitch and cranks, one start for each
        generator; `complete_start` adds them to the gait. Options replace drawn values."""
        n = len(generators)
        # All numbers are drawn whatever the options are, so that an option does not change the others.
        drawn = np.array([generator.random(3 + COUNT) for generator in generators])
        off = 2 * drawn - 1
        values = {
            "phase": drawn[:, 0],
            "speed": 1 + SPEED_SPREAD * off[:, 1],
            "pitch": PITCH_SPREAD * off[:, 2],
            "x": np.zeros(n),
        }
        if engine.terrain != FLAT:
            values["x"] = start_anywhere(engine.terrain, values["x"], options, generators)
        values |= {name: np.full(n, options[name]) for name in values if name in options}
        commands = np.zeros((COUNT, 2 + 2 * self.harmonics, n))
        theta = PHASE_SPREAD * off[:, 3:].T
        return Start(values, np.empty(0), commands, theta, {})

    def complete_start(
        self, start: Start, targets: Floats, options: Mapping[str, Any], engine: TrunkEngine
    ) -> None:
        """Complete starts with the gaits of the commanded speeds [m/s], shape (n,). In a reference gait the
        trunk starts with the stored motion, along the ground between the feet. In other gaits it starts at
        the height at which the springs of two legs bear the weight."""
        values = start.values
        option = options.get("gait")
        start.gaits = self.reference(targets, option)
        start.theta[:] = crank_angles(start.gaits, values["phase"], start.theta)
        start.commands[:] = commands_of(start.gaits, start.theta, start.commands.shape[1])
        is_known = option is None and self.gait is None
        motion = trunk_motion(targets / self.speed_scale, values["phase"]) if is_known else DEFAULT_MOTION
        slope = self._slope(engine.terrain, values["x"])
        # Until here speed and pitch are deviations; see `draw`.
        if "speed" not in options:
            values["speed"] = values["speed"] * targets * motion["vx"]
        if "pitch" not in options:
            values["pitch"] = values["pitch"] + motion["pitch"] + slope
        x, y = self._hoofs(start, values["pitch"], engine)
        hoof = (y * np.cos(slope) - x * np.sin(slope)).min((0, 1))
        # Height of the lowest hoof over the slope; below it is the compression of the springs.
        lift = hoof + self.height * motion["y"] if is_known else np.full(len(hoof), -SAG * self.size)
        # A rigid hoof starts above the ground, so that no episode starts in contact.
        lift = np.where(lift < 0, self._softness * lift, lift) + (0 if self._softness else GAP * self.size)
        ground = engine.terrain.height_at(values["x"] + x)
        rate = start.gaits[:, 0]
        start.trunk = {
            "x": values["x"],
            "y": (ground - y).max((0, 1)) + lift / np.cos(slope),
            "vx": values["speed"],
            "vy": self.height * rate * motion["vy"] + values["speed"] * np.tan(slope),
            "pitch": values["pitch"],
            "pitch_rate": rate * motion["pitch_rate"],
        }

    @property
    def policy_names(self) -> list[str]:
        """Names of the scripted policies: `POLICIES`, then the kinematic gaits."""
        return [*POLICIES, *self.policy_starts]

    def begin_episodes(self, episode: Any, which: NDArray[np.int64], start: Start) -> None:
        """Write the gaits from which actions make offsets, and offsets of 0."""
        episode.gait[:, which] = start.gaits.T
        episode.offset[:, which] = 0.0

    def _slope(self, terrain: Terrain, x: Floats) -> Floats:
        """Return the slope of the ground between hind and fore feet of animals at `x` [rad], shape (n,)."""
        fore, hind = ((HIPS[pair] + STAND) * self.size for pair in ("fore", "hind"))
        return np.arctan2(terrain.height_at(x + fore) - terrain.height_at(x + hind), fore - hind)

    def _hoofs(self, start: Start, pitch: Floats, engine: TrunkEngine) -> tuple[Floats, Floats]:
        """Return x and y of all toes and heels relative to the trunk's centre [m], shape (4, 2, n) each, for
        pitches [rad], shape (n,)."""
        of_pairs = []
        n = len(pitch)
        # The legs of a pair have the same profile and hip: one call for both.
        for k in range(0, COUNT, 2):
            gaits = np.concatenate(start.commands[k : k + 2], axis=1).T
            angles = start.theta[k : k + 2].ravel()
            turn = np.tile(pitch * self.geometry.travel, 2)
            points = hoof_points(engine.profiles[k], gaits, angles, turn)
            hip = engine.limbs[k].hip[0] * np.array([np.cos(pitch), np.sin(pitch)])
            of_pairs.append([at + of.reshape(2, 2, n) for at, of in zip(hip, points, strict=True)])
        x, y = np.array(of_pairs).transpose(1, 0, 3, 2, 4).reshape(2, COUNT, 2, n)
        return x, y

    # Gaits

    def reference(self, targets: Floats, given: Any = None) -> Floats:
        """Return the numbers of the gaits from which actions make offsets at commanded speeds [m/s], shape
        (n, 16): `given`, else `gait`, else the reference gaits."""
        fixed = self.gait if given is None else given
        if fixed is not None:
            numbers = gait_numbers("gait", fixed, self.gaits, self.size)
            return np.array(np.broadcast_to(numbers, (len(targets), len(NAMES))))
        # Stored for a horse of size 1: similar animals have the same gait at the same Froude number.
        gaits = reference_gaits(np.asarray(targets) / self.speed_scale)
        gaits[:, 0] /= self.speed_scale
        return gaits

    def action_for(self, gait: Any, engine: TrunkEngine, dt: float) -> NoReturn:
        """Raise `ParameterError`: actions of a horse are offsets and do not move towards a gait."""
        raise ParameterError(
            "action_for: expected an environment of one leg; actions of a horse lie around a gait, zeros are"
            f" that gait, and the argument gait= makes it one of {', '.join(self.gaits)}"
        )


def _leg_of(preset: Preset, size: float) -> Geometry:
    """Return the leg of a preset as tall as a horse of a size; `ParameterError` for another mechanism."""
    geometry = load_geometry(preset)
    if geometry.mechanism != PAPER:
        raise ParameterError(
            f"preset: expected a leg of the paper's mechanism under a horse, got {preset_label(preset)}"
        )
    return geometry.scaled(HIP_HEIGHT * size / geometry.hip_height)


# Cached, because `parts` is called for every drawn set of parameters.
@cache
def _limb(geometry: Geometry, pair: str, mass: float) -> Geometry:
    """Return a leg with the segment masses of a fore or hind limb, for a mass of the animal [kg]."""
    return with_limb_masses(geometry, pair, mass)

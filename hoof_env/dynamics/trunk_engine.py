"""N legs on one trunk in minimal coordinates, for any number of environments at once: the fast, exact engine.

What can move is integrated: the trunk, as momentum and centre of mass of all bodies together, and the crank of every
leg whose drive is a motor. Everything inside a leg follows from its crank angle in closed form, so loops are closed
to round-off at every step of any run. `lanes` holds the mechanics, `advance` runs it; this module is the border:
checks, settings, state. A number has the same bits alone and in a batch of any size.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hoof_env.dynamics import limb_rows as b
from hoof_env.dynamics import trunk_rows as t
from hoof_env.dynamics.advance import (
    Arrays,
    Model,
    advance_batch,
    advance_four_legs,
    advance_one_leg,
    react_batch,
    react_four_legs,
    react_one_leg,
)
from hoof_env.dynamics.drive import Motor
from hoof_env.dynamics.engine import GRAVITY
from hoof_env.dynamics.lanes_report import ACCOUNT, LIMB_REPORT, TRUNK_REPORT
from hoof_env.dynamics.limb import Limb
from hoof_env.dynamics.reactions import DRIVER, HIP, LOCK, OUTPUTS, leg_constants
from hoof_env.dynamics.result import Result
from hoof_env.dynamics.schemes import SCHEMES
from hoof_env.dynamics.step_length import StepWarning, longest_steps
from hoof_env.dynamics.tally import Tally, tally
from hoof_env.dynamics.trunk import FREE, RAIL, SUSPENDED, TRUNKS, Trunk
from hoof_env.errors import ParameterError, check_choice, check_number
from hoof_env.gait.motion_law import FilterSettings
from hoof_env.gait.parameters import GaitParameters
from hoof_env.ground.contact import Ground
from hoof_env.ground.exact_math import EXPONENT_UNIT
from hoof_env.ground.friction import FRICTION_LAWS
from hoof_env.ground.terrain import Terrain
from hoof_env.leg.profile import LegProfile

FEW = 6
"""Up to so many environments are run one by one: a tile would be mostly empty."""

BATCH_OF_LEGS = 4096

Floats = NDArray[np.float64]
Kind = TypeVar("Kind")


class Reactions(NamedTuple):
    """What joints and drives do to the links, in the world; a motor's rotor is not among the links.

    Attributes:
        joints: force on body `i` of each joint of `linkage.JOINTS`, shape (legs, 20, 2, num_envs) [N].
        lock: moment on body 10 by body 7, shape (legs, num_envs) [N m].
        driver: moment on the crank by the leg's frame, shape (legs, num_envs) [N m].
        hip: moment on the leg's frame by the trunk, about O, shape (legs, num_envs) [N m].
    """

    joints: Floats
    lock: Floats
    driver: Floats
    hip: Floats


class TrunkEngine:
    """Legs on a trunk over the ground; see the module docstring.

    Args:
        limbs: the legs in their places; their order is that of every array with a leg axis.
        trunk: what they hang from. Its height is that of its centre of mass.
        ground: laws of contact. Its exponent must be a multiple of 1/8, so that square roots are enough.
        terrain: heights, and where the ground is softer or more slippery; level if None.
        sim_dt: the step [s] after which contacts are remembered and results can be read.
        integrator: one of `schemes.SCHEMES`.
        substeps: parts of `sim_dt` that are integrated; None chooses as many as the stiffness of the ground asks.
        num_envs: environments side by side, which share all of the above.
        filters: bounds of the command filters.
        reactions: compute the joint reactions of every step; `reactions()` has those of the last.

    Raises:
        ParameterError: a value is out of range or of the wrong type.
        GeometryError: a leg has no place for its links at any crank angle.

    Warns:
        StepWarning: `substeps` is given and too few.
    """

    def __init__(
        self,
        limbs: Limb | Sequence[Limb],
        trunk: Trunk,
        ground: Ground | None = None,
        terrain: Terrain | None = None,
        *,
        sim_dt: float = 1e-3,
        integrator: str = "midpoint",
        substeps: int | None = None,
        num_envs: int = 1,
        filters: FilterSettings | None = None,
        reactions: bool = False,
    ) -> None:
        self.limbs = _all_of("limbs", limbs, Limb)
        self.trunk = _a("trunk", trunk, Trunk)
        self.ground = Ground() if ground is None else _a("ground", ground, Ground)
        self.terrain = Terrain.flat() if terrain is None else _a("terrain", terrain, Terrain)
        self.filters = FilterSettings() if filters is None else _a("filters", filters, FilterSettings)
        self.integrator = check_choice("integrator", integrator, SCHEMES)
        self.sim_dt = check_number("sim_dt", sim_dt, low=1e-7, high=self.filters.longest_step)
        self.num_envs = _count("num_envs", num_envs)
        self.profiles = _profiles(self.limbs)
        self.step_limits = longest_steps(
            self.limbs, self.profiles, trunk, self.ground, self.terrain, integrator
        )
        needed = max(
            1, int(np.ceil(self.sim_dt / min(self.step_limits["elastic"], self.step_limits["damping"])))
        )
        self.substeps = needed if substeps is None else _count("substeps", substeps)
        if self.substeps < needed:
            warnings.warn(
                f"steps of {self.sim_dt / self.substeps:.3g} s are too long for this ground and these masses: "
                f"expected at most {self.sim_dt / needed:.3g} s, that is substeps={needed} of sim_dt = {sim_dt:g} s",
                StepWarning,
                stacklevel=2,
            )
        self._reacts = bool(reactions)
        self._arrays = self._new_arrays()
        self._model = self._new_model()
        alone = {1: (advance_one_leg, react_one_leg), 4: (advance_four_legs, react_four_legs)}
        kernels = advance_batch, react_batch
        if self.num_envs <= FEW:
            kernels = alone.get(len(self.limbs), kernels)
        self._run = kernels[self._reacts]

    # What it is like

    @property
    def total_mass(self) -> float:
        """Mass of trunk and legs [kg]."""
        return self.trunk.mass + sum(limb.geometry.mass for limb in self.limbs)

    @property
    def weight(self) -> float:
        """Weight of trunk and legs [N]."""
        return self.total_mass * GRAVITY

    # State

    def reset(
        self,
        gaits: GaitParameters | Sequence[GaitParameters],
        theta: ArrayLike = 0.0,
        *,
        x: ArrayLike = 0.0,
        y: ArrayLike | None = None,
        pitch: ArrayLike = 0.0,
        vx: ArrayLike = 0.0,
        vy: ArrayLike = 0.0,
        pitch_rate: ArrayLike = 0.0,
        theta_rate: ArrayLike | None = None,
        envs: ArrayLike | None = None,
    ) -> None:
        """Start with the filters at rest at a gait, the same for all legs or one each.

        A hoof point that starts inside the ground has entered it at its present rate.

        Args:
            gaits: gait parameters of each leg.
            theta: crank angles [rad], of shape (), (legs,) or (legs, n) with n the environments that start.
            x, y, pitch, vx, vy, pitch_rate: of the trunk's centre of mass [m, rad, s], shape () or (n,); a `y` of
                None is the trunk's height.
            theta_rate: of motor-driven cranks [rad/s], as theta; None is the commanded speed.
            envs: which environments start, as indices or as a mask of shape (num_envs,); None is all.

        Raises:
            ParameterError: a value is not finite, of the wrong shape or forbidden by the trunk's kind.
        """
        where, legs = self._which(envs), len(self.limbs)
        n, kind = where.size, TRUNKS.index(self.trunk.kind)
        each = _all_of(
            "gaits", [gaits] * legs if isinstance(gaits, GaitParameters) else gaits, GaitParameters
        )
        if len(each) != legs:
            raise ParameterError(f"gaits: expected one or {legs}, got {len(each)}")
        values = np.array([gait.to_array() for gait in each])
        angle = _spread("theta", theta, (legs, n))
        rate = values[:, :1] if theta_rate is None else theta_rate
        spin = _spread("theta_rate", rate, (legs, n))
        place = {"x": x, "y": self.trunk.height if y is None else y, "pitch": pitch}
        speed = {"vx": vx, "vy": vy, "pitch_rate": pitch_rate}
        at = {name: _spread(name, value, (n,)) for name, value in (place | speed).items()}
        for name, kinds in (
            ("vx", (RAIL, SUSPENDED, FREE)), ("vy", (SUSPENDED, FREE)), ("pitch", (FREE,)), ("pitch_rate", (FREE,))
        ):  # fmt: skip
            if kind not in kinds and np.any(at[name] != 0):
                raise ParameterError(f"{name}: expected 0 of a {self.trunk.kind} trunk, got {at[name]}")
        if kind <= RAIL and np.any(at["y"] != self.trunk.height):
            raise ParameterError(f"y: a {self.trunk.kind} trunk is at {self.trunk.height:g} m, got {at['y']}")
        for i, limb in enumerate(self.limbs):
            if not isinstance(limb.drive, Motor) and np.any(spin[i] != values[i, 0]):
                raise ParameterError(
                    f"theta_rate: leg {i} is prescribed to turn at {values[i, 0]:g} rad/s, got {spin[i]}"
                )
        swing = values[:, 1:2] + values[:, 2:3] * np.sin(angle) + values[:, 3:] * np.cos(angle)
        slope = values[:, 2:3] * np.cos(angle) - values[:, 3:] * np.sin(angle)
        whole = tally(self, angle, spin, swing, slope * spin, at)
        trunk, limbs = self._arrays.trunk, self._arrays.limbs
        moves = np.array([kind != 0, kind in (SUSPENDED, FREE), kind == FREE], dtype=float)
        new = np.zeros((len(t.STATE), n))
        new[t.CENTRE] = np.where(moves[0], whole.centre.real, at["x"])
        new[t.CENTRE + 1] = np.where(moves[1], whole.centre.imag, at["y"])
        new[t.MOMENTUM], new[t.MOMENTUM + 1] = moves[0] * whole.momentum.real, moves[1] * whole.momentum.imag
        new[t.PITCH], new[t.SPIN] = at["pitch"], moves[2] * whole.spin
        trunk[:, where] = new
        leg = np.zeros((legs, len(b.STATE), n))
        leg[:, b.THETA], leg[:, b.OMEGA] = angle, spin
        leg[:, b.VALUE : b.VALUE + 4] = values[:, :, None]
        limbs[:, :, where] = leg
        self._arrays.command[:, :, where] = values[:, :, None]
        self._arrays.account[:, where] = 0.0
        self._go(0)

    def get_state(self) -> dict[str, Any]:
        """Everything that changes, as arrays of their own: continuing from it is bit-identical."""
        a = self._arrays
        return {name: getattr(a, name).copy() for name in _STATE} | {"layout": self._layout()}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Put back what `get_state` gave.

        Raises:
            ParameterError: the state belongs to another engine, lacks a part or is not finite.
        """
        missing = {*_STATE, "layout"} - set(state)
        if missing:
            raise ParameterError(
                f"state: expected what get_state gives, but {', '.join(sorted(missing))} is missing"
            )
        if state["layout"] != self._layout():
            raise ParameterError(f"state: expected one of {self._layout()}, got one of {state['layout']}")
        arrays = {name: _finite(f"state[{name!r}]", state[name]) for name in _STATE}
        for name, given in arrays.items():
            shape = getattr(self._arrays, name).shape
            if given.shape != shape:
                raise ParameterError(f"state[{name!r}]: expected shape {shape}, got {given.shape}")
        for name, given in arrays.items():
            getattr(self._arrays, name)[:] = given

    # Motion

    def advance(
        self, command: ArrayLike | None = None, steps: int = 1, *, account: bool = True
    ) -> NDArray[np.int64]:
        """Advance by `steps` of `sim_dt` under a command.

        Args:
            command: gait parameters, of shape (4,), (legs, 4) or (legs, 4, num_envs); None keeps the last.
            steps: how many; 0 evaluates forces and accelerations where the state is.
            account: whether to keep `account`.

        Returns:
            How each environment ended, shape (num_envs,), values of `result.Result`. One that did not end OK
            is left in its last good state.

        Raises:
            ParameterError: the command has a wrong shape or is not finite.
        """
        if command is not None:
            self._command(command)
        self._go(_count("steps", steps, low=0), account)
        return self._arrays.result.copy()

    def _command(self, command: ArrayLike) -> None:
        given, whole = _finite("command", command), self._arrays.command
        legs = len(self.limbs)
        if given.shape == (4,) or given.shape == (legs, 4):
            given = given[..., None]
        elif given.shape != whole.shape:
            raise ParameterError(
                f"command: expected shape (4,), ({legs}, 4) or {whole.shape}, got {given.shape}"
            )
        whole[:] = given

    def _go(self, steps: int, account: bool = False) -> None:
        self._run(self._arrays, self._model, self.sim_dt / self.substeps, steps * self.substeps, account)

    # What it reports

    @property
    def state(self) -> dict[str, Floats]:
        """The state by name: rows of `trunk_rows.STATE`, shape (num_envs,), and of `limb_rows.STATE`, shape
        (legs, num_envs)."""
        a = self._arrays
        return {name: a.trunk[k].copy() for k, name in enumerate(t.STATE)} | {
            name: a.limbs[:, k].copy() for k, name in enumerate(b.STATE)
        }

    @property
    def report(self) -> dict[str, Floats]:
        """What acts at the present instant: `lanes_report.TRUNK_REPORT` and `LIMB_REPORT` by name."""
        a = self._arrays
        return {name: a.trunk_report[k].copy() for k, name in enumerate(TRUNK_REPORT)} | {
            name: a.limb_report[:, k].copy() for k, name in enumerate(LIMB_REPORT)
        }

    @property
    def account(self) -> dict[str, Floats]:
        """Integrals since the reset by name, `lanes_report.ACCOUNT`, shape (num_envs,)."""
        return {name: self._arrays.account[k].copy() for k, name in enumerate(ACCOUNT)}

    def reactions(self) -> Reactions:
        """Joint reactions at the present instant.

        Raises:
            ParameterError: the engine was not made with `reactions=True`.
        """
        if not self._reacts:
            raise ParameterError("reactions: expected an engine made with reactions=True, got one without")
        found = self._arrays.reactions
        legs, _, n = found.shape
        joints = found[:, :LOCK].reshape(legs, -1, 2, n).copy()
        return Reactions(joints, found[:, LOCK].copy(), found[:, DRIVER].copy(), found[:, HIP].copy())

    def tally(self) -> Tally:
        """Momentum, spin and energy of all bodies at the present instant, added up anew from their motion."""
        r, s = self.report, self.state
        at = {"x": r["x"], "y": r["y"], "pitch": s["pitch"]} | {k: r[k] for k in ("vx", "vy", "pitch_rate")}
        return tally(self, s["theta"], s["theta_rate"], r["phi"], r["phi_rate"], at)

    def messages(self) -> list[str]:
        """How each environment ended, for people."""
        return [Result(int(code)).message for code in self._arrays.result]

    # Arrays for the kernels

    def _new_arrays(self) -> Arrays:
        n, legs = self.num_envs, len(self.limbs)
        trunk_settings = np.repeat(self._trunk_settings()[:, None], n, 1)
        limb_settings = np.array(
            [_limb_settings(*pair) for pair in zip(self.limbs, self._first_rows(), strict=True)]
        )
        return Arrays(
            np.full((len(t.STATE), n), np.nan),  # nowhere, until reset
            np.full((legs, len(b.STATE), n), np.nan),
            trunk_settings,
            np.repeat(limb_settings[:, :, None], n, 2),
            np.zeros((legs, 4, n)),
            np.zeros((len(ACCOUNT), n)),
            np.zeros((len(TRUNK_REPORT), n)),
            np.zeros((legs, len(LIMB_REPORT), n)),
            np.zeros(n, dtype=np.int64),
            np.array([leg_constants(limb.geometry)[:, 0] for limb in self.limbs]),
            np.zeros((legs, OUTPUTS, n)) if self._reacts else np.zeros((0, 0, 0)),
        )

    def _trunk_settings(self) -> Floats:
        trunk, ground, mass = self.trunk, self.ground.to_record(), self.total_mass
        hangs = trunk.kind == "suspended"
        values = {
            "total_mass": mass, "per_mass": 1 / mass, "pitch_inertia": trunk.pitch_inertia,
            "support": (1 - trunk.share) * mass * GRAVITY if hangs else 0.0,
            "spring": trunk.stiffness if hangs else 0.0, "damper": trunk.damping if hangs else 0.0,
            "height": trunk.height, "drag": trunk.drag, "gravity": GRAVITY,
            "bottom": float(np.min(self.terrain.height)),
        } | {name: ground[name] for name in (
            "stiffness", "chi", "dashpot", "approach_floor", "friction", "friction_slow", "friction_fast"
        )}  # fmt: skip
        return np.array([values[name] for name in t.PARAMETERS])

    def _new_model(self) -> Model:
        eighths = self.ground.exponent * EXPONENT_UNIT
        if eighths != round(eighths):
            raise ParameterError(
                f"exponent: this engine takes multiples of 1/{EXPONENT_UNIT}, got {self.ground.exponent!r}"
            )
        cells = max(profile.cells for profile in self.profiles)
        tables = [profile.with_cells(cells).table for profile in dict.fromkeys(self.profiles)]
        scheme, grid = SCHEMES[self.integrator], self.terrain.to_grid()
        return Model(
            TRUNKS.index(self.trunk.kind), int(eighths), FRICTION_LAWS.index(self.ground.friction_law),
            self.ground.approach == "interpolated", self.terrain != Terrain.flat(), scheme.new_rates,
            False, cells, np.concatenate(tables),
            self.filters.to_array(), np.array(scheme.fractions), np.array(scheme.weights),
            grid.cells, grid.origin, grid.per_metre,
        )  # fmt: skip

    def _first_rows(self) -> list[int]:
        """Where the table of each leg begins in the model's."""
        unique, cells = list(dict.fromkeys(self.profiles)), max(profile.cells for profile in self.profiles)
        return [unique.index(profile) * cells for profile in self.profiles]

    def _layout(self) -> dict[str, Any]:
        return {
            "trunk": self.trunk.kind,
            "legs": [limb.geometry.name for limb in self.limbs],
            "num_envs": self.num_envs,
        }

    def _which(self, envs: ArrayLike | None) -> NDArray[np.int64]:
        if envs is None:
            return np.arange(self.num_envs)
        given = np.asarray(envs)
        if given.dtype == bool and given.shape == (self.num_envs,):
            return np.flatnonzero(given)
        if given.dtype.kind in "iu" and given.ndim == 1 and np.all((given >= 0) & (given < self.num_envs)):
            return given.astype(np.int64)
        raise ParameterError(
            f"envs: expected indices below {self.num_envs} or a mask of shape ({self.num_envs},), got {envs!r}"
        )


_STATE = ("trunk", "limbs", "command", "account")


def _profiles(limbs: Sequence[Limb]) -> list[LegProfile]:
    """One profile for each leg, the same object for the same geometry."""
    known: list[LegProfile] = []
    for limb in limbs:
        if not any(profile.geometry == limb.geometry for profile in known):
            known.append(LegProfile(limb.geometry))
    return [next(p for p in known if p.geometry == limb.geometry) for limb in limbs]


def _limb_settings(limb: Limb, first_row: int) -> Floats:
    motor = limb.drive if isinstance(limb.drive, Motor) else Motor(0.0, 0.0, 0.0, 0.0)
    side, rotor = float(limb.geometry.travel), motor.rotor_inertia
    values = (
        *limb.hip, limb.geometry.mass, side, first_row, float(isinstance(limb.drive, Motor)),
        motor.speed_gain, motor.torque_limit,
        motor.reflected_inertia, -side * motor.gear_ratio * rotor, rotor,
    )  # fmt: skip
    return np.array(values)


def _count(name: str, value: Any, low: int = 1) -> int:
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)) or value < low:
        raise ParameterError(f"{name}: expected a whole number, {low} or more, got {value!r}")
    return int(value)


def _spread(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Floats:
    given = _finite(name, value)
    if given.ndim == 1 and len(shape) == 2:
        given = given[:, None]
    try:
        return np.broadcast_to(given, shape)
    except ValueError:
        raise ParameterError(f"{name}: expected numbers that fit shape {shape}, got {value!r}") from None


def _finite(name: str, value: Any) -> Floats:
    try:
        given = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        given = np.array(np.nan)
    if value is None or not np.isfinite(given).all():
        raise ParameterError(f"{name}: expected finite numbers, got {value!r}")
    return given


def _a(name: str, value: Any, kind: type[Kind]) -> Kind:
    if not isinstance(value, kind):
        raise ParameterError(f"{name}: expected {kind.__name__}, got {value!r}")
    return value


def _all_of(name: str, values: Any, kind: type[Kind]) -> tuple[Kind, ...]:
    """One `kind` or several of them as a tuple."""
    try:
        several = (values,) if isinstance(values, kind) else tuple(values)
    except TypeError:
        several = ()
    if not several or not all(isinstance(value, kind) for value in several):
        raise ParameterError(f"{name}: expected {kind.__name__}, one or more, got {values!r}")
    return several

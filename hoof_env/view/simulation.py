"""Simulation of a page: one episode after the other, step by step, with settings that change as it runs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from hoof_env import records
from hoof_env.envs.policies import constant_gait
from hoof_env.errors import HoofEnvError, ParameterError, brief, check_choice, check_number, count
from hoof_env.gait import PARAMETERS, GaitParameters, limits_of
from hoof_env.lab.forces import THRESHOLD, above_threshold, onto_surface
from hoof_env.policies.actor import Actor
from hoof_env.record.columns import Columns
from hoof_env.tasks.settings import ABOUT, PER_EPISODE
from hoof_env.view.other_ground import OtherGround

DRIVES = {"crank_torque": "N m", "crank_power": "W"}
"""Unit of each measurement of a leg's drive that a page shows next to the columns of a record."""


class Chunk(NamedTuple):
    """Substeps of a control step, or the start of an episode.

    Attributes:
        columns: what `hoof-env export` writes at each substep, with all fields of instants; shape (n,).
        drives: measurements of `DRIVES` by column, behind the names of a horse's legs, shape (n,).
        normals: normal force of elastic and of inelastic ground for the same motion, by "elastic" and
            "inelastic" behind the names of a horse's legs, shape (n,) [N]; empty where there is none, see
            `OtherGround.refusal`.
        terms: terms of the reward of this step by name; empty at a start.
    """

    columns: Columns
    drives: Columns
    normals: Columns
    terms: dict[str, float]


class Simulation:
    """Episodes of one environment under a policy.

    A request that is refused raises an error and changes nothing.

    Args:
        env_id: id of an environment of this package.
        arguments: arguments of `gymnasium.make`.
        policy: what `load_policy` takes; None is the default of `records.find_policy`.
        seed: seed of the first episode; the next ones follow it.

    Attributes:
        env_id, arguments, policy, seed: arguments; they change with the calls below.
        env: environment.
        setting: its surroundings, see `record.surroundings.Surroundings`.
        legs: prefixes of the columns of each leg, ("",) of a single one.
        dt: control step [s].
        parameters: physical parameters that were touched, by name.
        hand: gait that drives the leg instead of the policy, None for the policy.
        other_ground: forces that other ground would give.
        ended: how the episode ended, "" while it runs.
        is_asking: True while the policy is asked for an action.

    Raises:
        HoofEnvError: as in `records.make_env` and `records.find_policy`.
    """

    def __init__(
        self,
        env_id: str,
        arguments: Mapping[str, Any] | None = None,
        policy: Any = None,
        seed: int = 0,
    ) -> None:
        self.env_id = env_id
        self.arguments = dict(arguments or {})
        self.policy = policy
        self.seed = count("seed", seed, low=0)
        self.env = records.make_env(env_id, self.arguments)
        self._leg: Any = self.env.unwrapped
        self.setting = records.surroundings(self.env)
        self.legs = tuple(self.setting.hips)
        self.dt: float = self.env.get_wrapper_attr("dt")
        self._actor = self._find(policy, self.seed)
        self.parameters: dict[str, float] = {}
        self.hand: dict[str, float] | None = None
        self.other_ground = OtherGround(self._leg)
        self.ended = ""
        self.is_asking = False
        self._observation: Any = None

    @property
    def terms(self) -> tuple[str, ...]:
        """Names of the reward's terms."""
        return self._leg.terms

    @property
    def is_driven(self) -> bool:
        """True if actions are rates of one gait, which can be driven by hand."""
        return bool(self._leg.action_form == "rates")

    @property
    def gait_limits(self) -> dict[str, tuple[float, float]]:
        """Limits of the gait parameters that `drive` takes, empty for a horse."""
        return limits_of(self.setting.geometry) if self.is_driven else {}

    def _find(self, policy: Any, seed: int) -> Actor:
        """Return the actor of a policy, which may be a name."""
        if policy is None or isinstance(policy, str):
            policy = records.find_policy(policy, self.env, self.env_id, seed)
        return Actor(policy, self.env, seed)

    # Episodes

    def reset(self, seed: int | None = None, policy: Any = None) -> Chunk:
        """Start an episode; return its first instant.

        Args:
            seed: seed; None takes the present one.
            policy: another policy, by name; None keeps the present one.
        """
        chosen = self.seed if seed is None else count("seed", seed, low=0)
        actor = self._actor
        if policy is not None:
            actor = self._find(policy, chosen)
        options = actor.start
        if self.parameters:
            options = options | {"parameters": dict(self.parameters)}
        self._observation, _ = self.env.reset(seed=chosen, options=options)
        self.seed = chosen
        self._actor = actor
        if policy is not None:
            self.policy = policy
            self.hand = None
        self.ended = ""
        actor.begin()
        self.other_ground.begin(self._leg.record())
        return self._chunk({})

    def step(self) -> Chunk | None:
        """Take a control step; return its substeps, None if the episode is over or could not go on."""
        if self.ended:
            return None
        action = self._action()
        before = self._leg.engine.state["time"][0]
        self._observation, _, failed, truncated, info = self.env.step(action)
        if failed or truncated:
            (reason,) = info["end"]
            self.ended = reason if failed else "time is up"
        # A step in which the simulation failed has no new substeps.
        if self._leg.engine.state["time"][0] <= before:
            return None
        return self._chunk({name: float(info[name]) for name in self.terms})

    def _action(self) -> Any:
        """Return the next action, of the hand or of the policy.

        Raises:
            ParameterError: the policy fails, or its action is not finite.
        """
        if self.hand is not None:
            return self._leg.action_for(np.array([*self.hand.values()]))
        self.is_asking = True
        try:
            action = self._actor.act(self._observation)
            is_finite = np.isfinite(np.asarray(action, float)).all()
        except HoofEnvError:
            raise
        except (Exception, SystemExit) as error:
            cause = f"{type(error).__name__}: {error}"
            raise ParameterError(f"policy {self.policy_name}: expected actions, it raised {cause}") from error
        finally:
            self.is_asking = False
        if not is_finite:
            numbers = np.asarray(action).tolist()
            raise ParameterError(f"policy {self.policy_name}: expected finite actions, got {numbers}")
        return action

    def _chunk(self, terms: dict[str, float]) -> Chunk:
        """Return the last substeps as the page shows and recordings have them."""
        leg = self._leg
        record = leg.record()
        columns = records.substeps(self.env, record)
        terrain = self.setting.terrain
        shown = above_threshold(onto_surface(columns, terrain), THRESHOLD, terrain)
        drives = {}
        for i, prefix in enumerate(self.legs):
            for name in DRIVES:
                drives[prefix + name] = np.array(record[name][:, i, 0], float)
        return Chunk(shown, drives, self.other_ground.columns(record, self.legs), terms)

    # Touching

    def touch(self, name: str, value: Any) -> bool:
        """Give a setting another value at once.

        Args:
            name: name of a setting.
            value: the value, in the setting's unit.

        Returns:
            True if the running episode has the value now. False if it cannot change within an episode, such
            as the exponent, or stiffness that needs shorter substeps: nothing has changed, and the value must
            be an argument of a new environment.

        Raises:
            ParameterError: the setting is unknown, has no effect, or is out of range.
        """
        number = check_number(check_choice("setting", name, ABOUT), value)
        if name not in PER_EPISODE:
            return False
        changed = self.parameters | {name: number}
        if not self._leg.touch(changed):
            return False
        self.parameters = changed
        self.other_ground.set_ground(changed)
        if self._observation is not None:
            # The last instant with the new parameters: from it the next substeps are recorded.
            self._leg.set_state(self._leg.get_state())
        return True

    def drive(self, name: str, value: Any) -> None:
        """Drive the leg by hand towards a gait of which one parameter changes.

        Args:
            name: one of `gait.PARAMETERS`.
            value: the parameter [rad/s or rad].

        Raises:
            ParameterError: an unknown name, a value beyond the limits, or a horse.
        """
        limits = self.gait_limits
        if name not in limits:
            raise ParameterError(
                f"gait: expected one of {', '.join(limits) or 'no parameter'}, got {brief(name)}"
            )
        low, high = limits[name]
        wanted = (self.hand or self.gait_now()) | {name: check_number(name, value, low=low, high=high)}
        constant_gait(GaitParameters(*wanted.values()), self.env)  # raises for a gait beyond the limits
        self.hand = wanted

    def gait_now(self) -> dict[str, float]:
        """Return the present gait parameters of one leg, within the limits."""
        state = self._leg.engine.state
        limits = self.gait_limits.items()
        return {name: float(np.clip(state[name][0, 0], low, high)) for name, (low, high) in limits}

    def command_speed(self, value: Any) -> None:
        """Command a speed [m/s] from now on.

        Raises:
            ParameterError: the environment has no commanded speed, or the value is out of range.
        """
        self._leg.command_speed(value)

    @property
    def commanded_speed(self) -> float | None:
        """Commanded speed [m/s], None where there is none."""
        speed: float | None = self._leg.commanded_speed
        return speed

    def push(self, impulse: Any) -> None:
        """Push the trunk forward.

        Args:
            impulse: impulse at the trunk [N s].

        Raises:
            ParameterError: the trunk cannot be pushed, or the impulse is no number.
        """
        self._leg.push(check_number("push", impulse))

    @property
    def policy_name(self) -> str | None:
        """Name of the policy, None for the default, and the text of an object."""
        return self.policy if isinstance(self.policy, str | None) else brief(self.policy)


def unit_of(name: str) -> str:
    """Return the unit of a gait parameter or a setting, "" for none."""
    if name in PARAMETERS:
        return "rad/s" if name == "crank_speed" else "rad"
    unit = ABOUT[name].unit
    return "" if unit == "-" else unit

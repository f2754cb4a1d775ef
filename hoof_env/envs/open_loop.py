"""Policies without feedback, as files: the strongest of them are the bar for an agent that sees.

Two families. A "constant" gait is held. A "phase" gait is a function of the crank angle theta, and of the
command u where there is one, both as they are observed:

    g(theta, u) = sum over powers p and harmonics h of u^p (A_ph sin(h theta) + B_ph cos(h theta)),  u^0 = 1.

Where the drive prescribes the crank's motion, no force changes the crank angle: the gait depends on the start
and on the command alone. With a motor the ground slows the crank down, so the crank angle is feedback, and a
clock takes its place: theta = 2 pi f t, t from the start of the episode.

For one leg g is the gait, to which the policy goes as fast as is allowed. For a horse g is the action, eight
numbers: the four of a fore leg and the four of a hind leg, each a function of that leg's own crank.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env._input import as_path, read_text
from hoof_env._version import __version__
from hoof_env.envs.policies import STANDS_FOR, Scripted, towards
from hoof_env.errors import DataFileError, ParameterError, bounded, brief, parse_json

Floats = NDArray[np.float64]

GAIT = "gait"
"""Form of the numbers in a leg's file: gait parameters in their units. A horse's file has the form of its
actions."""

GAITS = Path(__file__).parents[1] / "data" / "gaits"
"""Folder of the gaits of the package, which `agents.open_loop` found."""

FAMILIES = ("constant", "phase")

MAX_NUMBER = 1e6
"""Largest absolute value of a number in a file."""

BLIND = ("crank", "gait", "target", "offset")
"""Groups of observations that no force changes while the drive is prescribed."""

COMMAND = "commanded speed"
"""Name of the observed command."""

SCALES = "observation_scales"
"""Entry of a gait's file with the scale of the command, if the gait depends on it."""


def check_blind(settings: Any) -> None:
    """Raise `ParameterError` if an environment with these settings observes the ground, or anything that
    depends on it."""
    is_prescribed = settings.drive == "prescribed"
    allowed = [group for group in BLIND if is_prescribed or group != "crank"]
    if seeing := [group for group in settings.observation if group not in allowed]:
        why = "" if is_prescribed else "; the ground changes the crank of a motor: a clock takes its place"
        raise ParameterError(
            f"observation: expected groups that depend on no force, some of {', '.join(allowed)}, for a"
            f" policy without feedback; got {', '.join(seeing)}{why}"
        )


def harmonics(coefficients: Any) -> int:
    """Return the number of harmonics of coefficients, shape (..., powers, 1 + 2 harmonics, numbers)."""
    return (np.shape(coefficients)[-2] - 1) // 2


def open_loop(parameters: Mapping[str, Any], env: Any, blind: bool = True) -> Scripted:
    """Make a policy of a family.

    Args:
        parameters: {"constant": gait parameters, shape (4,)}, or {"coefficients": factors of 1, sin(theta),
            cos(theta), sin(2 theta) ... by the power of the command, shape (powers, 1 + 2 harmonics,
            numbers)} with numbers 4 of a leg and 8 of a horse; with a clock also "frequency_hz". Each may
            have a leading axis of n environments.
        env: environment of this package, single or many.
        blind: False lets a gait follow the crank of a motor, which is feedback.

    Raises:
        ParameterError: a constant gait beyond the limits of the leg, coefficients of another body, a gait
            that is locked to the crank of a motor, or something that the policy needs is not observed.
    """
    env = env.unwrapped
    if "constant" in parameters:
        if env.action_form != "rates":
            raise ParameterError("constant: expected an environment of one leg, got a horse")
        constant = np.asarray(parameters["constant"], float)
        env.body.check_reachable("constant", constant)
        return Scripted(towards(env, lambda observation, time: constant), env.dt)
    numbers_at = _phase_gait(parameters, env, blind)
    if env.action_form == "rates":
        body = env.body

        def gait_at(observation: Any, time: Any) -> Any:
            return np.clip(numbers_at(observation, time)[..., 0, :], body.low, body.high)

        return Scripted(towards(env, gait_at), env.dt)

    def act(observation: Any, time: Any) -> Any:
        """Return the actions of all legs, leg by leg: left and right are alike."""
        numbers = numbers_at(observation, time)
        fore, hind = numbers[..., :2, :4], numbers[..., 2:, 4:]
        both = np.concatenate([fore, hind], axis=-2)
        return np.clip(both.reshape(*both.shape[:-2], -1), -1.0, 1.0)

    return Scripted(act, env.dt)


def _phase_gait(parameters: Mapping[str, Any], env: Any, blind: bool) -> Any:
    """Return a function of observations and times that returns g of each crank: (..., legs, numbers)."""
    coefficients = np.asarray(parameters["coefficients"], float)
    is_leg = env.action_form == "rates"
    numbers = 4 if is_leg else 8
    if coefficients.shape[-1] != numbers:
        raise ParameterError(
            f"coefficients: expected {numbers} numbers of {'one leg' if is_leg else 'a horse'}, got"
            f" {coefficients.shape[-1]}"
        )
    names = list(env.observation_names)
    cranks = [name for name in names if name.endswith("sin(crank angle)")]
    has_clock = "frequency_hz" in parameters
    if blind and not has_clock and env.settings.drive != "prescribed":
        raise ParameterError(
            'coefficients: expected a clock, "frequency_hz", because the drive is a motor, whose crank the'
            " ground slows down; got a gait that is locked to the crank"
        )
    if has_clock and not is_leg:
        raise ParameterError("frequency_hz: expected an environment of one leg, got a horse")
    if not has_clock and not cranks:
        raise ParameterError(
            "policy: expected 'crank' among the observed groups, for a gait that is locked to the crank; got"
            f" {env.settings.observation!r}"
        )
    powers = coefficients.shape[-3]
    if powers > 1 and COMMAND not in names:
        raise ParameterError(
            "policy: expected 'target' among the observed groups, for a gait that depends on the command; got"
            f" {env.settings.observation!r}"
        )
    sines = [names.index(name) for name in cranks]
    cosines = [names.index(name.replace("sin(", "cos(")) for name in cranks]
    command = names.index(COMMAND) if powers > 1 else -1
    order = np.arange(1, harmonics(coefficients) + 1)
    rate = 2 * np.pi * np.asarray(parameters.get("frequency_hz", 0.0), float)

    def numbers_at(observation: Any, time: Any) -> Any:
        seen = np.asarray(observation, float)
        if has_clock:
            angle = np.asarray(rate * time)[..., None]
        else:
            angle = np.arctan2(seen[..., sines], seen[..., cosines])
        turns = angle[..., None] * order
        waves = np.stack([np.sin(turns), np.cos(turns)], -1).reshape(*turns.shape[:-1], -1)
        basis = np.concatenate([np.ones((*angle.shape, 1)), waves], -1)
        weights = coefficients[..., 0, :, :]
        for power in range(1, powers):
            weights = weights + seen[..., command, None, None] ** power * coefficients[..., power, :, :]
        return basis @ weights

    return numbers_at


def open_loop_record(path: Path | str) -> dict[str, Any]:
    """Read the file of a gait, which `agents.open_loop` writes: a mapping with "parameters" of one
    environment as `open_loop` takes them, and their "form".

    Raises:
        DataFileError: not such a file, or one of another form.
    """
    path = as_path("path", path)
    try:
        record: dict[str, Any] = parse_json(read_text(path))
        parameters = record["parameters"]
        if set(parameters) not in ({"constant"}, {"coefficients"}, {"coefficients", "frequency_hz"}):
            raise ValueError(f"parameters {sorted(parameters)}")
        for name, value in parameters.items():
            if not _fits(name, value):
                raise ValueError(f"{name} {brief(value)}")
        if not isinstance(record.get("env_id"), str | None):
            raise TypeError(f"env_id {brief(record['env_id'])}")
        for name in ("env_kwargs", "versions", SCALES):
            if not isinstance(record.get(name, {}), dict):
                raise TypeError(f"{name} {brief(record[name])}")
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        raise DataFileError(
            f"open-loop gait {path}: expected a JSON object as agents.open_loop writes it, with form and"
            f" parameters: {getattr(error, 'strerror', None) or error}"
        ) from None
    if not isinstance(record.get("form"), str) or not record["form"].startswith((GAIT, "offsets")):
        raise DataFileError(
            f"open-loop gait {path}: expected form {GAIT!r}, parameters of gaits, or the form of a horse's"
            f" actions, got {brief(record.get('form'))}; make one by agents.open_loop"
        )
    return record


def _fits(name: str, value: Any) -> bool:
    """True if a value may be an entry of a file's parameters."""
    numbers = np.asarray(value, object)
    if not _has_shape(name, numbers.shape):
        return False
    # By type, for True is an int, too.
    if not all(type(number) in (int, float) and abs(number) <= MAX_NUMBER for number in numbers.flat):
        return False
    return name != "frequency_hz" or 0 < value <= 1e3


def _has_shape(name: str, shape: Sequence[int]) -> bool:
    """True if an entry of a file's parameters may have a shape."""
    if name == "coefficients":
        return len(shape) == 3 and shape[0] in (1, 2) and shape[1] % 2 == 1 and shape[2] in (4, 8)
    return tuple(shape) == {"constant": (4,), "frequency_hz": ()}[name]


def gait_file(env_id: str, family: str | None = None) -> Path:
    """Return the file of the best gait of an id in the package, of all families or of one.

    Raises:
        DataFileError: the package has no such gait.
    """
    name = STANDS_FOR.get(env_id, env_id).rpartition("/")[2]
    places = [GAITS / f"{name}-{each}.json" for each in FAMILIES if family in (None, each)]
    files = [file for file in places if file.is_file()]
    if not files:
        known = ", ".join(sorted(file.name for file in GAITS.glob("*.json"))) or "none"
        raise DataFileError(f"open-loop gait of {name}: expected a file of {GAITS.name}/: {known}")
    return max(files, key=lambda file: open_loop_record(file)["score"]["mean"]["return"])


def load_open_loop(path_or_env_id: str | Path, env: Any, family: str | None = None) -> Scripted:
    """Make the policy of a gait in a file. Warn if the gait was found for another id, with other settings, or
    by another version.

    Args:
        path_or_env_id: file of a gait, or the id of an environment for its best gait in the package.
        env: environment of this package.
        family: family of that gait, "constant" or "phase"; None takes the better one.

    Raises:
        DataFileError: there is no such gait, it cannot be read, or the environment has another body or shows
            the command on another scale.
    """
    path = Path(path_or_env_id)
    if path.suffix != ".json":
        path = gait_file(str(path_or_env_id), family)
    record = open_loop_record(path)
    bare = env.unwrapped
    form = GAIT if bare.action_form == "rates" else bare.action_form
    if record["form"] != form:
        raise DataFileError(
            f"open-loop gait {path}: expected the form {form!r} of {type(bare).__name__}, whose actions are"
            f" {bare.action_form}, got {brief(record['form'])}"
        )
    there, present = (scales.get(COMMAND) for scales in (record.get(SCALES, {}), bare.observation_scales))
    if there and present and there != present:
        raise DataFileError(
            f"open-loop gait {path}: expected a gait that was found with the scale {present!r} of the"
            f" {COMMAND}, got {brief(there)}; search again by agents.open_loop"
        )
    here = bare.spec and bare.spec.id
    unlike = []
    if here and (there := record.get("env_id") or here) not in (here, STANDS_FOR.get(here)):
        unlike.append(f"{there}, here {here}")
    if (made_with := record.get("versions", {}).get("hoof-env", __version__)) != __version__:
        unlike.append(f"hoof-env {made_with}, here {__version__}")
    made_under = record.get("env_kwargs", {}) | ({"dt": record["dt"]} if "dt" in record else {})
    for key, there in made_under.items():
        value = bare.dt if key == "dt" else getattr(bare.settings, key, None)
        # Through JSON, as the record's value went: tuples are lists there.
        if (present := json.loads(json.dumps(value, default=str))) != there:
            unlike.append(f"{key}={brief(there)}, here {brief(present)}")
    if unlike:
        warnings.warn(bounded(f"open-loop gait {path}: found for {'; '.join(unlike)}"), stacklevel=2)
    try:
        return open_loop(record["parameters"], env)
    except ParameterError as error:
        raise DataFileError(f"open-loop gait {path}: {error}") from None

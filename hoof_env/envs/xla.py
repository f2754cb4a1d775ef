"""Steps of a native vector environment inside `jax.jit`: EnvPool's `handle, recv, send, step = envs.xla()`.

XLA calls machine code of this package (`xla_handler`), which calls the kernel of a step. Python runs only
where it has to: where an episode ends, a command changes or a push is due, and in every step of environments
that are recorded, limit costs, have functions of a user that are checked, or use several threads.
"""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from hoof_env.envs.xla_handler import BEFORE, GONE, HANDLE, INSTEAD, NO_HANDLE, SUM, Word, handler
from hoof_env.episodes.step import NOT_A_NUMBER
from hoof_env.errors import HoofEnvError, MissingExtraError, ParameterError, brief

if TYPE_CHECKING:
    from hoof_env.envs.vector import HorseLegVectorEnv

OLDEST = (0, 5, 0)
"""Oldest version of jax with `jax.ffi`."""

TARGET = "hoof_env_step"
"""Name under which XLA knows the handler."""

MESSAGE_BYTES = 4096
"""Room for the message of an error."""

STALE = (
    "handle: expected the newest one of its environments, got one that was used before, or whose environments"
    " are gone: each call returns the next handle, also in lax.scan, and envs.xla() gives the newest again."
    " On several devices (pmap, a mesh) each would step the same environments: run the step on one"
)

STALE_MESSAGE = ctypes.create_string_buffer(STALE.encode())

_KEPT: list[Any] = []
"""Words of all environments, which a handle may name after they are gone."""


def numbers_of(asarray: Callable[[Any], Any], value: Any, shape: tuple[int, ...], wanted: str) -> Any:
    """Return real numbers as an array, also while JAX traces them.

    Args:
        asarray: function that makes an array, such as `jax.numpy.asarray`.
        value: array, nested list, scalars that are traced, or anything else.
        shape: shape of the array.
        wanted: begin of the message, which says what was expected.

    Raises:
        ParameterError: another shape, or other objects than real numbers.
    """
    try:
        array = asarray(value)
    # Each library of tensors has its own errors
    except Exception as error:
        reason = str(error).partition("\n")[0]
        raise ParameterError(f"{wanted}, got {brief(value)}, which is no array ({brief(reason)})") from None
    # V: halves, such as bfloat16. A key of JAX's has a type of its own, without a kind.
    kind = getattr(array.dtype, "kind", "")
    if array.shape != shape or kind not in tuple("fiuV"):
        raise ParameterError(f"{wanted}, got {array.dtype} of shape {array.shape}")
    return array


class States(NamedTuple):
    """Results of a step, as of EnvPool's.

    Attributes:
        observations: observations, float32, shape (num_envs, numbers).
        rewards: rewards, as of `step`: float64 where jax has it, else rounded to float32.
        terminated, truncated: ends of episodes, bool, shape (num_envs,).
        infos: "final_obs", the observations before restarts, in mode SAME_STEP; costs by their keys, float32.
    """

    observations: Any
    rewards: Any
    terminated: Any
    truncated: Any
    infos: dict[str, Any]


class Functions(NamedTuple):
    """EnvPool's four.

    Attributes:
        handle: names the environments, and how far they are; a uint8 array.
        recv: function of a handle; returns the next handle and the `States` of the last step, or of a reset.
        send: function of handle and actions; takes a step, and returns the next handle.
        step: function of handle and actions; both in one.
    """

    handle: Any
    recv: Callable[..., Any]
    send: Callable[..., Any]
    step: Callable[..., Any]


@cache
def loaded_jax() -> Any:
    """Return the module jax, with the handler registered for the CPU.

    Raises:
        MissingExtraError: jax is not installed, or is too old.
    """
    try:
        import jax
    except ImportError as error:
        raise MissingExtraError(
            f'envs.xla() and hoof_env.jax need jax: pip install "hoof-env[jax]" ({error})'
        ) from None
    version = jax.__version_info__
    if version < OLDEST:
        raise MissingExtraError(
            f"expected jax {'.'.join(map(str, OLDEST))} or later, got {jax.__version__}:"
            ' pip install -U "hoof-env[jax]"'
        )
    import jax.ffi

    code = handler().call.code
    pointer = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p)(code.address)
    jax.ffi.register_ffi_target(TARGET, jax.ffi.pycapsule(pointer), platform="cpu")
    _KEPT.append((code, pointer))
    return jax


class XlaSteps:
    """Steps of some environments by XLA. Copies and pickles of the environments leave them out: addresses
    belong to one object.

    Args:
        envs: the environments.
    """

    def __init__(self, envs: HorseLegVectorEnv) -> None:
        n, batch = envs.num_envs, envs.batch
        self._envs = weakref.ref(envs)
        self._shape = n, len(envs.action_names)
        is_same_step = envs.autoreset_mode == AutoresetMode.SAME_STEP
        costs = batch.plan.costs.keys
        observations = batch.rows.observations[:n]
        self._rewards = np.zeros(envs._rewards().shape)
        self._ends = np.zeros(-(-2 * n // 8), np.int64)  # bytes, filled up to whole words
        self._terminated, self._truncated = self._ends.view(bool)[: 2 * n].reshape(2, n)
        self._last = np.zeros_like(observations) if is_same_step else None
        self._costs = np.zeros((len(costs), n), np.float32)
        self._infos = {} if self._last is None else {"final_obs": self._last}
        self._infos |= dict(zip(costs, self._costs, strict=True))
        self._outputs = [observations, self._terminated, self._truncated, *self._infos.values()]
        self._message = ctypes.create_string_buffer(MESSAGE_BYTES)
        self._function = _python_function(self)
        self._words = self._new_words(envs)
        # A handle may name these words after the environments are gone.
        _KEPT.append(self._words)
        weakref.finalize(envs, self._words.__setitem__, int(Word.USES), GONE)
        self._calls = self._new_calls(envs)

    def _new_words(self, envs: HorseLegVectorEnv) -> NDArray[np.int64]:
        rows = envs.batch.rows
        observations = self._outputs[0]
        words = np.zeros(len(Word) + 2 * len(self._outputs), np.int64)
        known = {
            Word.CHECK: 1,
            Word.PYTHON: ctypes.cast(self._function, ctypes.c_void_p).value or 0,
            Word.ACTIONS: rows.actions.ctypes.data,
            Word.ACTION_BYTES: rows.actions[: envs.num_envs].nbytes,
            Word.OBSERVATIONS: observations.ctypes.data,
            Word.OBSERVATION_BYTES: observations.nbytes,
            Word.LAST: 0 if self._last is None else self._last.ctypes.data,
            Word.STEP_REWARDS: rows.rewards.ctypes.data,
            Word.REWARDS: self._rewards.ctypes.data,
            Word.REWARD_COUNT: self._rewards.size,
            Word.ENDS: self._ends.ctypes.data,
            Word.END_WORDS: self._ends.size,
            Word.STALE: ctypes.addressof(STALE_MESSAGE),
            Word.MESSAGE: ctypes.addressof(self._message),
            Word.OUTPUTS: len(self._outputs),
        }
        for word, value in known.items():
            words[word] = value
        for k, array in enumerate(self._outputs):
            words[len(Word) + 2 * k :][:2] = array.ctypes.data, array.nbytes
        return words

    def functions(self) -> Functions:
        """Return EnvPool's functions, with the newest handle."""
        return Functions(self._handle(), *self._calls)

    def _handle(self) -> Any:
        import jax.numpy as jnp

        address = self._words.ctypes.data
        return jnp.asarray(np.array([address, self._words[Word.USES], SUM - address]).view(np.uint8))

    def look(self) -> None:
        """Let Python look before the next step, since the environments are used from Python."""
        self._words[Word.CHECK] = 1

    # What Python does in a step

    def run(self, reason: int) -> None:
        """Do Python's part of a step.

        Args:
            reason: `BEFORE`, `INSTEAD`, or the code of a step.
        """
        envs = self._envs()
        assert envs is not None  # else no handle is valid
        if reason == BEFORE:
            envs.check_step()
            self._prepare(envs)
            return
        try:
            self._finish(envs, envs.batch.run_kernels() if reason == INSTEAD else reason)
        except BaseException as error:
            envs._interrupt(error)
            raise
        envs.batch.check_observed()
        self._prepare(envs)

    def _finish(self, envs: HorseLegVectorEnv, reason: int) -> None:
        """Finish a step after its kernels, and keep its results."""
        if reason == NOT_A_NUMBER:
            envs.check_actions(envs.batch.rows.actions[: envs.num_envs])
        _, terminated, truncated = envs.finish_step(reason)
        rows, n = envs.batch.rows, envs.num_envs
        self._rewards[:] = envs._rewards()
        self._terminated[:], self._truncated[:] = terminated, truncated
        self._costs[:] = rows.costs
        if self._last is not None:
            self._last[:] = rows.observations[:n]
        envs.restart_ended(terminated | truncated)

    def _prepare(self, envs: HorseLegVectorEnv) -> None:
        """Tell the handler how to take the next step."""
        batch, words = envs.batch, self._words
        is_direct = envs.is_plain and self._rewards.ndim == 1
        if is_direct:
            words[Word.KERNEL] = batch.direct_step().code.address
            words[Word.HELD] = int(batch.calls.held)
        words[Word.IS_DIRECT] = is_direct
        words[Word.ATTEND] = envs.has_ended or batch.has_pushed
        words[Word.CHECK] = envs.has_ended and envs.autoreset_mode == AutoresetMode.DISABLED

    def fail(self, error: BaseException) -> None:
        """Put the message of an error where the handler finds it, and look before the next step."""
        self.look()
        words = str(error) if isinstance(error, HoofEnvError) else f"{type(error).__name__}: {error}"
        self._message.value = words.encode()[: MESSAGE_BYTES - 1]

    # Functions of jax

    def _new_calls(self, envs: HorseLegVectorEnv) -> tuple[Callable[..., Any], ...]:
        """Return `recv`, `send` and `step`, which keep the environments alive."""
        import jax
        import jax.numpy as jnp

        handle = jax.ShapeDtypeStruct((HANDLE * 8,), np.uint8)
        results = [jax.ShapeDtypeStruct(array.shape, array.dtype) for array in self._outputs]
        names = tuple(self._infos)
        shape, rewards = self._shape, self._rewards.shape
        # By which the handler tells a handle of other environments, whose arrays have other sizes
        own = np.array([self._words.ctypes.data]).view(np.uint8)

        def call(has_results: bool, *given: Any) -> Any:
            of_rewards = jax.ShapeDtypeStruct(rewards, jnp.result_type(float))
            kinds = [handle, of_rewards, *results] if has_results else [handle]
            found = jax.ffi.ffi_call(TARGET, kinds, has_side_effect=True)(given[0], own, *given[1:])
            if not has_results:
                return found[0]
            following, of_step, observations, terminated, truncated, *infos = found
            infos = dict(zip(names, infos, strict=True))
            return following, States(observations, of_step, terminated, truncated, infos)

        def checked_handle(given: Any) -> Any:
            if not hasattr(given, "dtype") or (jnp.shape(given), given.dtype) != (handle.shape, handle.dtype):
                raise ParameterError(f"{NO_HANDLE}: {brief(given)}")
            return given

        def checked(handle: Any, actions: Any, env_id: Any) -> tuple[Any, Any]:
            if env_id is not None:
                raise ParameterError(
                    f"env_id: expected None, as all environments step together, got {env_id!r}"
                )
            wanted = f"actions: expected finite numbers in [-1, 1], shape {shape}"
            array = numbers_of(jnp.asarray, actions, shape, wanted)
            return checked_handle(handle), jnp.asarray(array, np.float32)

        receives, sends, steps = (_plain(call, has_results) for has_results in (True, False, True))

        def recv(handle: Any) -> tuple[Any, States]:
            """Return the next handle and the `States` of the last step, or of a reset."""
            return receives(checked_handle(handle))

        def send(handle: Any, actions: Any, env_id: Any = None) -> Any:
            """Take a step; return the next handle."""
            return sends(*checked(handle, actions, env_id))

        def step(handle: Any, actions: Any, env_id: Any = None) -> tuple[Any, States]:
            """Take a step; return the next handle and the `States`."""
            return steps(*checked(handle, actions, env_id))

        functions: tuple[Any, ...] = recv, send, step
        for function in functions:
            function.envs = envs
        return functions

    def __reduce__(self) -> Any:
        return type(None), ()


def _plain(call: Callable[..., Any], has_results: bool) -> Callable[..., Any]:
    """Return a call that refuses `vmap` and derivatives in words."""
    import jax

    @jax.custom_batching.custom_vmap
    def batched(*given: Any) -> Any:
        return call(has_results, *given)

    @batched.def_vmap
    def _(size: int, is_batched: Any, *given: Any) -> Any:
        raise ParameterError(
            f"envs.xla() under jax.vmap over {size}: expected no vmap, because the environments are one state"
            f" that steps as a whole: make {size} times as many with num_envs, or take hoof_env.jax.make(id),"
            " whose functions are pure"
        )

    @jax.custom_jvp
    def function(*given: Any) -> Any:
        return batched(*given)

    @function.defjvp
    def _(given: Any, tangents: Any) -> Any:
        raise ParameterError(
            "envs.xla() has no gradient: expected no derivative by actions or a handle; take"
            " hoof_env.jax.make(id), or jax.lax.stop_gradient of the actions"
        )

    return function


def _python_function(steps: XlaSteps) -> Any:
    """Return the function that the handler calls; it returns 0, or 1 after an error."""
    found = weakref.ref(steps)

    def run(reason: int) -> int:
        here = found()
        assert here is not None
        try:
            here.run(reason)
        except BaseException as error:  # no exception can pass through XLA, not even Ctrl-C
            here.fail(error)
            return 1
        return 0

    return ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)(run)

"""The text of a manual page; `manual` fills in what begins with $."""

PAGE = """\
# $name

$summary

```python
import gymnasium as gym
import hoof_env  # registers the ids

env = gym.make("$id")
observation, info = env.reset(seed=0)
observation, reward, terminated, truncated, info = env.step(env.action_space.sample())

envs = gym.make_vec("$id", num_envs=1024)  # the native one: all in one call
observations, infos = envs.reset(seed=0)
```

A worker process that has not imported the package takes `"hoof_env:$id"`.

## Description

The leg is the closed-loop linkage of Batbaatar & Wagatsuma (2021): 14 links turned by one crank, with a
hoof triangle that meets a viscoelastic ground at toe and heel (Eqs. 10-15). A second drive swings the leg's
frame about the crank centre O by phi = offset + sine coefficient * sin(theta) + cosine coefficient *
cos(theta). The policy commands crank speed and swing parameters; filters with bounded rate and acceleration
turn commands into motion. ${trunk}Lengths are *identified* from the paper's results, not published.

$about

Why the defaults are what they are: [environment.md](../environment.md).

## Action Space

`$action_space`, clipped to these limits; one action every `dt`.

$actions

${offsets}`env.unwrapped.action_for(gait)` is the action of a gait, by name or as `GaitParameters`;
`command_of(action)` are the four parameters of an action.

## Observation Space

`$observation_space`; the argument `observation` chooses groups and their order.

$observations

A weight is that of trunk and leg. Loads are those of the last substep. An approach speed is that at which
the point came down, 0 in the air. The height is that of O above y = 0, heights of the ground are above the
ground under O. A rail lacks vertical speed and height, a fixed trunk forward speed, too. Groups that are
not observed by default: $other_groups. `env.unwrapped.observation_names` has the names.

`env.unwrapped.raw_observation()` has the same before scaling: numbers by name, of the units above, which
`env.unwrapped.observation_units` has, too.

## Rewards

The sum of these terms, each in `info` under its name.

$rewards

$target_reward

A stance opens when the normal force on the hoof rises above $lift_off % of the weight, as on a force plate.
It closes when the force falls below (lift-off), or after one crank revolution, whichever comes first. On
`trunk="fixed"` progress is the load-weighted backward travel of the hoof points while they bear load.

## Starting State

$start.

`reset(options=...)` sets any of these:

$options

Every `info` of the episode has what was used. Parameters last one episode; there are:
$parameters.

The argument `randomize` draws physical parameters at each reset. So does the wrapper
`hoof_env.RandomizeParameters`, which can be switched off for an evaluation. An option has the last word.

```python
import gymnasium as gym
import hoof_env

env = gym.make("$id", randomize={"friction": [0.2, 0.6]})
env.reset(seed=0)  # with a friction drawn between these
env.reset(options={"gait": "run", "crank_angle": 0.0, "parameters": {"friction": 0.3}})
```

## Infos

Those of `reset` and `step` have the same keys, and NumPy's numbers and arrays for values (float64). They are
the terms of the reward, 0 at a reset, and:

$infos

`info["gait"]` and `info["measured"]` are arrays that also take names: `info["measured"]["vx"]`. At the end of
an episode there are `episode_summary` and, if it failed, `failure`, too. A step's info of an environment that
was made with `randomize` has what that drew; the info of `reset` also what the option set.

### What is Measured

`env.unwrapped.record()` has state and report of the engine at every substep of the last control step, by
name, shape (n, 1) with n = `dt` / `sim_dt`, and (n, 1, 1) for what is the leg's. `info["measured"]`, shape
(${measured},), has some of them at the end of the step, and sums over it.

$quantities

A stance counts as for the reward.

## Episode End

Terminated when$leaves the simulation stops being finite; `info["failure"]` says why. Truncated after
`episode_seconds`, $seconds s. The last `info` has these under `episode_summary`:

$figures

The limit in steps is `env.unwrapped.spec.max_episode_steps`. A spec keeps it: whoever makes an environment
from `env.spec` with another `episode_seconds` passes `max_episode_steps`, too. The wrapper of
`gym.make(..., max_episode_steps=...)` can only shorten episodes, and the environment cannot know where it
ends them, so `info` lacks the figures then: `env.unwrapped.episode_summary()` has them at any time. The
vector environment takes that limit itself. A step after the end warns, once an episode, and means nothing.

## Vector Environment

`gym.make_vec` gives the native one, `HorseLegVectorEnv`. One call steps all; row i has the bits of the
single environment reset with `seed + i`; arrays are fresh at each call; rewards are float64. It takes the
arguments below, and:

$vector_arguments

`infos` are those of the single environment as arrays, shape (num_envs,), or (num_envs, n) for `gait`,
`measured` and `parameters`: `infos["measured"]["highest"]` is the highest force on each in this step [N].
At the end of episodes there is `episode_summary`, a mapping of such arrays; a mask under the same name with
`_` before it says which environments it is about, as for all keys at a reset. With `SAME_STEP` the last
observations are in `final_obs`, the last infos in `final_info`. With `DISABLED` what ended must be reset
before the next step. The reset option `reset_mask`, bool of shape (num_envs,), restarts some and leaves the
others alone.

```python
import gymnasium as gym
import hoof_env

envs = gym.make_vec("$id", num_envs=3, autoreset_mode="DISABLED", max_episode_steps=2)
envs.reset(seed=[7, 8, 9])
ended = False
while not ended:
    observations, rewards, terminated, truncated, infos = envs.step(envs.action_space.sample())
    ended = (terminated | truncated).any()
distances = infos["episode_summary"]["distance_m"]
envs.reset(options={"reset_mask": terminated | truncated})
```

As Gymnasium's own it has `call`, `get_attr` and `set_attr`. `dt`, `sim_dt`, `observation_names` and
`observation_units` are as of the single one. `weight`, `episode_summary()` and `raw_observation()` have
arrays of shape (num_envs,); `record(env)` has the substeps of one of them, kept from the first call on. What
it was made with does not change: settings are arguments of `gym.make_vec`, those of an episode reset options.

With `render_mode="rgb_array"` `gymnasium.wrappers.vector.RecordVideo` films all. Of more than 16 it wants to
know how many to draw: `rendered=1` goes with `RecordVideo(..., record_first_only=True)`.

Stable-Baselines3 takes `hoof_env.Sb3VecEnv("$id", num_envs=64)`.

## State

`env.unwrapped.get_state()` has everything that changes, generator included; `set_state(state)` puts it back
and returns the observation. What follows has the same bits. Environments pickle and deep-copy.

```python
import gymnasium as gym
import hoof_env

env = gym.make("$id")
env.reset(seed=0)
state, action = env.unwrapped.get_state(), env.action_space.sample()
one = env.step(action)
env.unwrapped.set_state(state)
other = env.step(action)
assert (one[0] == other[0]).all() and one[1] == other[1]
```

## Arguments

Plain values that JSON can hold$bold. One that has no effect beside the others, as `motor_gain` where no
motor turns the crank, is refused unless it has its default. Nothing is set by assignment:
`env.unwrapped.trunk_mass = 60` raises. An assignment to a wrapper goes no further than the wrapper.

$settings

A bad argument, option or action raises `ParameterError`, a `ValueError` that says what was given and what
was expected.

$terrain

## Version History

* v0: first version.
"""

"""Actions, memory and constants of one's own, outside the package: the leg is asked for step length and
height, and a term charges a peak force once.

python examples/own_actions.py
"""

import gymnasium as gym
import numpy as np

import hoof_env
from hoof_env.leg.kinematics import FrameMotion, pose

LEG = hoof_env.load_geometry()
WALK = hoof_env.load_gait("walk")
TURN = np.linspace(0.0, 2 * np.pi, 60, endpoint=False)


def step_of(sine, cosine):
    """Return length and height of a step [m]: the extent of the toe's path under a standing trunk."""
    swing = WALK.swing_offset + sine * np.sin(TURN) + cosine * np.cos(TURN)
    path = [
        pose(LEG, theta, frame=FrameMotion(phi)).point(LEG.toe)
        for theta, phi in zip(TURN, swing, strict=True)
    ]
    return np.ptp(path, axis=0)


def swing_per_step(small=1e-3):
    """Return the change of the swing's sine and cosine for a change of step length and height [rad/m], at
    the walk: the inverse of the matrix of central differences."""
    both = WALK.swing_sin, WALK.swing_cos
    columns = [
        step_of(both[0] + d, both[1] + e) - step_of(both[0] - d, both[1] - e)
        for d, e in ((small, 0.0), (0.0, small))
    ]
    return np.linalg.inv(np.transpose(columns) / (2 * small))


SWING = swing_per_step()
# At an action of 1 the faster of both coefficients changes at its largest rate.
(LENGTH_SINE, HEIGHT_SINE), (LENGTH_COSINE, HEIGHT_COSINE) = (SWING / np.abs(SWING).max(0)).tolist()


def steps(action, scene):
    """Return the rates of crank speed, swing offset, sine and cosine, each over its largest."""
    return (
        action[0],
        0.0,
        LENGTH_SINE * action[1] + HEIGHT_SINE * action[2],
        LENGTH_COSINE * action[1] + HEIGHT_COSINE * action[2],
    )


STEPS = hoof_env.ActionMap(
    "steps",
    {"rate of crank speed": "faster", "rate of step length": "longer", "rate of step height": "higher"},
    steps,
)


def impact(step, weight, free):
    """Charge each newton by which the episode's highest force rises, above a force that is free."""
    own = step.episode.own.impact
    highest = np.maximum(own.highest, step.sums.highest_grf)
    rise = np.maximum(highest, free) - np.maximum(own.highest, free)
    own.highest = highest
    return -0.001 * weight * rise


def highest_so_far(scene, free):
    """Return the episode's highest force over the one that is free [-]."""
    return scene.episode.own.impact.highest / free


FREE = hoof_env.Constant("free", 1000.0, "N", "force that costs nothing", low=1.0)

hoof_env.register(
    "my_lab/Steps-v0",
    base="leg",
    action_map=STEPS,
    terms=[
        hoof_env.Term(
            "impact",
            0.5,
            "1/kN",
            "minus what the highest force rises above `free`",
            impact,
            constants=[FREE],
            state=[hoof_env.TermState("highest", 0.0, "N", "highest force of the episode")],
        )
    ],
    entries=[
        hoof_env.Entry(
            "highest force so far",
            "own",
            "-",
            highest_so_far,
            hoof_env.Scale("tanh(x)", saturates=True),
            constants=[FREE],
        )
    ],
)

if __name__ == "__main__":
    env = gym.make("my_lab/Steps-v0", constants={"free": 1500.0})
    envs = gym.make_vec("my_lab/Steps-v0", num_envs=64, constants={"free": 1500.0})
    observation, info = env.reset(seed=0)
    envs.reset(seed=0)
    charged = 0.0
    for k in range(100):
        longer = np.array([0.0, np.cos(0.1 * k), 0.0], np.float32)
        observation, reward, *_, info = env.step(longer)
        rewards = envs.step(np.tile(longer, (64, 1)))[1]
        assert reward == rewards[0]  # the same bits alone and among many
        charged += info["reward_impact"]
    print(
        f"{env.action_space.shape[0]} actions, {env.unwrapped.action_form}; charged {charged:.3f} for peaks"
    )

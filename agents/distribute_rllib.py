"""RLlib's PPO with its environments on several workers, as one trial of Ray Tune.

Its settings are those of agents/hyperparams/ppo.yml as far as RLlib has them: it neither scales rewards nor
lets the first spread of actions be chosen.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from agents import runs
from agents.command import parse_pairs
from agents.settings import FOLDER, load_settings
from hoof_env.errors import ParameterError, check_number

if TYPE_CHECKING:
    from agents.distribute import Rllib


def make_config(args: Rllib) -> Any:
    """RLlib's `PPOConfig` for `args`.

    Raises:
        ParameterError, DataFileError: the arguments, the environment or the hyperparameter file do not fit.
    """
    from ray.rllib.algorithms.ppo import PPOConfig

    env_kwargs = parse_pairs("--env-kwargs", args.env_kwargs)
    settings = load_settings(FOLDER / "ppo.yml", args.env_id) | parse_pairs("--params", args.params)
    rate = settings["learning_rate"]
    if isinstance(rate, str):  # lin_<x>
        rate = [[0, float(rate.removeprefix("lin_"))], [args.steps, 0.0]]
    return (
        PPOConfig()
        .environment(f"hoof_env:{args.env_id}", env_config=env_kwargs)
        .env_runners(
            num_env_runners=args.workers,
            num_envs_per_env_runner=args.n_envs,
            gym_env_vectorize_mode="vector_entry_point",
        )
        .training(
            lr=rate,
            gamma=settings["gamma"],
            lambda_=settings["gae_lambda"],
            clip_param=settings["clip_range"],
            entropy_coeff=settings["ent_coef"],
            vf_loss_coeff=settings["vf_coef"],
            grad_clip=settings["max_grad_norm"],
            num_epochs=settings["n_epochs"],
            minibatch_size=settings["batch_size"],
            train_batch_size_per_learner=settings["n_steps"] * settings["n_envs"],
        )
        .rl_module(model_config={"fcnet_hiddens": settings["policy_kwargs"]["net_arch"]})
        .learners(num_learners=0)  # in the trial's own process
        .fault_tolerance(restart_failed_env_runners=True)
        .debugging(seed=args.seed)
    )


def run_rllib(args: Rllib) -> int:
    """Train as `args` say, or go on; see `agents.distribute.fit` for the rest."""
    from agents.distribute import fit, start

    for name in ("workers", "n_envs", "steps"):
        check_number(name, getattr(args, name), low=1)
    check_number("seed", args.seed, low=0)
    kwargs = parse_pairs("--env-kwargs", args.env_kwargs)
    with runs.make_env(args.env_id, **kwargs) as env:
        if env.spec is None or env.spec.vector_entry_point is None or hasattr(env.unwrapped, "reward_space"):
            raise ParameterError(f"env_id: expected one with a native vector environment, got {args.env_id}")
        runs.warm_up(env)
    start(args)
    from ray import tune

    # No metric: Tune would refuse iterations in which no episode ended
    config = tune.TuneConfig(trial_dirname_creator=lambda trial: f"seed={args.seed}")
    tuner = {"trainable": "PPO", "param_space": make_config(args), "tune_config": config}
    return fit(
        args, f"rllib-{args.env_id.rpartition('/')[2]}", tuner, ["seed"],
        stop={"num_env_steps_sampled_lifetime": args.steps},
        checkpoint_config=tune.CheckpointConfig(
            num_to_keep=1, checkpoint_frequency=10, checkpoint_at_end=True
        ),
    )  # fmt: skip

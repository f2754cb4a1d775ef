"""Proximal policy optimisation (PPO) in one file, with torch and Gymnasium alone, to read and to change.

    python -m agents.ppo_flat                          a million steps of hoof_env/HorseLeg-v0
    python -m agents.ppo_flat --steps 100000 --env-id hoof_env/HorseLegFixed-v0 --out runs/flat

Read `learn` first: it plays a rollout, estimates what its actions were worth, improves the agent, reports.

Vector environments restart in Gymnasium's default way: the step after one that ends an episode ignores its
action and returns the next first observation. So the value of a last observation is at hand where a time
limit truncates an episode, and only a termination has no future. Steps that restart are left out.
"""

from __future__ import annotations

import csv
import io
import time
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import gymnasium as gym
import numpy as np
import torch
from torch import Tensor, nn
from torch.distributions import Normal

import hoof_env  # noqa: F401  (registers the environments)
from agents.command import check_threads, parse_pairs, run
from hoof_env._output import check_folder, staged
from hoof_env.errors import HoofEnvError, ParameterError, check_number


@dataclass(frozen=True)
class Args:
    env_id: str = "hoof_env/HorseLeg-v0"
    """registered environment; module:id imports the module first"""
    seed: int = 0
    """of the environments, the network and the sampling"""
    steps: int = 1_000_000
    """environment steps in all, rounded up to whole rollouts"""
    n_envs: int = 32
    """environments stepped side by side"""
    vectorization: Literal["sync", "async", "vector_entry_point"] | None = None
    """of gymnasium.make_vec; otherwise the id's own vector environment where it has one, else sync"""
    env_kwargs: tuple[str, ...] = ()
    """arguments of the environment: key=value ..., or one JSON object"""
    n_steps: int = 256
    """steps of each environment in a rollout"""
    batch_size: int = 2048
    """steps in one gradient step"""
    n_epochs: int = 8
    """passes over a rollout"""
    learning_rate: float = 1e-3
    """of Adam, falling linearly to zero"""
    gamma: float = 0.99
    """discount per step"""
    gae_lambda: float = 0.95
    """of generalised advantage estimation"""
    clip_range: float = 0.2
    """of the ratio of probabilities"""
    ent_coef: float = 0.0
    """weight of the entropy"""
    vf_coef: float = 0.5
    """weight of the value loss"""
    max_grad_norm: float = 0.5
    """gradients are scaled down to this norm"""
    log_std_init: float = -1.5
    """logarithm of the action noise at the start"""
    net_arch: tuple[int, ...] = (64, 64)
    """units of the hidden layers, policy and value each"""
    out: Path | None = None
    """folder for model.pt and progress.csv; otherwise nothing is kept"""
    device: str = "cpu"
    """torch device; small networks are fastest on the CPU"""
    torch_threads: int = 1
    """threads of torch; on a busy machine more than one are slower"""


LIMITS = {
    **dict.fromkeys(("steps", "n_envs", "n_steps", "n_epochs"), (1, np.inf)),
    **dict.fromkeys(("learning_rate", "gamma", "gae_lambda"), (0, 1)),
    **dict.fromkeys(("clip_range", "ent_coef", "vf_coef", "max_grad_norm"), (0, np.inf)),
    "batch_size": (2, np.inf),  # advantages are normalised over a batch
    "seed": (0, 2**63),
    "log_std_init": (-20, 20),
}
"""Lowest and highest of what a number of `Args` may be."""
DIVERGED = "the training diverged: policy or gradient is not finite any more; try a lower learning_rate"


@dataclass
class Learned:
    agent: Agent
    progress: list[dict[str, float]] = field(default_factory=list)


class Agent(nn.Module):
    """A policy (normal, its deviation independent of the observation) and a value, two networks."""

    def __init__(self, n_obs: int, n_actions: int, net_arch: tuple[int, ...], log_std_init: float) -> None:
        super().__init__()
        self.actor = _network([n_obs, *net_arch, n_actions], last_gain=0.01)
        self.critic = _network([n_obs, *net_arch, 1], last_gain=1.0)
        self.log_std = nn.Parameter(torch.full((n_actions,), log_std_init))

    def policy(self, observation: Tensor) -> Normal:
        """The distribution of actions, shape (..., n_actions); `HoofEnvError` after a divergence."""
        try:
            return Normal(self.actor(observation), self.log_std.exp())
        except ValueError:  # not a number, or a deviation of zero
            raise HoofEnvError(DIVERGED) from None

    def value(self, observation: Tensor) -> Tensor:
        """Expected discounted return, shape (...)."""
        value: Tensor = self.critic(observation).squeeze(-1)
        return value


def _network(sizes: list[int], last_gain: float) -> nn.Sequential:
    layers: list[nn.Module] = []
    for index, (inputs, outputs) in enumerate(pairwise(sizes)):
        last = index == len(sizes) - 2
        layer = nn.Linear(inputs, outputs)
        nn.init.orthogonal_(layer.weight, last_gain if last else float(np.sqrt(2)))
        nn.init.zeros_(layer.bias)
        layers += [layer] if last else [layer, nn.Tanh()]
    return nn.Sequential(*layers)


def estimate_advantages(
    rewards: Tensor, values: Tensor, terminated: Tensor, truncated: Tensor, gamma: float, gae_lambda: float
) -> Tensor:
    """Generalised advantage estimation (Schulman et al. 2016) over time limits, shape (T, n), of T steps of n
    environments; `values`, shape (T + 1, n), are of the observations before each step and after the last. The
    observation after a step that ends an episode is that episode's last one."""
    surprise = rewards + gamma * values[1:] * ~terminated - values[:-1]
    goes_on = ~(terminated | truncated)
    advantages = torch.zeros_like(rewards)
    later = torch.zeros_like(rewards[0])
    for t in reversed(range(len(rewards))):
        advantages[t] = later = surprise[t] + gamma * gae_lambda * goes_on[t] * later
    return advantages


def make_envs(args: Args) -> gym.wrappers.vector.RecordEpisodeStatistics:
    """The vector environment, with episode returns. `ParameterError`: unknown id or argument, spaces that are
    not boxes of one dimension, or an environment that restarts in another way than on the next step."""
    kwargs: dict[str, Any] = parse_pairs("--env-kwargs", args.env_kwargs)
    try:
        envs = gym.make_vec(args.env_id, args.n_envs, args.vectorization, **kwargs)
    except (gym.error.Error, ModuleNotFoundError, TypeError) as error:
        raise ParameterError(
            f"environment {args.env_id!r} with {kwargs or 'no arguments'}: {error}"
        ) from None
    for space in (envs.single_observation_space, envs.single_action_space):
        if not isinstance(space, gym.spaces.Box) or len(space.shape) != 1:
            raise ParameterError(f"environment {args.env_id!r}: expected boxes of one dimension, got {space}")
    mode = envs.metadata.get("autoreset_mode")
    if mode is not gym.vector.AutoresetMode.NEXT_STEP:
        raise ParameterError(f"environment {args.env_id!r}: expected autoreset on the next step, got {mode}")
    return gym.wrappers.vector.RecordEpisodeStatistics(envs)


class Rollout:
    """Steps of all environments, shape (n_steps, n_envs, ...); observations have one row more, for the value
    after the last step. `restarts` are steps that only restart an episode; `ended`, whether the last step of
    each environment ended one."""

    def __init__(self, args: Args, n_obs: int, n_actions: int, device: torch.device) -> None:
        shape = (args.n_steps, args.n_envs)
        self.device = device
        self.observations = torch.zeros((args.n_steps + 1, args.n_envs, n_obs), device=device)
        self.actions = torch.zeros((*shape, n_actions), device=device)
        self.log_probs, self.rewards = torch.zeros(shape, device=device), torch.zeros(shape, device=device)
        self.terminated = torch.zeros(shape, dtype=torch.bool, device=device)
        self.truncated, self.restarts = torch.zeros_like(self.terminated), torch.zeros_like(self.terminated)
        self.ended = torch.zeros(args.n_envs, dtype=torch.bool, device=device)

    def play(self, agent: Agent, envs: gym.vector.VectorEnv) -> None:
        """Go on from the last observation for as many steps as there are rows."""
        box: Any = envs.single_action_space
        self.observations[0] = self.observations[-1]
        for t in range(len(self.rewards)):
            with torch.no_grad():
                policy = agent.policy(self.observations[t])
                self.actions[t] = policy.sample()
                self.log_probs[t] = policy.log_prob(self.actions[t]).sum(-1)
            # A sample outside the box is played at its edge, but learnt from as it was drawn
            played = np.clip(self.actions[t].cpu().numpy(), box.low, box.high)
            observation, reward, terminations, truncations, _ = envs.step(played)
            self.restarts[t] = self.ended
            self.observations[t + 1] = self._tensor(observation)
            self.rewards[t] = self._tensor(reward)
            self.terminated[t] = self._tensor(terminations)
            self.truncated[t] = self._tensor(truncations)
            self.ended = self.terminated[t] | self.truncated[t]

    def experience(self, agent: Agent, args: Args) -> dict[str, Tensor]:
        """The steps that are learnt from, in one row each, with their advantages and the targets of the
        value."""
        with torch.no_grad():
            values = agent.value(self.observations)
            advantages = estimate_advantages(
                self.rewards, values, self.terminated, self.truncated, args.gamma, args.gae_lambda
            )
        lived = ~self.restarts
        return {
            "observation": self.observations[:-1][lived],
            "action": self.actions[lived],
            "log_prob": self.log_probs[lived],
            "advantage": advantages[lived],
            "target": (advantages + values[:-1])[lived],
        }

    def _tensor(self, array: Any) -> Tensor:
        return torch.as_tensor(array, device=self.device)


def improve(
    agent: Agent,
    optimizer: torch.optim.Optimizer,
    experience: dict[str, Tensor],
    shuffle: np.random.Generator,
    args: Args,
) -> None:
    """Gradient steps on shuffled batches; `HoofEnvError` if the training diverges."""
    for _ in range(args.n_epochs):
        order = shuffle.permutation(len(experience["target"]))
        for start in range(0, len(order), args.batch_size):
            chosen = torch.as_tensor(order[start : start + args.batch_size], device=agent.log_std.device)
            if len(chosen) > 1:
                loss = _loss(agent, {key: values[chosen] for key, values in experience.items()}, args)
                optimizer.zero_grad()
                loss.backward()
                norm = nn.utils.clip_grad_norm_(agent.parameters(), args.max_grad_norm)
                if not norm.isfinite():  # as of a loss that is none
                    raise HoofEnvError(DIVERGED)
                optimizer.step()


def learn(args: Args) -> Learned:
    """Train as `args` say, with a printed line per rollout. The same arguments give the same agent.
    `ParameterError`: the arguments or the environment do not fit. `HoofEnvError`: the training diverged."""
    device = check(args)
    torch.set_num_threads(args.torch_threads)
    torch.manual_seed(args.seed)
    shuffle = np.random.default_rng(args.seed)
    envs = make_envs(args)
    n_obs = gym.spaces.flatdim(envs.single_observation_space)
    n_actions = gym.spaces.flatdim(envs.single_action_space)
    agent = Agent(n_obs, n_actions, args.net_arch, args.log_std_init).to(device)
    optimizer = torch.optim.Adam(agent.parameters(), lr=args.learning_rate, eps=1e-5)
    learned, rollout = Learned(agent), Rollout(args, n_obs, n_actions, device)

    n_rollouts = -(-args.steps // (args.n_steps * args.n_envs))
    started = time.monotonic()
    first, _ = envs.reset(seed=args.seed)
    rollout.observations[-1] = torch.as_tensor(first, device=device)
    try:
        for number in range(n_rollouts):
            optimizer.param_groups[0]["lr"] = args.learning_rate * (1 - number / n_rollouts)
            rollout.play(agent, envs)
            improve(agent, optimizer, rollout.experience(agent, args), shuffle, args)
            steps = (number + 1) * args.n_steps * args.n_envs
            learned.progress.append(report(steps, time.monotonic() - started, envs))
    finally:
        envs.close()
    if args.out:
        write(learned, args.out)
    return learned


def check(args: Args) -> torch.device:
    for name, (low, high) in LIMITS.items():
        check_number(name, getattr(args, name), low=low, high=high)
    check_threads(args.torch_threads)
    for units in args.net_arch:
        check_number("net_arch", units, low=1)
    if args.out:
        check_folder(args.out)
    try:
        device = torch.device(args.device)
        torch.zeros(1, device=device).item()
    except Exception as error:  # each kind of device raises its own
        reason = str(error).partition("\n")[0]
        raise ParameterError(f"device: expected one that torch has, got {args.device!r}: {reason}") from None
    return device


def report(steps: int, seconds: float, envs: gym.wrappers.vector.RecordEpisodeStatistics) -> dict[str, float]:
    """Print how it goes, and return it as a row of progress.csv."""
    row = {
        "steps": steps,
        "seconds": round(seconds, 3),
        "sps": round(steps / seconds),
        "episodes": int(envs.episode_count),
        "episodic_return": float(np.mean(envs.return_queue)) if envs.return_queue else float("nan"),
    }
    print(
        f"steps {steps:>10,}   SPS {row['sps']:>7,}   episodes {row['episodes']:>6,}   "
        f"episodic return {row['episodic_return']:.2f}",
        flush=True,
    )
    return row


def write(learned: Learned, folder: Path) -> None:
    weights = io.BytesIO()
    torch.save(learned.agent.state_dict(), weights)
    with staged(folder) as stage:
        (stage / "model.pt").write_bytes(weights.getvalue())
        with (stage / "progress.csv").open("w", newline="") as file:
            writer = csv.DictWriter(file, list(learned.progress[0]))
            writer.writeheader()
            writer.writerows(learned.progress)


def _loss(agent: Agent, batch: dict[str, Tensor], args: Args) -> Tensor:
    """Eq. 9 of Schulman et al. 2017, with advantages normalised over the batch."""
    policy = agent.policy(batch["observation"])
    ratio = (policy.log_prob(batch["action"]).sum(-1) - batch["log_prob"]).exp()
    advantage = (batch["advantage"] - batch["advantage"].mean()) / (batch["advantage"].std() + 1e-8)
    clipped = ratio.clamp(1 - args.clip_range, 1 + args.clip_range)
    policy_loss = -torch.min(advantage * ratio, advantage * clipped).mean()
    value_loss = (agent.value(batch["observation"]) - batch["target"]).square().mean()
    entropy = policy.entropy().sum(-1).mean()
    loss: Tensor = policy_loss + args.vf_coef * value_loss - args.ent_coef * entropy
    return loss


def main(argv: list[str] | None = None) -> None:
    import tyro

    learn(tyro.cli(Args, args=argv, prog="python -m agents.ppo_flat", description=__doc__))


if __name__ == "__main__":
    run(main)

"""A critic that knows more than its actor, with Stable-Baselines3: true numbers stand last in the
observation (`privileged`), and the policy hands them to the critic alone.

python examples/asymmetric_critic.py
"""

from typing import Any

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import MlpExtractor
from stable_baselines3.common.vec_env import VecMonitor

from hoof_env import Sb3VecEnv


class TwoSights(torch.nn.Module):
    """Networks of an actor that sees the first numbers, and of a critic that sees all.

    Args:
        seen: number of numbers that the actor sees.
        size: number of all.
        widths: width of the hidden layers of both.
    """

    def __init__(self, seen: int, size: int, widths: Any) -> None:
        super().__init__()
        self.seen = seen
        self.actor = MlpExtractor(seen, {"pi": widths, "vf": []}, torch.nn.Tanh)
        self.critic = MlpExtractor(size, {"pi": [], "vf": widths}, torch.nn.Tanh)
        self.latent_dim_pi = self.actor.latent_dim_pi
        self.latent_dim_vf = self.critic.latent_dim_vf

    def forward(self, observations: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the last hidden layers of actor and critic."""
        return self.forward_actor(observations), self.forward_critic(observations)

    def forward_actor(self, observations: torch.Tensor) -> torch.Tensor:
        """Return the last hidden layer of the actor."""
        return self.actor.forward_actor(observations[..., : self.seen])

    def forward_critic(self, observations: torch.Tensor) -> torch.Tensor:
        """Return the last hidden layer of the critic."""
        return self.critic.forward_critic(observations)


class AsymmetricPolicy(ActorCriticPolicy):
    """Policy of Stable-Baselines3 with `TwoSights`, for `policy_kwargs={"seen": ...}`."""

    def __init__(self, *args: Any, seen: int, widths: tuple[int, ...] = (64, 64), **kwargs: Any) -> None:
        self.seen = seen
        self.widths = widths
        super().__init__(*args, **kwargs)

    def _build_mlp_extractor(self) -> None:
        self.mlp_extractor = TwoSights(self.seen, self.features_dim, list(self.widths))

    def _get_constructor_parameters(self) -> dict[str, Any]:
        return super()._get_constructor_parameters() | {"seen": self.seen, "widths": self.widths}


def learner(num_envs: int = 64, **settings: Any) -> PPO:
    """Return a learner on noisy observations whose critic sees the true ones."""
    noisy = {"noise": {"trunk": 0.2}, "privileged": ["trunk"], **settings}
    envs = VecMonitor(Sb3VecEnv("hoof_env/HorseLeg-v0", num_envs=num_envs, **noisy))
    names = envs.get_attr("observation_names", [0])[0]
    seen = sum(not name.startswith("true ") for name in names)
    return PPO(
        AsymmetricPolicy, envs, n_steps=64, batch_size=16 * num_envs, policy_kwargs={"seen": seen}, seed=0
    )


if __name__ == "__main__":
    model = learner()
    model.learn(200_000, progress_bar=False)
    returns = [episode["r"] for episode in model.ep_info_buffer or ()]
    print(f"mean return of the last {len(returns)} episodes: {sum(returns) / len(returns):.1f}")

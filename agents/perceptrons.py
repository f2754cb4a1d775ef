"""Perceptrons with tanh in NumPy: their outputs, the loss of PPO over a batch, and its gradient.

Most of the time is in the products of matrices. What comes between them is done in place and in few calls,
in arrays that stay from batch to batch: torch spends more time there than in the products.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from torch import nn
from torch.nn.utils import parameters_to_vector, vector_to_parameters

Floats = NDArray[np.float32]
Room = tuple[Floats, ...]
"""An array for each layer, of as many rows as there are inputs."""

CHUNK = 1000
"""Most steps of a batch that one thread takes at once: their numbers stay in the cache. The gradients of
chunks are added up in order, so any number of threads gives the same bits."""

ONES = np.ones(CHUNK, np.float32)
"""A product with it is a sum over rows, and faster."""

LOG_PROB = 0
ADVANTAGE = 1
TARGET = 2
ACTIONS = 3
"""Columns of a step: logarithm of the probability, advantage, target of the value, and the actions from the
last column on."""


def room(rows: int, *widths: int) -> Room:
    """Return arrays of so many rows."""
    return tuple(np.empty((rows, width), np.float32) for width in widths)


@dataclass(frozen=True)
class Network:
    """Perceptron with tanh; its matrices, shape (outputs, inputs) each, and biases are views of a vector."""

    matrices: tuple[Floats, ...]
    biases: tuple[Floats, ...]

    def room(self, rows: int) -> Room:
        """Return arrays for the outputs of each layer."""
        return room(rows, *map(len, self.biases))

    def __call__(self, x: Floats) -> Floats:
        """Return outputs, shape (..., outputs), for rows of inputs, shape (..., inputs)."""
        rows = x.reshape(-1, x.shape[-1])
        found = []
        for begin in range(0, len(rows), CHUNK):
            part = rows[begin : begin + CHUNK]
            found.append(self.forward(part, self.room(len(part))))
        return np.concatenate(found).reshape(*x.shape[:-1], -1)

    def forward(self, x: Floats, outputs: Room) -> Floats:
        """Compute the outputs of each layer for rows of inputs, and return the last; hidden layers have a
        tanh."""
        for matrix, bias, y in zip(self.matrices, self.biases, outputs, strict=True):
            np.dot(x, matrix.T, y)
            x = np.add(y, bias, y)
            if y is not outputs[-1]:
                np.tanh(y, y)
        return x

    def backward(self, x: Floats, outputs: Room, slopes: Room, by: Network) -> None:
        """Compute the derivatives by matrices and biases from those by the last outputs, which the last of
        `slopes` holds. The other slopes and outputs are overwritten."""
        ones = ONES[: len(x)]
        slope = slopes[-1]
        for k in reversed(range(len(slopes))):
            below = outputs[k - 1] if k else x
            np.dot(slope.T, below, by.matrices[k])
            np.dot(ones, slope, by.biases[k])
            if k:
                slope = np.dot(slope, self.matrices[k], slopes[k - 1])
                # Slope of tanh by its own value: 1 - tanh^2
                np.square(below, below)
                slope *= np.subtract(1.0, below, below)


@dataclass(frozen=True)
class Weights:
    """Weights of a policy as one vector, and by name as views of it."""

    vector: Floats
    actor: Network
    critic: Network
    log_std: Floats

    @classmethod
    def of(cls, policy: Any) -> Weights:
        """Return the weights of a policy; its parameters become views of the vector."""
        vector = parameters_to_vector(policy.parameters()).detach()
        # From here on the optimiser changes one vector, and torch sees it
        vector_to_parameters(vector, policy.parameters())

        def network(hidden: nn.Sequential, last: nn.Linear) -> Network:
            layers = [*(layer for layer in hidden if isinstance(layer, nn.Linear)), last]
            return Network(
                tuple(layer.weight.detach().numpy() for layer in layers),
                tuple(layer.bias.detach().numpy() for layer in layers),
            )

        hidden = policy.mlp_extractor
        actor = network(hidden.policy_net, policy.action_net)
        critic = network(hidden.value_net, policy.value_net)
        return cls(vector.numpy(), actor, critic, policy.log_std.detach().numpy())


@dataclass(frozen=True)
class Loss:
    """Numbers of the loss of a batch of `count` steps; `mean` and `deviation` are of its advantages."""

    count: int
    clip_range: float
    vf_coef: float
    ent_coef: float
    mean: float
    deviation: float


class Part:
    """Gradient of the loss over a part of a batch, with buffers for intermediate results.

    Attributes:
        vector: the gradient, in the order of the weights' vector.
        losses: part of the losses of policy and value.
    """

    def __init__(self, policy: Any, weights: Weights, rows: int) -> None:
        self.weights = weights
        # A copy of the policy has the layout of its derivatives
        self.by = Weights.of(copy.deepcopy(policy))
        self.vector = self.by.vector
        self.losses = (0.0, 0.0)
        self.x, self.steps = room(rows, weights.actor.matrices[0].shape[1], ACTIONS + weights.log_std.size)
        self.actor, self.actor_slopes = weights.actor.room(rows), weights.actor.room(rows)
        self.critic, self.critic_slopes = weights.critic.room(rows), weights.critic.room(rows)

    def compute(self, observations: Floats, steps: Floats, rows: NDArray[np.int64], loss: Loss) -> None:
        """Compute gradient and losses for these rows of all steps."""
        # A training that diverges says so itself (agents/watch.py)
        with np.errstate(over="ignore", invalid="ignore"):
            # With another mode NumPy would take into a copy first
            np.take(observations, rows, 0, self.x, "clip")
            np.take(steps, rows, 0, self.steps, "clip")
            actor, critic = self.weights.actor, self.weights.critic
            actor.forward(self.x, self.actor)
            critic.forward(self.x, self.critic)
            self.losses = self.of_policy(loss), self.of_value(loss)
            actor.backward(self.x, self.actor, self.actor_slopes, self.by.actor)
            critic.backward(self.x, self.critic, self.critic_slopes, self.by.critic)

    def of_policy(self, loss: Loss) -> float:
        """Compute the loss of the policy by Schulman et al. 2017 (Eq. 7) and its derivatives.

        The entropy is the sum of `log_std`, up to a constant.
        """
        log_std, by_log_std = self.weights.log_std, self.by.log_std
        ones = ONES[: len(self.steps)]
        inverse = np.exp(-log_std)
        z = self.actor_slopes[-1]
        np.subtract(self.steps[:, ACTIONS:], self.actor[-1], z)
        z *= inverse
        squares = np.square(z, self.actor[-1])
        log_prob = np.dot(squares, ONES[: log_std.size])
        log_prob *= -0.5
        log_prob -= self.steps[:, LOG_PROB]
        log_prob -= np.add.reduce(log_std)
        ratio = np.exp(log_prob, log_prob)
        # Normalised, and negative, as the loss is to fall
        charge = self.steps[:, ADVANTAGE] - loss.mean
        charge *= -1 / (loss.deviation * loss.count)
        held = np.minimum(np.maximum(ratio, 1 - loss.clip_range), 1 + loss.clip_range)
        held *= charge
        slope = np.multiply(ratio, charge, ratio)
        found = np.dot(np.maximum(slope, held), ones)
        # The clipped ratio does not change where it is the one that counts
        slope[slope < held] = 0.0
        np.dot(slope, squares, by_log_std)
        # The entropy grows with each logarithm by 1
        by_log_std -= np.dot(slope, ones) + loss.ent_coef * len(slope) / loss.count
        z *= slope[:, None]
        z *= inverse
        return float(found)

    def of_value(self, loss: Loss) -> float:
        """Compute the mean squared error of the value and its derivatives."""
        error = self.critic_slopes[-1]
        np.subtract(self.critic[-1], self.steps[:, TARGET, None], error)
        found = float(np.vdot(error, error)) / loss.count
        # Twice the coefficient: the derivative of a square
        error *= 2 * loss.vf_coef
        error /= loss.count
        return found

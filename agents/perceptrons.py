"""Perceptrons with tanh, compiled: their outputs, the loss of PPO over a batch, and its gradient.

The gradient of such networks is a dozen products of small matrices, and torch spends more time between them
than in them. A network is a tuple of matrices, shape (outputs, inputs) each, and one of biases.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from torch import nn
from torch.nn.utils import parameters_to_vector, vector_to_parameters

from hoof_env.simd.compile import inline_llvm, kernel

Floats = NDArray[np.float32]

CHUNK = 1000
"""Most steps of a batch that one thread takes at once: their numbers stay in the cache. The gradients of
chunks are added up in order, so any number of threads gives the same bits."""

LOG_PROB = 0
ADVANTAGE = 1
TARGET = 2
ACTIONS = 3
"""Columns of a step: logarithm of the probability, advantage, target of the value, and the actions from the
last column on."""

# Numbers of float32 throughout: one of float64 would make the loops compute in it
ZERO, HALF, ONE, FAR = (np.float32(number) for number in (0.0, 0.5, 1.0, 100.0))
# Coefficients of `tanh`, numerator and denominator
C0, A1, A2, A3 = (np.float32(number) for number in (34459425, 4729725, 135135, 990))
B1, B2, B3, B4 = (np.float32(number) for number in (16216200, 945945, 13860, 45))


@inline_llvm
def tanh(x):  # type: ignore[no-untyped-def]
    """Return tanh by the first nine terms of Lambert's continued fraction, within 8e-6: without a call, so
    that the compiler can vectorise it."""
    # Beyond, the fraction would overflow; tanh is 1 to the last bit long before
    x = min(max(x, -FAR), FAR)
    s = x * x
    above = x * (C0 + s * (A1 + s * (A2 + s * (A3 + s))))
    y = above / (C0 + s * (B1 + s * (B2 + s * (B3 + s * B4))))
    return min(max(y, -ONE), ONE)


@inline_llvm
def forward(x, matrices, biases, outputs):  # type: ignore[no-untyped-def]
    """Compute the outputs of each layer for rows of inputs; hidden layers have a tanh."""
    for k in range(len(matrices)):
        y = outputs[k]
        bias = biases[k]
        np.dot(x if k == 0 else outputs[k - 1], matrices[k].T, y)
        if k < len(matrices) - 1:
            for i in range(y.shape[0]):
                for j in range(y.shape[1]):
                    y[i, j] = tanh(y[i, j] + bias[j])
        else:
            for i in range(y.shape[0]):
                for j in range(y.shape[1]):
                    y[i, j] += bias[j]


@inline_llvm
def backward(x, matrices, outputs, slopes, by_matrices, by_biases):  # type: ignore[no-untyped-def]
    """Compute the derivatives by matrices and biases from those by the last outputs, which the last of
    `slopes` holds; the others are overwritten with those by the hidden layers."""
    # From the last layer to the first, each from the slopes of the next one
    for k in range(len(matrices) - 1, -1, -1):
        slope = slopes[k]
        by_bias = by_biases[k]
        if k < len(matrices) - 1:
            np.dot(slopes[k + 1], matrices[k + 1], slope)
            y = outputs[k]
            # Slope of tanh by its own value: 1 - tanh^2
            for i in range(slope.shape[0]):
                for j in range(slope.shape[1]):
                    slope[i, j] *= ONE - y[i, j] * y[i, j]
        by_bias[:] = ZERO
        for i in range(slope.shape[0]):
            for j in range(slope.shape[1]):
                by_bias[j] += slope[i, j]
        np.dot(slope.T, x if k == 0 else outputs[k - 1], by_matrices[k])


@inline_llvm
def loss_of(  # type: ignore[no-untyped-def]
    means,
    values,
    log_std,
    steps,
    clip_range,
    vf_coef,
    ent_coef,
    count,
    by_means,
    by_values,
    by_log_std,
    losses,
):
    """Compute the loss of Schulman et al. 2017 (Eq. 9) of some of `count` steps, and its derivatives.

    `LOG_PROB` and the names after it are the columns of `steps`. The entropy is the sum of `log_std`, up to a
    constant.
    """
    # The entropy grows with each logarithm by 1
    by_log_std[:] = -ent_coef * np.float32(len(steps)) / count
    losses[:] = ZERO
    for i in range(len(steps)):
        log_prob = ZERO
        for k in range(ACTIONS, steps.shape[1]):
            z = (steps[i, k] - means[i, k - ACTIONS]) * np.exp(-log_std[k - ACTIONS])
            log_prob -= HALF * z * z + log_std[k - ACTIONS]
        ratio = np.exp(log_prob - steps[i, LOG_PROB])
        advantage = steps[i, ADVANTAGE]
        # Clipped surrogate (Eq. 7): its slope is 0 where the clipped ratio is the smaller one
        held = min(max(ratio, ONE - clip_range), ONE + clip_range)
        losses[0] -= min(ratio * advantage, held * advantage) / count
        weight = -ratio * advantage / count if ratio * advantage <= held * advantage else ZERO
        for k in range(len(log_std)):
            z = (steps[i, ACTIONS + k] - means[i, k]) * np.exp(-log_std[k])
            by_means[i, k] = weight * z * np.exp(-log_std[k])
            by_log_std[k] += weight * (z * z - ONE)
        error = values[i, 0] - steps[i, TARGET]
        losses[1] += error * error / count
        # Twice the coefficient: the derivative of a square
        by_values[i, 0] = (vf_coef + vf_coef) * error / count


def gradient_of(  # type: ignore[no-untyped-def]
    observations,
    steps,
    rows,
    scale,
    x,
    batch,
    actor,
    critic,
    log_std,
    clip_range,
    vf_coef,
    ent_coef,
    count,
    losses,
):
    """Compute the loss of these rows, some of the `count` of a batch, and its derivatives.

    They are written into `actor` and `critic`: tuples of matrices, biases, outputs, slopes, and derivatives
    by matrices and biases. Advantages are normalised by `scale`, their mean and deviation.
    """
    for i in range(len(rows)):
        x[i] = observations[rows[i]]
        batch[i] = steps[rows[i]]
        batch[i, ADVANTAGE] = (batch[i, ADVANTAGE] - scale[0]) / scale[1]
    forward(x, actor[0], actor[1], actor[2])
    forward(x, critic[0], critic[1], critic[2])
    loss_of(
        actor[2][-1],
        critic[2][-1],
        log_std[0],
        batch,
        clip_range,
        vf_coef,
        ent_coef,
        count,
        actor[3][-1],
        critic[3][-1],
        log_std[1],
        losses,
    )
    backward(x, actor[0], actor[2], actor[3], actor[4], actor[5])
    backward(x, critic[0], critic[2], critic[3], critic[4], critic[5])


def outputs_of(x, matrices, biases, outputs):  # type: ignore[no-untyped-def]
    """Compute the outputs of each layer, as `forward`, as a kernel of its own."""
    forward(x, matrices, biases, outputs)


compiled_gradient: Any = kernel(gradient_of, threads=True)
compiled_outputs: Any = kernel(outputs_of)


@dataclass(frozen=True)
class Network:
    """Perceptron with tanh; its matrices and biases are views of a vector."""

    matrices: tuple[Floats, ...]
    biases: tuple[Floats, ...]

    def room(self, rows: int) -> tuple[Floats, ...]:
        """Return arrays for the outputs of each layer."""
        return tuple(np.zeros((rows, len(bias)), np.float32) for bias in self.biases)

    def __call__(self, x: Floats) -> Floats:
        """Return outputs, shape (..., outputs), for rows of inputs, shape (..., inputs)."""
        rows = x.reshape(-1, x.shape[-1])
        outputs = []
        for begin in range(0, len(rows), CHUNK):
            part = rows[begin : begin + CHUNK]
            room = self.room(len(part))
            compiled_outputs(part, self.matrices, self.biases, room)
            outputs.append(room[-1])
        return np.concatenate(outputs).reshape(*x.shape[:-1], -1)


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

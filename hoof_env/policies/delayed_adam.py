"""Torch's Adam, made when it is used.

Each policy of Stable-Baselines3 makes an optimiser, and the first one of a process loads torch's compiler,
which takes as long as the import of torch.
"""

from __future__ import annotations

import inspect
from typing import Any

import torch


class DelayedAdam(torch.optim.Adam):
    """Adam that is made at its first use, and that most policies never use: those that are played, and those
    of `agents.ppo_flat`, which takes Adam's steps itself."""

    def __init__(self, params: Any, lr: float = 1e-3, **kwargs: Any) -> None:
        given = inspect.signature(torch.optim.Adam).bind(list(params), lr, **kwargs)
        given.apply_defaults()
        parameters = given.arguments.pop("params")
        self.defaults = dict(given.arguments)
        self.state: Any = {}
        self.param_groups = [{"params": parameters, **self.defaults}]

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)

    def step(self, closure: Any = None) -> Any:
        """Become torch's Adam and take its step."""
        _become_adam(self)
        return torch.optim.Adam.step(self, closure)

    def zero_grad(self, set_to_none: bool = True) -> None:
        """Become torch's Adam and reset its gradients."""
        _become_adam(self)
        torch.optim.Adam.zero_grad(self, set_to_none)

    def state_dict(self) -> dict[str, Any]:
        """Return the state of an Adam that has not taken a step."""
        (group,) = self.param_groups
        return {"state": {}, "param_groups": [{**group, "params": list(range(len(group["params"])))}]}

    def load_state_dict(self, state_dict: Any) -> None:
        """Take over the options of another Adam; become torch's Adam if that one has taken steps."""
        if state_dict["state"]:
            _become_adam(self)
            torch.optim.Adam.load_state_dict(self, state_dict)
            return
        (group,) = self.param_groups
        (other,) = state_dict["param_groups"]
        group.update({**other, "params": group["params"]})


def _become_adam(optimizer: torch.optim.Adam) -> None:
    """Make torch's Adam of a `DelayedAdam`, which a scheduler of its rate may still take for one."""
    if isinstance(optimizer, DelayedAdam):
        groups = optimizer.param_groups
        defaults = optimizer.defaults
        optimizer.__class__ = torch.optim.Adam  # type: ignore[assignment]
        torch.optim.Adam.__init__(optimizer, groups, **defaults)

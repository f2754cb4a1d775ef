"""Stand-in for the optimiser that each policy of Stable-Baselines3 makes.

Making a real one loads torch's compiler, which takes a second and more: a third of the time from the start of
Python to the first step of a policy.
"""

from __future__ import annotations

import inspect
from typing import Any

import torch


class UnusedAdam(torch.optim.Adam):
    """Torch's Adam in name only, for a policy that is played, or that something else improves."""

    def __init__(self, params: Any, lr: float = 1e-3, **kwargs: Any) -> None:
        usual = inspect.signature(torch.optim.Adam.__init__).parameters
        defaults = {
            name: parameter.default for name, parameter in usual.items() if name not in ("self", "params")
        }
        self.defaults = {**defaults, "lr": lr, **kwargs}
        self.state: Any = {}
        self.param_groups = [{"params": list(params), **self.defaults}]

    def state_dict(self) -> dict[str, Any]:
        """Return the state of an Adam that has not taken a step."""
        (group,) = self.param_groups
        return {"state": {}, "param_groups": [{**group, "params": list(range(len(group["params"])))}]}

    def load_state_dict(self, state_dict: Any) -> None:
        """Ignore the state: there is nothing to go on with."""

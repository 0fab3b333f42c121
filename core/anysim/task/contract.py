"""The MDP contract: what a step returns, and what its words mean."""

from collections.abc import Callable
from enum import StrEnum
from typing import Any, NamedTuple, TypeVar

import numpy as np

from anysim.conventions import Array


class Status(StrEnum):
    """One word for each env. Where several are true at once: success before failed before truncated."""

    RUNNING = "running"
    SUCCESS = "success"
    FAILED = "failed"
    TRUNCATED = "truncated"


Event = TypeVar("Event", bound=Callable[..., Any])

UNSEEN = "changes_nothing_seen"
"""The mark of an event term, an attribute of the function."""


def changes_nothing_seen(event: Event) -> Event:
    """Mark an event term that changes no colour, texture, light or camera, and nothing that is there.

    Videos of a task with other terms at each step are drawn as the steps are made: what such a term changes is not
    recorded.
    """
    setattr(event, UNSEEN, True)
    return event


Reward = TypeVar("Reward", bound=Callable[..., Any])

MOST = "at_most"
"""The mark of a reward term, an attribute of the function: no env gets more of it in a step."""


def at_most(bound: float) -> Callable[[Reward], Reward]:
    """Mark a reward term that is never more than a bound; `anysim check` sees by it what success has to be worth."""

    def marked(reward: Reward) -> Reward:
        setattr(reward, MOST, bound)
        return reward

    return marked


GOES_ON = "goes_on"
"""An attribute of classes of commands and events that are called in each step too: how many numbers a goal has."""


STATUS_NAMES = np.array([str(s) for s in Status])
"""The words by code; codes are what the env keeps, words are what it returns."""
RUNNING, SUCCESS, FAILED, TRUNCATED = range(4)

Obs = dict[str, Array]
"""Observation groups: `policy` always; `privileged` and others as the task declares; (N, D) float32.

Images that the task observes are `images/CAMERA` (N, H, W, 3) uint8, `images/CAMERA/depth` (N, H, W) float32 [m] and
`images/CAMERA/segmentation` (N, H, W) int32."""


class StepResult(NamedTuple):
    """What a control step gives, for all envs. Fresh arrays: nothing here is written to later.

    Attributes:
        obs: the state that the action led to, also in an episode's last step.
        reward: (N,) float32; NaN where the engine faulted.
        status: (N,) one of the words of `Status`.
        info: arrays (N, ...): `is_success`, `fault` bool; `elapsed_steps` int64; `episode_seed` uint64.
    """

    obs: Obs
    reward: Array
    status: Array
    info: dict[str, Array]

    @property
    def terminated(self) -> Array:
        """(N,) bool: success or failed."""
        return (self.status == Status.SUCCESS) | (self.status == Status.FAILED)

    @property
    def truncated(self) -> Array:
        """(N,) bool: out of time."""
        return self.status == Status.TRUNCATED

    @property
    def done(self) -> Array:
        """(N,) bool: not running any more."""
        return self.status != Status.RUNNING

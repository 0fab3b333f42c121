"""The contract of learners: they get better in an env, a stretch at a time, and can be put away and taken up.

A learner is an entry point of the group `anysim.learners`: a class that is made of a `Lesson` and keyword-only
hyperparameters.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from anysim.task.env import TaskEnv

if TYPE_CHECKING:
    import torch  # pyright: ignore[reportMissingImports]


class Lesson(NamedTuple):
    """What is to be learnt from.

    Attributes:
        env: the task in as many envs as are stepped together.
        groups: observation groups that the policy may see.
        seed: of the episodes, and of everything that a learner draws.
        data: recorded runs, for learners that need them.
        images: colour images that the policy may see as well, as `images/front`.
    """

    env: TaskEnv
    groups: tuple[str, ...]
    seed: int
    data: tuple[Path, ...] = ()
    images: tuple[str, ...] = ()


class Learner(Protocol):
    """Something that gets better by `advance`."""

    steps: int
    """How far it is: control steps of all envs together, or steps of descent."""
    needs: Sequence[str]
    """The modules that it cannot be made without; its own module is imported without them."""
    chunk: int
    """How many actions the network gives for an observation."""

    def advance(self) -> Mapping[str, float]:
        """Learn for a stretch; returns numbers for the curves, `success` from 0 to 1 among them where it is known."""
        ...

    def state(self) -> dict[str, Any]:
        """All that it takes to go on: nested mappings and lists of tensors, arrays, numbers and words."""
        ...

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from what `state` gave."""
        ...

    def network(self) -> "torch.nn.Module":
        """The policy without noise: from what the lesson names to actions.

        It is given observation groups (n, D) and then images (n, H, W, 3) uint8, and gives actions (n, A), or chunks
        (n, K, A), in the units of the env.
        """
        ...

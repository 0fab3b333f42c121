"""Rewards together, and no less than a bound: what keeps a learner from ending an episode that costs it."""

from collections.abc import Mapping
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.task.scene import SceneView
from anysim.task.term_registry import bind
from anysim_schemas.base import Name, Number
from anysim_schemas.task import ByTerm, RewardTermSpec


class RewardsView:
    """Rewards that are added up. In YAML: a mapping of rewards with weights, as under `rewards`."""

    reference_kind: ClassVar[str] = "sum of rewards"
    written_as = Annotated[dict[Name, RewardTermSpec], ByTerm, Field(min_length=1)]

    def __init__(self, scene: SceneView, specs: Mapping[str, RewardTermSpec]) -> None:
        self._calls = [
            (spec.weight, bind("reward", spec.term, spec.params, scene, f"of.{key}")) for key, spec in specs.items()
        ]

    def total(self) -> Array:
        """(n,) their weighted sum."""
        return np.add.reduce([weight * call() for weight, call in self._calls])


def at_least(
    scene: SceneView,
    *,
    of: RewardsView,
    least: Annotated[Number, Field(description="what the sum is where it would be less")] = 0.0,
) -> Array:
    """The weighted sum of rewards, and no less than a bound.

    Where costs outweigh gains, as of a robot that has yet to learn to walk, an end would be worth more than going on.
    """
    return np.maximum(of.total(), least)

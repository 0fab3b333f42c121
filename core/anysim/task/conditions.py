"""Conditions inside a predicate: other predicates, by name."""

from collections.abc import Callable, Sequence
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim_schemas.base import Name
from anysim_schemas.task import ByTerm, PredicateTermSpec


class Conditions:
    """What a predicate combines. In YAML: a mapping of predicates, as under `success`."""

    reference_kind: ClassVar[str] = "condition"
    written_as = Annotated[dict[Name, PredicateTermSpec], ByTerm, Field(min_length=1)]

    def __init__(self, calls: Sequence[Callable[[], Array]]) -> None:
        self._calls = tuple(calls)

    def __len__(self) -> int:
        """How many they are."""
        return len(self._calls)

    def each(self) -> Array:
        """(C, n) bool: which of them hold."""
        return np.stack([call() for call in self._calls])

    def all(self) -> Array:
        """(n,) bool: whether all of them hold."""
        return np.logical_and.reduce(self.each())

"""Soft matter that other matter pushes at its surface: what it gets in steps of the other acts in its own next one."""

import numpy as np

from anysim.conventions import Array
from anysim.families.base import FamilySetting
from anysim.families.cosolver import about_origin
from anysim_soft.family import Soft
from anysim_soft.subworld import SubWorld


class ShellMatter(Soft):
    """Soft matter with S points of its surface that others push.

    Attributes:
        shell: (S,) the numbers of these points.
        due: (N, S, 3) [N s] what they got, and its solver has not yet.
    """

    def __init__(self, setting: FamilySetting) -> None:
        super().__init__(setting)
        self.shell = np.unique(self.faces)
        self.due = self.remember("due", len(self.shell), 3)

    @property
    def pinned(self) -> bool:
        """Whether some of it is fixed: its solver then counts all that it gets."""
        return False

    def touch(self, env: int, impulse: Array) -> None:
        """The points of its surface get impulses (S, 3) [N s] from other matter."""
        self.due[env] += impulse
        if not self.pinned:
            self.received[env] += about_origin(impulse, self.x[env, self.shell])

    def push_on_nodes(self, env: int) -> Array | None:
        due = self.due[env]
        return self.on_nodes(due / (self._step * self.soft.substeps)) if due.any() else None

    def on_nodes(self, forces: Array) -> Array:
        """(V, 3) [N] on its nodes, of forces (S, 3) on these points: they are one and the same."""
        return forces

    def after_solve(self, env: int, sub: SubWorld) -> None:
        self.due[env] = 0.0

    def momentum(self, env_ids: Array) -> Array:
        """Of the matter, and of what its points will get."""
        found = super().momentum(env_ids)
        if not self.pinned:
            found += np.array([about_origin(self.due[env], self.x[env, self.shell]) for env in env_ids.tolist()])
        return found

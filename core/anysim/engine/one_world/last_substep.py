"""Efforts and contact forces of the last substep, and motion that is held: what a state has beyond the present one."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.model.index import paired
from anysim.model.world import World


class LastSubstep:
    """What the last substep of each env left behind.

    Writing a state changes neither efforts nor contact forces, a reset makes them zero. Most steps are never asked for
    them: they are worked out when they are, or right before anything is done to their env.

    Motion is held after live editing: poses and twists that went through a library come back with other last bits.

    Attributes:
        effort: (N, J) [N m] or [N], up to date where `settle` was called.
        contact: (N, S, 3) [N], likewise.
    """

    def __init__(
        self, world: World, num_envs: int, exerted: Callable[[int], None], touched: Callable[[int], Array]
    ) -> None:
        """`exerted(env)` writes a row of `effort`, `touched(env)` returns one of `contact`, both of its last step."""
        self._world, self._exerted, self._touched = world, exerted, touched
        self.effort = np.zeros((num_envs, len(world.joints)))
        self.contact = np.zeros((num_envs, len(world.contact_sensors), 3))
        self._motion = np.zeros((num_envs, len(world.bodies), 13))
        self._unknown_effort: set[int] = set()
        self._unknown_contact: set[int] = set()
        self._held: set[int] = set()

    def stepped(self, env: int) -> None:
        """Everything of this env is new."""
        self._unknown_effort.add(env)
        self._unknown_contact.add(env)
        self._held.discard(env)

    def touch(self, env: int) -> None:
        """The state of this env is about to be written."""
        self.settle(env)
        self._held.discard(env)

    def settle(self, env: int) -> None:
        """Work out what is unknown of this env, before what it follows from is gone."""
        self._settle_effort(env)
        self._settle_contact(env)

    def _settle_effort(self, env: int) -> None:
        if env in self._unknown_effort:
            self._exerted(env)
            self._unknown_effort.remove(env)

    def _settle_contact(self, env: int) -> None:
        if env in self._unknown_contact:
            self.contact[env] = self._touched(env)
            self._unknown_contact.remove(env)

    def hold(self, env: int, effort: Array | float, contact: Array | float) -> None:
        """Make these the efforts (J,) and contact forces (S, 3) of the last substep; no motion is held."""
        self.effort[env], self.contact[env] = effort, contact
        for which in (self._unknown_effort, self._unknown_contact, self._held):
            which.discard(env)

    # ------------------------------------------------------------------ fields

    def efforts(self) -> Array:
        """(N, J), a copy."""
        for env in tuple(self._unknown_effort):
            self._settle_effort(env)
        return self.effort.copy()

    def contacts(self) -> Array:
        """(N, S, 3), a copy."""
        for env in tuple(self._unknown_contact):
            self._settle_contact(env)
        return self.contact.copy()

    def cover(self, name: str, array: Array) -> Array:
        """A field that was read, with what is held of it in its place."""
        if self._held and name in ("body_pose", "body_twist"):
            held = sorted(self._held)
            array[held] = self._motion[held, :, :7] if name == "body_pose" else self._motion[held, :, 7:]
        return array

    # ------------------------------------------------------------------ snapshots and live editing

    def rows(self, ids: Array) -> dict[str, Array]:
        """What a snapshot holds of it; the envs are settled."""
        held = np.array([env in self._held for env in ids.tolist()], dtype=bool)
        motion = np.where(held[:, None, None], self._motion[ids], 0.0)
        return {"effort": self.effort[ids], "contact": self.contact[ids], "held": held, "held_motion": motion}

    def put_row(self, env: int, data: Mapping[str, Array], row: int) -> None:
        """Write a row that `rows` made."""
        self.hold(env, data["effort"][row], data["contact"][row])
        if "held" in data and data["held"][row]:
            self._motion[env] = data["held_motion"][row]
            self._held.add(env)

    def take(self, carried: "CarriedSubstep", old: World, pose: Array, twist: Array) -> None:
        """Go on with what an old World had, by name, over the poses (N, B, 7) and twists (N, B, 6) that there are."""
        before, after = paired(old, self._world, "bodies")
        pose[:, after], twist[:, after] = carried.pose[:, before], carried.twist[:, before]
        effort, contact = np.zeros_like(self.effort), np.zeros_like(self.contact)
        before, after = paired(old, self._world, "joints")
        effort[:, after] = carried.effort[:, before]
        before, after = paired(old, self._world, "contact_sensors")
        contact[:, after] = carried.contact[:, before]
        for env in range(len(pose)):
            self.hold(env, effort[env], contact[env])
        self._motion = np.concatenate([pose, twist], axis=-1)
        self._held = set(range(len(pose)))


class CarriedSubstep(NamedTuple):
    """Copies in the order of the old World: poses (N, B, 7), twists (N, B, 6), efforts (N, J), forces (N, S, 3)."""

    pose: Array
    twist: Array
    effort: Array
    contact: Array

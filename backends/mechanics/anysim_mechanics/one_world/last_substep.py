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
        self._no_effort: set[int] = set()
        self._no_contact: set[int] = set()
        self._held: set[int] = set()

    def stepped(self, env: int) -> None:
        """Everything of this env is new."""
        self._no_effort.add(env)
        self._no_contact.add(env)
        self._held.discard(env)

    def touch(self, env: int) -> None:
        """The state of this env is about to be written."""
        self.settle(env)
        self._held.discard(env)

    def settle(self, env: int) -> None:
        """Work out what is not known yet of this env, before what it follows from is gone."""
        self._work_out(self._no_effort & {env}, self._no_contact & {env})

    def _work_out(self, efforts: set[int], contacts: set[int]) -> None:
        for env in efforts:
            self._exerted(env)
        for env in contacts:
            self.contact[env] = self._touched(env)
        self._no_effort -= efforts
        self._no_contact -= contacts

    def hold(self, env: int, effort: Array | float, contact: Array | float) -> None:
        """Make these the efforts (J,) and contact forces (S, 3) of the last substep; no motion is held."""
        self.effort[env], self.contact[env] = effort, contact
        for which in (self._no_effort, self._no_contact, self._held):
            which.discard(env)

    def efforts(self) -> Array:
        """(N, J), a copy."""
        self._work_out(set(self._no_effort), set())
        return self.effort.copy()

    def contacts(self) -> Array:
        """(N, S, 3), a copy."""
        self._work_out(set(), set(self._no_contact))
        return self.contact.copy()

    def cover(self, name: str, array: Array) -> Array:
        """A field that was read, with what is held of it in its place."""
        if self._held and name in ("body_pose", "body_twist"):
            held = sorted(self._held)
            array[held] = self._motion[held, :, :7] if name == "body_pose" else self._motion[held, :, 7:]
        return array

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

    def take(self, carried: "CarriedSubstep", old: World, motion: Array) -> None:
        """Go on with what an old World had, by name, over the poses and twists (N, B, 13) that there are now."""
        self._motion = motion
        for kind, theirs, ours in (
            ("bodies", carried.motion, self._motion),
            ("joints", carried.effort, self.effort),
            ("contact_sensors", carried.contact, self.contact),
        ):
            before, after = paired(old, self._world, kind)
            ours[:, after] = theirs[:, before]
        self._no_effort, self._no_contact, self._held = set(), set(), set(range(len(self._motion)))


class CarriedSubstep(NamedTuple):
    """Copies in the order of the old World: poses and twists (N, B, 13), efforts (N, J), forces (N, S, 3)."""

    motion: Array
    effort: Array
    contact: Array

"""Places of one robot's things in the arrays of an engine: joints, drives, links, feet."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from anysim.conventions import Array
from anysim.errors import NameLookupError, TaskError, listing
from anysim.model.frames import FixedFrame, find_frame
from anysim.model.world import Robot, World
from anysim_legged_gym.spec import AssetSpec

NAME = "robot"
"""The name of the robot in its World."""


@dataclass(frozen=True)
class Layout:
    """One robot of a World. D joints that are driven, B links and F feet, all in the World's order.

    `joints` (D,), `drives` (D,) and `bodies` (B,) are indices of the World; `geoms` those that touch, the ground's too.
    `feet_indices` (F,) are the links that carry the feet, among the robot's; `feet` their frames.
    """

    dof_names: tuple[str, ...]
    body_names: tuple[str, ...]
    feet_names: tuple[str, ...]
    root: int
    joints: Array
    drives: Array
    bodies: slice
    geoms: Array
    feet: tuple[FixedFrame, ...]
    feet_indices: Array
    termination_indices: Array
    penalized_indices: Array
    key_names: tuple[str, ...]
    key_bodies: tuple[FixedFrame, ...]

    @classmethod
    def of(cls, world: World, spec: AssetSpec) -> Self:
        """The robot of a World.

        Raises:
            TaskError: it stands on no legs, or a name of `spec` fits none of its links.
        """
        robot = next(r for r in world.robots if r.name == NAME)
        entity = next(e for e in world.entities if e.name == NAME)
        driven = {a.joint: i for i, a in enumerate(world.actuators)}
        joints = [j for j in range(entity.joint_start, entity.joint_stop) if j in driven]
        bodies = slice(entity.body_start, entity.body_stop)
        links = tuple(_own(b.name) for b in world.bodies[bodies])
        feet_names = _feet(robot, spec)
        feet = tuple(_frame(world, name) for name in feet_names)
        touching = [
            i for i, g in enumerate(world.geoms) if g.collides and (g.body < 0 or bodies.start <= g.body < bodies.stop)
        ]
        return cls(
            tuple(_own(world.joints[j].name) for j in joints),
            links,
            feet_names,
            entity.root,
            np.array(joints, dtype=int),
            np.array([driven[j] for j in joints], dtype=int),
            bodies,
            np.array(touching, dtype=int),
            feet,
            np.array([f.body - bodies.start for f in feet], dtype=int),
            named_links(links, spec.terminate_after_contacts_on, "asset.terminate_after_contacts_on"),
            named_links(links, spec.penalize_contacts_on, "asset.penalize_contacts_on"),
            spec.key_bodies,
            tuple(_frame(world, name) for name in spec.key_bodies),
        )

    @cached_property
    def by_drive(self) -> Array:
        """(D,) the joint of each drive, among the robot's: turns columns by joint into those that drives have."""
        return np.argsort(self.drives)


def named_links(links: Sequence[str], parts: Sequence[str], key: str) -> Array:
    """Indices of links whose names hold one of these texts.

    Raises:
        TaskError: a text is in no name.
    """
    for part in parts:
        if not any(part in link for link in links):
            raise TaskError(f"{key}: no link's name holds '{part}' (links: {listing(links, 40)})")
    return np.array([i for i, link in enumerate(links) if any(part in link for part in parts)], dtype=int)


def _own(name: str) -> str:
    return name.removeprefix(f"{NAME}.")


def _feet(robot: Robot, spec: AssetSpec) -> tuple[str, ...]:
    entry = robot.entry
    legs = {} if entry is None else entry.legs
    if entry is None or entry.base != "floating" or not (spec.feet or legs):
        floats = entry is not None and entry.base == "floating"
        lack = "has no `legs` in the catalogue; say `asset.feet`" if floats else "is bolted down"
        raise TaskError(f"robot '{robot.model}' cannot be simulated as a legged one: it {lack}")
    return spec.feet if spec.feet is not None else tuple(leg.foot for leg in legs.values())


def _frame(world: World, name: str) -> FixedFrame:
    try:
        return find_frame(world, f"{NAME}.{name}")
    except NameLookupError as error:
        raise TaskError(f"asset: {error}") from None

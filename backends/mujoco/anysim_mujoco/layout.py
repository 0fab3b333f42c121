"""Places of a World's parts in a MuJoCo model: index arrays, made once at build."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.model.world import BodyKind, World


class Handles(NamedTuple):
    """Elements of an MjSpec in the World's order; their `id` is valid once it is compiled."""

    bodies: list[Any]
    joints: list[Any]
    geoms: list[Any]
    sensors: list[list[Any]]
    parts: list[tuple[int, Any]]
    """World bodies and bodies fixed to them that carry some of their geoms."""


@dataclass(frozen=True)
class Layout:
    """Addresses in a compiled model, in the World's order. `_q` and `_v` index qpos and qvel."""

    bodies: Array  # (B,) MuJoCo bodies
    roots: Array  # (B,) MuJoCo body about whose subtree's centre of mass cvel is given
    geoms: Array  # (G,) MuJoCo geoms
    joint_q: Array  # (J,)
    joint_v: Array  # (J,)
    free_q: Array  # (F, 7)
    free_v: Array  # (F, 6)
    free_row: Array  # (B,) row of a free body in free_q and free_v, else -1
    static_row: Array  # (B,) row of a static body in mocap, else -1
    mocap: Array  # (S,) rows of mocap_pos and mocap_quat
    sensors: tuple[Array, ...]  # per contact sensor the addresses (K, 3) in sensordata that add up to it
    world_body: Array  # (nbody,) World body of each MuJoCo body, -1 for the world
    geom_entity: Array  # (ngeom,) segmentation id of each MuJoCo geom

    @classmethod
    def of(cls, world: World, model: Any, handles: Handles) -> "Layout":
        """Read the addresses from the compiled model."""
        bodies = _ids(handles.bodies)
        joints = _ids(handles.joints)
        free = [i for i, b in enumerate(world.bodies) if b.kind is BodyKind.FREE]
        static = [i for i, b in enumerate(world.bodies) if b.kind is BodyKind.STATIC]
        free_joints = model.body_jntadr[bodies[free]]
        world_body = np.full(model.nbody, -1)
        world_body[bodies] = np.arange(len(bodies))
        for owner, element in handles.parts:
            world_body[element.id] = owner
        entity = np.array([*world.body_entity, -1]) + 1
        return cls(
            bodies=bodies,
            roots=model.body_rootid[bodies],
            geoms=_ids(handles.geoms),
            joint_q=model.jnt_qposadr[joints],
            joint_v=model.jnt_dofadr[joints],
            free_q=model.jnt_qposadr[free_joints][:, None] + np.arange(7),
            free_v=model.jnt_dofadr[free_joints][:, None] + np.arange(6),
            free_row=_rows(free, len(bodies)),
            static_row=_rows(static, len(bodies)),
            mocap=model.body_mocapid[bodies[static]],
            sensors=tuple(model.sensor_adr[_ids(parts)][:, None] + np.arange(3) for parts in handles.sensors),
            world_body=world_body,
            geom_entity=entity[world_body[model.geom_bodyid]],
        )


def _ids(elements: list[Any]) -> Array:
    return np.array([element.id for element in elements], dtype=int)


def _rows(chosen: list[int], size: int) -> Array:
    rows = np.full(size, -1)
    rows[chosen] = np.arange(len(chosen))
    return rows


def as_slice(ids: Array) -> Any:
    """A slice where the indices are consecutive, which numpy reads much faster; else the indices."""
    if len(ids) and np.array_equal(ids, np.arange(ids[0], ids[0] + len(ids))):
        return slice(int(ids[0]), int(ids[0]) + len(ids))
    return ids

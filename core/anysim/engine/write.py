"""What the public methods that write do once they hold the lock: check, mask what is absent, and hand on."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from anysim.conventions import Array
from anysim.engine import arguments
from anysim.engine.parameters import PARAMETERS, Parameter, check_values, count
from anysim.engine.presence import blocks
from anysim.errors import CapabilityError, EngineError, listing
from anysim.model.world import BodyKind

if TYPE_CHECKING:
    from anysim.engine.base import SimEngine

# ruff: noqa: SLF001  two halves of one mechanism, as in `saving`


def write_joints(engine: "SimEngine", position: Any, velocity: Any, ids: Array, joints: Any) -> None:
    """See `SimEngine.set_joint_state`."""
    which = engine._which(joints, len(engine.world.joints), "joint")
    pos = None if position is None else arguments.rows("position", position, (len(ids), len(which)))
    vel = None if velocity is None else arguments.rows("velocity", velocity, (len(ids), len(which)))
    engine._retire_state()
    put_joints(engine, ids, *arguments.with_followers(engine.world, which, pos, vel))


def put_joints(engine: "SimEngine", ids: Array, joints: Array, position: Array | None, velocity: Array | None) -> None:
    """Write values (E, K) of what is there, and nothing of what is not."""
    there = engine._presence.joints[np.ix_(ids, joints)]
    if there.all():
        engine._write_joints(ids, joints, position, velocity)
        return
    for rows, columns in blocks(there):
        at = np.ix_(rows, columns)
        values = (None if v is None else v[at] for v in (position, velocity))
        engine._write_joints(ids[rows], joints[columns], *values)


def write_bodies(engine: "SimEngine", pose: Any, twist: Any, ids: Array, bodies: Any) -> None:
    """See `SimEngine.set_body_state`."""
    world = engine.world
    free = [i for i, b in enumerate(world.bodies) if b.kind is BodyKind.FREE]
    which = np.array(free, dtype=int) if bodies is None else engine._which(bodies, len(world.bodies), "body")
    poses = None if pose is None else arguments.poses("pose", pose, (len(ids), len(which), 7))
    twists = None if twist is None else arguments.rows("twist", twist, (len(ids), len(which), 6))
    arguments.roots_only(world, which, with_twist=twists is not None)
    engine._retire_state()
    put_bodies(engine, ids, which, poses, twists)


def put_bodies(engine: "SimEngine", ids: Array, bodies: Array, pose: Array | None, twist: Array | None) -> None:
    """Write poses (E, K, 7) and twists (E, K, 6) of what is there, and nothing of what is not."""
    there = engine._presence.bodies[np.ix_(ids, bodies)]
    if there.all():
        engine._write_bodies(ids, bodies, pose, twist)
        return
    for rows, columns in blocks(there):
        at = np.ix_(rows, columns)
        values = (None if v is None else v[at] for v in (pose, twist))
        engine._write_bodies(ids[rows], bodies[columns], *values)


def push(engine: "SimEngine", wrench: Any, bodies: Sequence[int], ids: Array) -> None:
    """See `SimEngine.apply_wrench`."""
    which = engine._which(bodies, len(engine.world.bodies), "body")
    forces = arguments.rows("wrench", wrench, (len(ids), len(which), 6))
    there = engine._presence.bodies[np.ix_(ids, which)]
    engine._commands.add_wrench(np.where(there[..., None], forces, 0.0), ids, which)


def read_parameter(engine: "SimEngine", name: str, env_ids: Any, indices: Any) -> Array:
    """See `SimEngine.get_parameters`."""
    _, ids, which = _chosen(engine, name, env_ids, indices)
    return engine._get_parameter(name)[np.ix_(ids, which)].copy()


def built_parameter(engine: "SimEngine", name: str) -> Array:
    """See `SimEngine.built_parameters`."""
    _chosen(engine, name, None, None)
    return engine._default_parameter(name).copy()


def write_parameter(engine: "SimEngine", name: str, values: Any, env_ids: Any, indices: Any) -> None:
    """See `SimEngine.set_parameters`."""
    parameter, ids, which = _chosen(engine, name, env_ids, indices)
    rows = arguments.rows(name, values, (len(ids), len(which), *parameter.shape))
    check_values(parameter, engine.world, rows, which)
    engine._retire_state()
    engine._set_parameter(name, rows, ids, which)
    engine._changed[name] = None
    kept = engine._get_parameter(name)[np.ix_(ids, which)]
    arguments.kept(engine.name, name, rows, kept)
    if name in ("actuator.kp", "actuator.kd"):
        engine._commands.control_changed = True


def _chosen(engine: "SimEngine", name: str, env_ids: Any, indices: Any) -> tuple[Parameter, Array, Array]:
    parameter = PARAMETERS.get(name)
    if parameter is None:
        raise EngineError(f"there is no parameter '{name}' (parameters: {listing(PARAMETERS, 20)})")
    if name not in engine.parameters:
        raise CapabilityError(
            f"{engine.name} cannot change '{name}' (it can: {listing(sorted(engine.parameters), 20)})"
        )
    ids = engine._ids(env_ids)
    return parameter, ids, engine._which(indices, count(parameter, engine.world), parameter.target)

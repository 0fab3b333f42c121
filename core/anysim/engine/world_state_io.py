"""Transfer of a WorldState from an engine into one that may be another engine with another world."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from anysim.conventions import Array
from anysim.engine.control import MODES
from anysim.engine.parameters import PARAMETERS
from anysim.engine.records import EnvRecords
from anysim.engine.world_state import Carried, Missing, NamedRows, WorldState
from anysim.errors import SnapshotError, listing
from anysim.model.index import names_of, paired_names
from anysim.model.world import BodyKind, World

if TYPE_CHECKING:
    from anysim.engine.base import SimEngine

_WORDS = np.array([str(mode) for mode in MODES])


def read(engine: "SimEngine", records: EnvRecords, ids: Array) -> WorldState:
    """The state of envs by name."""
    state, control, world = engine.get_state(), engine.control, engine.world
    parameters = {
        name: NamedRows(names_of(world, PARAMETERS[name].target), engine.get_parameters(name, ids))
        for name in PARAMETERS
        if name in records.changed
    }
    return WorldState(
        time=state.time[ids].copy(),
        entities=names_of(world, "entities"),
        present=engine.presence[ids],
        bodies=names_of(world, "bodies"),
        body_pose=state.body_pose[ids],
        body_twist=state.body_twist[ids],
        joints=names_of(world, "joints"),
        joint_pos=state.joint_pos[ids],
        joint_vel=state.joint_vel[ids],
        actuators=names_of(world, "actuators"),
        control_position=control.position[ids],
        control_velocity=control.velocity[ids],
        control_effort=control.effort[ids],
        control_mode=_WORDS[control.mode[ids]],
        cameras=names_of(world, "cameras"),
        camera_pose=records.rig.poses[ids].copy(),
        parameters=parameters,
    )


def write(engine: "SimEngine", records: EnvRecords, state: WorldState, ids: Array, missing: Missing) -> Carried:
    """Put envs into a state, from a reset on, so that nothing is left of what they did before.

    Raises:
        SnapshotError: names differ and `missing` refuses that, or another number of rows; nothing was changed.
    """
    if state.num_envs != len(ids):
        raise SnapshotError(f"the state holds {state.num_envs} envs, {len(ids)} were asked for; pass env_ids")
    carried = _compared(engine, state)
    if missing == "refuse" and (carried.dropped or carried.kept):
        raise SnapshotError(
            f"the state and the world '{engine.world.name}' on {engine.name} differ: the state alone has "
            f"{listing(carried.dropped)}; the world alone has {listing(carried.kept)}. Nothing was changed; pass "
            f"missing='keep' to carry over what both have and leave the rest as it is"
        )
    here = read(engine, records, ids)
    present = _merged(here.entities, here.present, state.entities, state.present)
    engine.reset(ids, present=present if records.presence.varies else None)
    _write_parameters(engine, records, state, ids)
    world = engine.world
    pose = _merged(here.bodies, here.body_pose, state.bodies, state.body_pose)
    twist = _merged(here.bodies, here.body_twist, state.bodies, state.body_twist)
    for kind in (BodyKind.STATIC, BodyKind.FREE):
        roots = np.array([i for i, body in enumerate(world.bodies) if body.kind is kind], dtype=int)
        if len(roots):
            engine.set_body_state(pose[:, roots], twist[:, roots] if kind is BodyKind.FREE else None, ids, roots)
    if world.joints:
        positions = _merged(here.joints, here.joint_pos, state.joints, state.joint_pos)
        velocities = _merged(here.joints, here.joint_vel, state.joints, state.joint_vel)
        engine.set_joint_state(positions, velocities, ids)
    if world.actuators:
        _write_commands(engine, here, state, ids)
    records.rig.poses[ids] = _merged(here.cameras, here.camera_pose, state.cameras, state.camera_pose)
    records.appearance[ids] += 1
    records.ticks[ids] = np.rint(state.time / world.physics.dt)
    return carried


def _compared(engine: "SimEngine", state: WorldState) -> Carried:
    dropped: list[str] = []
    kept: list[str] = []
    world = engine.world
    for kind, theirs in (("body", state.bodies), ("joint", state.joints), ("actuator", state.actuators)):
        ours = names_of(world, {"body": "bodies"}.get(kind, f"{kind}s"))
        dropped += [f"{kind} {name}" for name in theirs if name not in set(ours)]
        kept += [f"{kind} {name}" for name in ours if name not in set(theirs)] if theirs or kind != "actuator" else []
    dropped += [f"parameter {name}" for name in state.parameters if name not in engine.parameters]
    fixed = {e.name for i, e in enumerate(world.entities) if not any(i in slot.entities for slot in world.slots)}
    gone = [name for name, there in zip(state.entities, state.present.T, strict=True) if not there.all()]
    dropped += [f"absence of {name}" for name in gone if name in fixed]
    return Carried(tuple(dropped), tuple(kept))


def _write_parameters(engine: "SimEngine", records: EnvRecords, state: WorldState, ids: Array) -> None:
    """Those of the state; others that were changed here get their built values back, where the state knows of them."""
    world = engine.world
    for name, parameter in PARAMETERS.items():
        if name not in engine.parameters or not (name in state.parameters or name in records.changed):
            continue
        ours = names_of(world, parameter.target)
        known = _known(world, parameter.target, state)
        rows = engine.get_parameters(name, ids)
        rows[:, known] = engine.built_parameters(name)[known]
        given = state.parameters.get(name)
        if given is not None:
            rows = _merged(ours, rows, given.names, given.values)
        if rows.size:
            engine.set_parameters(name, rows, ids)


def _known(world: World, target: str, state: WorldState) -> Array:
    """(K,) bool: whether the state speaks of the things of a target, which for geoms is their body."""
    if target == "world":
        return np.ones(1, dtype=bool)
    bodies = set(state.bodies)
    if target == "geoms":
        return np.array([g.body < 0 or world.bodies[g.body].name in bodies for g in world.geoms], dtype=bool)
    names = {"bodies": bodies, "joints": set(state.joints), "actuators": set(state.actuators)}[target]
    return np.array([name in names for name in names_of(world, target)], dtype=bool)


def _write_commands(engine: "SimEngine", here: WorldState, state: WorldState, ids: Array) -> None:
    """A state without commands, such as one of a dataset, has the drives hold where its joints are."""
    if not state.actuators:
        held = _merged(here.joints, here.joint_pos, state.joints, state.joint_pos)
        engine.set_control(held[:, [a.joint for a in engine.world.actuators]], env_ids=ids)
        return

    def merged(field: str) -> Array:
        return _merged(here.actuators, getattr(here, field), state.actuators, getattr(state, field))

    modes, usual = merged("control_mode"), _WORDS[engine.control.mode[ids]]
    for row, env in enumerate(ids):
        for mode in MODES:
            other = np.flatnonzero((modes[row] == str(mode)) & (usual[row] != str(mode)))
            if len(other):
                engine.set_control_mode(mode, [int(env)], other.tolist())
    engine.set_control(merged("control_position"), merged("control_velocity"), merged("control_effort"), ids)


def _merged(ours: Sequence[str], here: Array, theirs: Sequence[str], values: Array) -> Array:
    """Our rows (E, K, ...), with theirs where they have a thing of the same name."""
    before, after = paired_names(theirs, ours)
    merged = np.array(here)
    if len(after):
        merged[:, after] = values[:, before]
    return merged

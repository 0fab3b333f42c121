"""WorldState: poses, velocities and commands by name. It goes between engines and worlds, and is close, not exact.

A `Snapshot` is exact and belongs to one engine and one world. A `WorldState` holds what every engine can read and
write: which entities are present, poses and velocities, joints, commands, camera mounts, and parameters that were
changed.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.control import MODES
from anysim.engine.parameters import PARAMETERS
from anysim.engine.records import EnvRecords
from anysim.engine.snapshots import file as snapshot_file
from anysim.engine.snapshots.row_checks import refuse_parameters, told
from anysim.engine.snapshots.world_state_checks import refuse_forms, refuse_values
from anysim.engine.state import row_numbers
from anysim.errors import SnapshotError, listing
from anysim.model.index import names_of, paired_names
from anysim.model.world import BodyKind, World

if TYPE_CHECKING:
    from anysim.engine.base import SimEngine

JSON_FORMAT = "anysim-world-state-1"
Missing = Literal["refuse", "keep"]
_WORDS = np.array([str(mode) for mode in MODES])


class NamedRows(NamedTuple):
    """Values (E, K, ...) of K named things."""

    names: tuple[str, ...]
    values: Array


class WorldStateGaps(NamedTuple):
    """What one side has and the other has not, as `body panda_hand`, where a state was carried into a world.

    Attributes:
        dropped: the state has it, the world or the engine has not.
        kept: the world has it, the state has not: it is where it was.
    """

    dropped: tuple[str, ...]
    kept: tuple[str, ...]


@dataclass(frozen=True)
class WorldState:
    """E envs at one moment, without anything of an engine's own. Poses xyzw [m], world frame; SI units throughout.

    Attributes:
        time: (E,) simulated time since each env's reset [s].
        entities: names of objects and robots, and `present` (E, n) bool, whether they are there.
        bodies: names, with `body_pose` (E, B, 7) and `body_twist` (E, B, 6) of all bodies; links follow their joints.
        joints: names, with `joint_pos` (E, J) and `joint_vel` (E, J).
        actuators: names, with the commands `control_position`, `control_velocity`, `control_effort` (E, A) and
            `control_mode` (E, A), words.
        cameras: names, with `camera_pose` (E, C, 7) in the frames of their mounts.
        parameters: those that were changed since the build, by name.
    """

    time: Array = field(repr=False)
    entities: tuple[str, ...]
    present: Array = field(repr=False)
    bodies: tuple[str, ...]
    body_pose: Array = field(repr=False)
    body_twist: Array = field(repr=False)
    joints: tuple[str, ...]
    joint_pos: Array = field(repr=False)
    joint_vel: Array = field(repr=False)
    actuators: tuple[str, ...] = ()
    control_position: Array = field(default_factory=lambda: np.zeros((0, 0)), repr=False)
    control_velocity: Array = field(default_factory=lambda: np.zeros((0, 0)), repr=False)
    control_effort: Array = field(default_factory=lambda: np.zeros((0, 0)), repr=False)
    control_mode: Array = field(default_factory=lambda: np.zeros((0, 0), dtype="U8"), repr=False)
    cameras: tuple[str, ...] = ()
    camera_pose: Array = field(default_factory=lambda: np.zeros((0, 0, 7)), repr=False)
    parameters: Mapping[str, NamedRows] = field(default_factory=dict, repr=False)

    @property
    def num_envs(self) -> int:
        """How many envs it holds."""
        return len(self.time)

    def rows(self, rows: Sequence[int] | Array) -> "WorldState":
        """Some of its envs, in this order; one may come several times."""
        which = row_numbers(rows, self.num_envs)
        arrays = {f.name: getattr(self, f.name) for f in fields(self)}
        chosen: dict[str, Any] = {name: v[which] for name, v in arrays.items() if isinstance(v, np.ndarray)}
        parameters = {name: NamedRows(p.names, p.values[which]) for name, p in self.parameters.items()}
        return replace(self, **chosen, parameters=parameters)

    # ------------------------------------------------------------------ files

    def save(self, path: str | Path) -> Path:
        """Write a file that `load` reads, on any machine with any engines."""
        stamp = {"envs": self.num_envs, "bodies": len(self.bodies), "joints": len(self.joints)}
        return snapshot_file.write(path, snapshot_file.WORLD, stamp, self._tree())

    @classmethod
    def load(cls, path: str | Path) -> "WorldState":
        """Read what `save` wrote.

        Raises:
            SnapshotError: the file is damaged, of a newer format, or holds something else.
        """
        content = snapshot_file.read(path)
        snapshot_file.same_kind(content, snapshot_file.WORLD, path)
        return cls._of(content.data)

    def to_json(self) -> str:
        """All of it as JSON text, numbers exact, for other programs."""

        def plain(value: Any) -> Any:
            if isinstance(value, np.ndarray):
                return value.tolist()
            return {k: plain(v) for k, v in value.items()} if isinstance(value, Mapping) else value

        return json.dumps({"format": JSON_FORMAT} | plain(self._tree()))

    @classmethod
    def from_json(cls, text: str) -> "WorldState":
        """Read what `to_json` wrote.

        Raises:
            SnapshotError: it is something else.
        """
        try:
            tree = json.loads(text)
            if tree.pop("format") != JSON_FORMAT:
                raise SnapshotError(f"this JSON is not of the format {JSON_FORMAT}")
            for f in fields(cls):
                if f.type is Array:
                    dtype = {"present": bool, "control_mode": str}.get(f.name, float)
                    tree[f.name] = np.array(tree[f.name], dtype=dtype)
            for entry in tree["parameters"].values():
                entry["values"] = np.array(entry["values"], dtype=float)
            return cls._of(snapshot_file.decode(tree, {}))
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise SnapshotError(f"this JSON is no {JSON_FORMAT}: {error}") from error

    def _tree(self) -> dict[str, Any]:
        tree = {f.name: getattr(self, f.name) for f in fields(self)}
        listed = {name: list(value) for name, value in tree.items() if isinstance(value, tuple)}
        parameters = {name: {"names": list(p.names), "values": p.values} for name, p in self.parameters.items()}
        return tree | listed | {"parameters": parameters}

    @classmethod
    def _of(cls, tree: Mapping[str, Any]) -> "WorldState":
        try:
            parameters = {name: NamedRows(tuple(p["names"]), p["values"]) for name, p in tree["parameters"].items()}
            given: dict[str, Any] = {f.name: tree[f.name] for f in fields(cls)} | {"parameters": parameters}
        except (TypeError, KeyError, AttributeError) as error:
            raise SnapshotError(f"this is no world state: {type(error).__name__} {error}; make it anew") from error
        given |= {name: tuple(value) for name, value in given.items() if isinstance(value, list)}
        state = cls(**given)
        refuse_forms(state)
        return state


# -------------------------------------------------------------------------- from an engine, and into another


def read_world_state(engine: "SimEngine", records: EnvRecords, ids: Array) -> WorldState:
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


def refuse_world_state(
    engine: "SimEngine", records: EnvRecords, state: WorldState, ids: Array, missing: Missing
) -> WorldStateGaps:
    """Refuse a state that cannot be written into these envs; returns what differs.

    Raises:
        SnapshotError: names differ and `missing` refuses that, another number of rows, or values that nothing has.
    """
    refuse_forms(state)
    refuse_values(state, engine.world.physics.dt)
    if state.num_envs != len(ids):
        raise SnapshotError(f"the state holds {state.num_envs} envs, {len(ids)} were asked for; pass env_ids")
    carried = _compared(engine, state)
    if missing == "refuse" and (carried.dropped or carried.kept):
        raise SnapshotError(
            f"the state and the world '{engine.world.name}' on {engine.name} differ: the state alone has "
            f"{listing(carried.dropped)}; the world alone has {listing(carried.kept)}. Nothing was changed; pass "
            f"missing='keep' to carry over what both have and leave the rest as it is"
        )
    present = _merged(names_of(engine.world, "entities"), engine.presence[ids], state.entities, state.present)
    with told():
        records.presence.checked(present, ids)
    refuse_parameters(engine.world, engine.parameters, _parameters(engine, records, state, ids), len(ids))
    return carried


def write_world_state(engine: "SimEngine", records: EnvRecords, state: WorldState, ids: Array) -> None:
    """Put envs into a state that was checked, from a reset on, so that nothing is left of what they did before."""
    here = read_world_state(engine, records, ids)
    present = _merged(here.entities, here.present, state.entities, state.present)
    engine.reset(ids, present=present if records.presence.varies else None)
    for name, rows in _parameters(engine, records, state, ids).items():
        engine.set_parameters(name, rows, ids)
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


def _compared(engine: "SimEngine", state: WorldState) -> WorldStateGaps:
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
    return WorldStateGaps(tuple(dropped), tuple(kept))


def _parameters(engine: "SimEngine", records: EnvRecords, state: WorldState, ids: Array) -> dict[str, Array]:
    """Those of the state; others that were changed here get their built values back, where the state knows of them."""
    world = engine.world
    found: dict[str, Array] = {}
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
            found[name] = rows
    return found


def _known(world: World, target: str, state: WorldState) -> Array:
    """(K,) bool: whether the state speaks of the things of a target, which for geoms is their body."""
    if target in ("world", "lights"):
        return np.ones(len(names_of(world, target)), dtype=bool)
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

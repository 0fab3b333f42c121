"""WorldState: poses, velocities and commands by name. It goes between engines and worlds, and is close, not exact.

A `Snapshot` is exact and belongs to one engine and one world. A `WorldState` holds what every engine can read and
write: who is there, poses and velocities, joints, commands, camera mounts, and the parameters that were changed.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine import snapshot_file
from anysim.engine.snapshot import row_numbers
from anysim.errors import SnapshotError

JSON_FORMAT = "anysim-world-state-1"
Missing = Literal["refuse", "keep"]


class NamedRows(NamedTuple):
    """Values (E, K, ...) of K named things."""

    names: tuple[str, ...]
    values: Array


class Carried(NamedTuple):
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
        parameters = {name: NamedRows(tuple(p["names"]), p["values"]) for name, p in tree["parameters"].items()}
        given: dict[str, Any] = {f.name: tree[f.name] for f in fields(cls)} | {"parameters": parameters}
        given |= {name: tuple(value) for name, value in given.items() if isinstance(value, list)}
        state = cls(**given)
        shapes = {
            "present": (len(state.entities),),
            "body_pose": (len(state.bodies), 7),
            "body_twist": (len(state.bodies), 6),
            "joint_pos": (len(state.joints),),
            "joint_vel": (len(state.joints),),
        }
        for name, shape in shapes.items():
            array: Array = getattr(state, name)
            if array.shape != (state.num_envs, *shape) and array.size:
                raise SnapshotError(f"a world state's {name} has shape {array.shape}, not {(state.num_envs, *shape)}")
        return state

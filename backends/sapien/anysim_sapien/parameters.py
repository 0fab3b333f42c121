"""Physical and visual parameters per env. They are read back from PhysX' own objects."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from anysim.conventions import Array, xyzw_from_wxyz
from anysim.engine.looks import LIGHTS, SURROUNDINGS, Looks
from anysim.world.model import World
from anysim_sapien.drives import Drives
from anysim_sapien.inertia import full, principal
from anysim_sapien.layout import Layout
from anysim_sapien.recipe import Values
from anysim_sapien.scene import EnvScene
from anysim_sapien.surfaces import Copy

_DRIVES = {
    "joint.damping": "passive", "actuator.kp": "kp", "actuator.kd": "kd", "actuator.effort_limit": "limit",
}  # fmt: skip
_BODIES = ("body.mass", "body.com", "body.inertia")
_REBUILD = ("geom.friction", "world.gravity")
"""PhysX reads gravity once, and a change of friction regroups the shapes: the scene is built anew."""


LOOKS = frozenset({*LIGHTS, *SURROUNDINGS} - {"world.shadows"})
"""What is drawn; there are no shadows."""

LIT = LOOKS - {"world.background"}
"""What needs a shader with lights."""


class Parameters:
    """The values in force (N, K, ...), and how they get into the scenes."""

    NAMES = frozenset({*_DRIVES, *_BODIES, *_REBUILD, "joint.friction", "joint.armature", "geom.color"}) | LOOKS

    def __init__(
        self, world: World, layout: Layout, drives: Drives, scenes: list[EnvScene], rebuild: Callable[[int], None],
        num_envs: int, looks: Looks,
    ) -> None:  # fmt: skip
        self._world, self._layout, self._drives, self._scenes, self._rebuild = world, layout, drives, scenes, rebuild
        self._looks = looks
        bodies, joints = world.bodies, world.joints
        self._defaults = {
            "body.mass": np.array([b.inertial.mass for b in bodies], dtype=float),
            "body.com": np.array([b.inertial.com for b in bodies], dtype=float).reshape(-1, 3),
            "body.inertia": np.array([b.inertial.inertia for b in bodies], dtype=float).reshape(-1, 6),
            "geom.friction": np.array([g.surface.friction for g in world.geoms], dtype=float),
            "geom.color": np.array([g.color for g in world.geoms], dtype=float).reshape(-1, 4),
            "joint.damping": np.array([j.damping for j in joints], dtype=float),
            "joint.friction": np.array([j.friction for j in joints], dtype=float),
            "joint.armature": np.array([j.armature for j in joints], dtype=float),
            "actuator.kp": np.array([a.kp for a in world.actuators], dtype=float),
            "actuator.kd": np.array([a.kd for a in world.actuators], dtype=float),
            "actuator.effort_limit": np.array([a.effort_limit for a in world.actuators], dtype=float),
            "world.gravity": np.array([world.physics.gravity], dtype=float),
        }
        self._wanted = {
            name: np.repeat(values[None], num_envs, axis=0)
            for name, values in self._defaults.items()
            if name not in _DRIVES
        }

    def values(self, env: int) -> Values:
        """What the scene of an env is built with."""
        w = self._wanted
        return Values(
            w["body.mass"][env], w["body.com"][env], w["body.inertia"][env], w["geom.friction"][env],
            w["joint.friction"][env], w["joint.armature"][env], w["world.gravity"][env, 0],
        )  # fmt: skip

    def default(self, name: str) -> Array:
        """Values (K, ...) as built."""
        return self._looks.default(name) if name in LOOKS else self._defaults[name].copy()

    def rows(self, ids: Array) -> dict[str, Array]:
        """What scenes are built with, as it was asked for: what is read from PhysX is rounded, and not asked for again.

        A scene that is built anew later, as its steps run out, has to be built from the same bits.
        """
        return {f"wanted.{name}": values[ids] for name, values in self._wanted.items() if name != "geom.color"}

    def put_rows(self, ids: Array, data: Mapping[str, Array]) -> None:
        """Write what `rows` made; the scenes themselves come from elsewhere."""
        for name, values in self._wanted.items():
            if name != "geom.color":
                values[ids] = data[f"wanted.{name}"]

    # ------------------------------------------------------------------ reading

    def get(self, name: str) -> Array:
        """All values (N, K, ...)."""
        if name in LOOKS:
            return self._looks.get(name)
        if name in _DRIVES:
            return getattr(self._drives, _DRIVES[name]).copy()
        values = self._wanted[name].copy()
        if name == "geom.color":
            return values
        for row, scene in zip(values, self._scenes, strict=True):
            self._read(name, row, scene)
        return values

    def _read(self, name: str, row: Array, scene: EnvScene) -> None:
        """Overwrite the wanted values by PhysX' own where it has the thing.

        It has no mass of what is fixed, and nothing of what is not there.
        """
        if name in _BODIES:
            for body in np.flatnonzero(scene.layout.there & ~self._layout.fixed):
                component = scene.bodies[body]
                frame = component.cmass_local_pose
                if name == "body.mass":
                    row[body] = component.mass
                elif name == "body.com":
                    row[body] = frame.p
                else:
                    row[body] = full(component.inertia, xyzw_from_wxyz(np.asarray(frame.q, dtype=float)))
        elif name == "joint.armature":
            for index in np.flatnonzero(scene.layout.joint_there):
                row[index] = scene.joints[index].armature[0]
        elif name == "joint.friction":
            for index in np.flatnonzero(scene.layout.joint_there):
                row[index] = scene.dry_friction(int(index))
        elif name == "geom.friction":
            for index, shapes in enumerate(scene.shapes):
                row[index] = _own_friction(row[index], scene.copies.get(index, ()), shapes)
        else:
            row[0] = scene.system.config.gravity

    # ------------------------------------------------------------------ writing

    def set(self, name: str, values: Array, ids: Array, indices: Array) -> None:
        """Write values (E, K, ...)."""
        if name in LOOKS:
            self._looks.set(name, values, ids, indices)
            return
        at = np.ix_(ids, indices)
        if name in _DRIVES:
            getattr(self._drives, _DRIVES[name])[at] = values
            self._drives.refresh()
            return
        if name == "body.inertia":
            for row in values:
                for index, tensor in zip(indices, row, strict=True):
                    if not self._layout.fixed[index]:
                        principal(self._world.bodies[index].name, tensor)
        before = self._wanted[name][ids]
        self._wanted[name][at] = values
        try:
            for env in ids:
                self._write(name, int(env), indices)
        except BaseException:
            self._wanted[name][ids] = before
            for env in ids:
                self._write(name, int(env), indices)
            raise

    def _write(self, name: str, env: int, indices: Sequence[int] | Array) -> None:
        scene, wanted = self._scenes[env], self._wanted
        if name in _BODIES:
            for body in indices:
                if scene.layout.there[body] and not self._layout.fixed[body]:
                    scene.set_inertial(int(body), *(wanted[part][env, body] for part in _BODIES))
        elif name == "joint.armature":
            for index in np.asarray(indices)[scene.layout.joint_there[indices]]:
                scene.set_armature(int(index), float(wanted[name][env, index]))
        elif name == "joint.friction":
            for index in np.asarray(indices)[scene.layout.joint_there[indices]]:
                scene.set_dry(int(index), float(wanted[name][env, index]))
        elif name in _REBUILD:
            self._rebuild(env)


def _own_friction(wanted: float, copies: Sequence[Copy], shapes: Sequence[Any]) -> float:
    """The wanted value where all shapes of a geom have the coefficients that its pairs need, else what one has instead.

    A geom has a shape for each value that its pairs can have, and its own need not be among them.
    """
    for copy, shape in zip(copies, shapes, strict=True):
        found = float(shape.physical_material.static_friction)
        if abs(found - copy.touch.friction) > 1e-6 * max(1.0, found):
            return found
    return wanted

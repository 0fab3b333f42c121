"""Physical and visual parameters per env. They are read back from PhysX' own objects."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from anysim.conventions import Array, xyzw_from_wxyz
from anysim.engine.parameters import ParameterTable
from anysim.errors import EngineError
from anysim.kinematics.dynamics import gain
from anysim.kinematics.inertia import check_physical, from_principal, principal
from anysim_mechanics.collision_groups import Copy
from anysim_sapien.drives import Drives
from anysim_sapien.options import OWN_SCENERY
from anysim_sapien.recipe import Recipes, Values
from anysim_sapien.scene import EnvScene

_GAINS = {"actuator.kp": "kp", "actuator.kd": "kd", "actuator.effort_limit": "limit"}
_DRIVES = ("joint.damping", *_GAINS)
_BODIES = ("body.mass", "body.com", "body.inertia")
_DAMPING = ("body.linear_damping", "body.angular_damping")
_SURFACES = ("geom.friction", "geom.restitution")
_REBUILD = (*_SURFACES, "world.gravity")
"""PhysX reads gravity once, and a change of coefficients regroups the shapes: the scene is built anew."""
_SKINS = ("geom.color", "geom.texture", "geom.material")
_ELSEWHERE = (*_DRIVES, "geom.color")
"""What is no part of a snapshot's rows here: the base class saves it."""


class Parameters(ParameterTable):
    """The values in force (N, K, ...), and how they get into the scenes."""

    def __init__(
        self,
        recipes: Recipes,
        drives: Drives,
        scenes: list[EnvScene],
        rebuild: Callable[[int], None],
        written: Callable[[int], None],
    ) -> None:
        """`rebuild` makes an env's scene anew in its state, `written` is told of envs that were written to."""
        self._layout, self._options = recipes.layout, recipes.options
        self._drives, self._scenes, self._rebuild, self._written = drives, scenes, rebuild, written
        kept = {"joint.damping": drives.passive}
        kept |= {name: getattr(drives.gains, kind) for name, kind in _GAINS.items()}
        super().__init__(recipes.world, len(drives.passive), OWN_SCENERY, kept)

    def of(self, env: int) -> Values:
        """What the scene of an env is built with."""
        w = self.values
        damping = np.stack([w[name][env] for name in _DAMPING], axis=-1)
        rest = (w[name][env] for name in (*_SURFACES, "joint.friction", "joint.armature"))
        return Values._make([*(w[name][env] for name in _BODIES), damping, *rest, w["world.gravity"][env, 0]])

    def rows(self, env: int) -> dict[str, Array]:
        """What scenes are built with, as it was asked for: what is read from PhysX is rounded, and not asked for again.

        A scene that is built anew later, as its steps run out, has to be built from the same bits.
        """
        return {f"wanted.{name}": self.values[name][env] for name in self.values if name not in _ELSEWHERE}

    def put_rows(self, env: int, rows: Mapping[str, Array]) -> None:
        """Write what `rows` returned; the scene itself comes from elsewhere."""
        for name, values in self.values.items():
            if name not in _ELSEWHERE:
                values[env] = rows[f"wanted.{name}"]

    # ------------------------------------------------------------------ reading

    def read(self, name: str, values: Array) -> None:
        if name not in (*_DRIVES, *_SKINS):
            for row, scene in zip(values, self._scenes, strict=True):
                self._read(name, row, scene)

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
                    row[body] = from_principal(component.inertia, xyzw_from_wxyz(np.asarray(frame.q, dtype=float)))
        elif name == "joint.armature":
            for index in np.flatnonzero(scene.layout.joint_there):
                row[index] = scene.joints[index].armature[0]
        elif name == "joint.friction":
            for index in np.flatnonzero(scene.layout.joint_there):
                row[index] = scene.dry_friction(int(index))
        elif name in _DAMPING:
            self._read_damping(_DAMPING.index(name), row, scene)
        elif name in _SURFACES:
            for index, shapes in enumerate(scene.shapes):
                row[index] = _own(_SURFACES.index(name), row[index], scene.copies.get(index, ()), shapes)
        else:
            row[0] = scene.system.config.gravity

    def _read_damping(self, which: int, row: Array, scene: EnvScene) -> None:
        """A rate is the wanted one where PhysX has the single-precision share that it makes."""
        dt = self.world.physics.dt
        for body in np.flatnonzero(scene.layout.there & self.world.loose):
            component = scene.bodies[body]
            found = (component.linear_damping, component.angular_damping)[which]
            if abs(found - gain(row[body], dt)) > 1e-6 * max(1.0, found):
                row[body] = -np.log1p(-found * dt) / dt

    # ------------------------------------------------------------------ writing

    def check(self, name: str, values: Array, indices: Array) -> None:
        if name in self.looks and name != "world.background" and self._options.shader == "trivial":
            raise EngineError(
                f"sapien's shader 'trivial' draws no light: {name} is not seen; choose options.shader: lit"
            )
        if name == "body.inertia":
            for row in values:
                for index, tensor in zip(indices, row, strict=True):
                    if not self._layout.fixed[index]:
                        check_physical(self.world.bodies[index].name, principal(tensor).moments)

    def push(self, name: str, ids: Array, indices: Array) -> None:
        if name in _DRIVES:
            self._drives.refresh()
        for env in ids.tolist():
            self._write(name, env, indices)
            self._written(env)

    def _write(self, name: str, env: int, indices: Sequence[int] | Array) -> None:
        scene, wanted = self._scenes[env], self.values
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
        elif name in _DAMPING:
            rates = np.stack([wanted[part][env] for part in _DAMPING], axis=-1)
            for body in indices:
                if scene.layout.there[body] and self.world.loose[body]:
                    scene.set_damping(int(body), rates[body])
        elif name in _REBUILD:
            self._rebuild(env)


def _own(which: int, wanted: float, copies: Sequence[Copy], shapes: Sequence[Any]) -> float:
    """The wanted value where all shapes of a geom have the coefficients that its pairs need, else what one has instead.

    A geom has a shape for each value that its pairs can have, and its own need not be among them.
    """
    for copy, shape in zip(copies, shapes, strict=True):
        material = shape.physical_material
        found = float((material.static_friction, material.restitution)[which])
        if abs(found - copy.touch[which]) > 1e-6 * max(1.0, found):
            return found
    return wanted

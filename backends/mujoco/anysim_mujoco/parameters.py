"""Physical and visual parameters per env, as per-env fields of the batch's model."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from mujoco.batch import SimulationError

from anysim.conventions import Array
from anysim.engine.lighting import Looks
from anysim.engine.parameters import PARAMETERS, nominal
from anysim.errors import EngineError
from anysim.kinematics.inertia import check_physical
from anysim.model.world import World
from anysim_mujoco.dampers import Dampers
from anysim_mujoco.drives import Drives
from anysim_mujoco.inertia import full, principal
from anysim_mujoco.layout import Layout
from anysim_mujoco.mjcf.surfaces import contact_parameters, restitution_of
from anysim_mujoco.skins import Skins

_DAMPING = {"body.linear_damping": 0, "body.angular_damping": 1}
_LOOKS = {"geom.texture": 0, "geom.material": 1}


class _Field(NamedTuple):
    """A field of MjModel: the rows of the World's things, the value's column, whether constants derive from it."""

    name: str
    rows: Array
    column: int | None = None
    derives: bool = False


class Parameters:
    """Reads and writes neutral parameters. Derived constants are brought up to date by `settle`, for touched envs."""

    NAMES = frozenset(PARAMETERS)

    def __init__(
        self, batch: Any, world: World, layout: Layout, drives: Drives, dampers: Dampers, looks: Looks
    ) -> None:
        self._batch, self._world, self._layout, self._drives = batch, world, layout, drives
        self._dampers, self._looks, self._skins = dampers, looks, Skins(world, batch.model)
        self._bounce = np.tile(nominal("geom.restitution", world), (batch.nsim, 1))
        self._expanded: set[str] = set()
        self._stale = np.zeros(batch.nsim, dtype=bool)
        self._any_stale = False
        self._fields = {
            "body.mass": _Field("body_mass", layout.bodies, derives=True),
            "body.com": _Field("body_ipos", layout.bodies, derives=True),
            "geom.friction": _Field("geom_friction", layout.geoms, 0),
            "geom.color": _Field("geom_rgba", layout.geoms),
            "joint.damping": _Field("dof_damping", layout.joint_v),
            "joint.friction": _Field("dof_frictionloss", layout.joint_v),
            "joint.armature": _Field("dof_armature", layout.joint_v, derives=True),
            "actuator.effort_limit": _Field("actuator_forcerange", np.arange(len(world.actuators)), 1),
        }

    def get(self, name: str) -> Array:
        """All values (N, K, ...)."""
        if name in self._looks:
            return self._looks.get(name)
        if name in ("actuator.kp", "actuator.kd"):
            return getattr(self._drives, name.removeprefix("actuator.")).copy()
        if name == "world.gravity":
            return np.array(self._rows("opt.gravity"))[:, None]
        if name == "body.inertia":
            bodies = self._layout.bodies
            return full(self._rows("body_inertia")[:, bodies], self._rows("body_iquat")[:, bodies])
        if name in _DAMPING:
            return self._dampers.rates[:, :, _DAMPING[name]].copy()
        if name == "geom.restitution":
            found = restitution_of(self._rows("geom_solmix")[:, self._layout.geoms])
            # through a logarithm they come back with other last bits than they were written with
            return np.where(np.abs(found - self._bounce) < 1e-9, self._bounce, found)
        if name in _LOOKS:
            return self._skins.pairs(self._rows("geom_matid")[:, self._layout.geoms])[_LOOKS[name]]
        field = self._fields[name]
        return np.array(_column(self._rows(field.name), field)[:, field.rows], dtype=float)

    def default(self, name: str) -> Array:
        """Values (K, ...) as built."""
        if name in self._looks:
            return self._looks.default(name)
        world, model = self._world, self._batch.model
        if name in ("actuator.kp", "actuator.kd"):
            return np.array([getattr(a, name.removeprefix("actuator.")) for a in world.actuators], dtype=float)
        if name == "world.gravity":
            return np.array([world.physics.gravity])
        if name == "body.inertia":
            bodies = self._layout.bodies
            return full(model.body_inertia[bodies], model.body_iquat[bodies])
        if name in (*_DAMPING, *_LOOKS, "geom.restitution"):
            return nominal(name, world)
        field = self._fields[name]
        return np.array(_column(getattr(model, field.name), field)[field.rows], dtype=float)

    def set(self, name: str, values: Array, ids: Array, indices: Array) -> None:
        """Write values (E, K, ...)."""
        if name in self._looks:
            self._looks.set(name, values, ids, indices)
            return
        at = ids[:, None], indices
        if name in ("actuator.kp", "actuator.kd"):
            getattr(self._drives, name.removeprefix("actuator."))[at] = values
            self._drives.refresh()
        elif name == "world.gravity":
            self._expand("opt.gravity")[ids] = values[:, 0]
            self._mark(ids)
        elif name == "body.inertia":
            self._set_inertia(values, ids, indices)
        elif name in _DAMPING:
            self._dampers.rates[:, :, _DAMPING[name]][at] = values
            self._dampers.refresh()
        elif name == "geom.restitution":
            self._set_restitution(values, ids, indices)
        elif name in _LOOKS:
            pair = [column[at] for column in self._skins.pairs(self._rows("geom_matid")[:, self._layout.geoms])]
            pair[_LOOKS[name]] = values
            geoms = self._layout.geoms[indices]
            self._expand("geom_matid")[ids[:, None], geoms] = self._skins.ids(indices, pair[0], pair[1])
        elif name == "actuator.effort_limit":
            limits = self._expand("actuator_forcerange")
            limits[at] = np.stack([-values, values], axis=-1)
        else:
            field = self._fields[name]
            _column(self._expand(field.name), field)[ids[:, None], field.rows[indices]] = values
            if field.derives:
                self._mark(ids)

    def _set_restitution(self, values: Array, ids: Array, indices: Array) -> None:
        """How hard a contact is and how it counts in its pairs depend on what it gives back."""
        surfaces, dt = [self._world.geoms[i].surface for i in indices], self._world.physics.dt
        made = [
            [contact_parameters(replace(s, restitution=float(e)), dt) for s, e in zip(surfaces, row, strict=True)]
            for row in values
        ]
        self._bounce[ids[:, None], indices] = values
        at = ids[:, None], self._layout.geoms[indices]
        self._expand("geom_solref")[at] = [[part.solref for part in row] for row in made]
        self._expand("geom_solmix")[at] = [[part.solmix for part in row] for row in made]

    def inertials(self) -> tuple[Array, Array, Array, Array]:
        """Masses, centres, principal moments and axes (N, nbody, ...) as MuJoCo has them."""
        mass, com, moments, axes = (self._rows(f"body_{name}") for name in ("mass", "ipos", "inertia", "iquat"))
        return mass, com, moments, axes

    def _set_inertia(self, values: Array, ids: Array, indices: Array) -> None:
        split = [[principal(tensor) for tensor in row] for row in values]
        for row in split:
            for index, (moments, _) in zip(indices, row, strict=True):
                if moments.any():
                    check_physical(self._world.bodies[index].name, moments)
        at = ids[:, None], self._layout.bodies[indices]
        self._write_inertia(
            at, np.array([[m for m, _ in row] for row in split]), np.array([[q for _, q in row] for row in split])
        )
        self._mark(ids)

    def _write_inertia(self, at: Any, moments: Array, frames: Array) -> None:
        self._expand("body_inertia")[at] = moments
        self._expand("body_iquat")[at] = frames

    def rows(self, ids: Array) -> dict[str, Array]:
        """Principal axes as MuJoCo has them: full tensors would not come back with the same bits."""
        bodies = self._layout.bodies
        return {name: self._rows(name)[ids][:, bodies] for name in ("body_inertia", "body_iquat")}

    def restore_rows(self, ids: Array, data: Any, bodies: Array | None = None) -> None:
        """Write what `rows` returned (for these World bodies); envs go on sharing the model where it says the same."""
        at = ids[:, None], self._layout.bodies if bodies is None else self._layout.bodies[bodies]
        moments, frames = data["body_inertia"], data["body_iquat"]
        same = np.array_equal(self._rows("body_inertia")[at], moments) and np.array_equal(
            self._rows("body_iquat")[at], frames
        )
        if not same:
            self._write_inertia(at, moments, frames)
            self._mark(ids)

    def place(self, ids: Array, fields: Mapping[str, Array]) -> None:
        """Write rows of fields of the model that are no parameters, and from which MuJoCo derives constants."""
        for name, values in fields.items():
            self._expand(name)[ids] = values
        self._mark(ids)

    def settle(self) -> None:
        """Bring the constants that MuJoCo derives up to date where parameters changed.

        Raises:
            EngineError: MuJoCo cannot derive them.
        """
        if self._any_stale:
            touched = np.flatnonzero(self._stale)
            self._stale[:] = self._any_stale = False
            try:
                self._batch.set_const(touched)
            except SimulationError as error:
                raise EngineError(f"MuJoCo refuses the parameters that were written: {error}") from error

    def _mark(self, ids: Array) -> None:
        """MuJoCo's derived constants of these envs are out of date."""
        self._stale[ids] = self._any_stale = True

    @property
    def per_env(self) -> bool:
        """Whether envs have models of their own."""
        return bool(self._expanded) or "actuator_biasprm" in self._batch._expanded  # noqa: SLF001

    def _expand(self, name: str) -> Array:
        self._expanded.add(name)
        return self._batch.expand(name)

    def _rows(self, name: str) -> Array:
        """Values of a model field for all envs, expanded or not."""
        if name in self._expanded:
            return self._batch.expand(name)
        model = self._batch.model
        base = model.opt.gravity if name == "opt.gravity" else getattr(model, name)
        return np.broadcast_to(base, (self._batch.nsim, *base.shape))


def _column(array: Array, field: _Field) -> Array:
    """A view of the field's value in each row."""
    return array if field.column is None else array[..., field.column]

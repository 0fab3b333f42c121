"""Physical and visual parameters per env: Bullet's through changeDynamics, the others are the drive law's own."""

from collections.abc import Callable

import numpy as np

from anysim.conventions import Array
from anysim.engine.lighting import Looks
from anysim.engine.parameters import nominal
from anysim.errors import EngineError
from anysim.kinematics.inertia import tensor
from anysim.model.world import Inertial, World
from anysim_pybullet import kernels as K
from anysim_pybullet.bullet import bullet
from anysim_pybullet.client import Env
from anysim_pybullet.declared import PARAMETERS
from anysim_pybullet.law import Laws
from anysim_pybullet.motors import refuse_dry_friction

_JOINT = {"joint.damping": K.DAMPING, "joint.armature": K.ARMATURE, "joint.friction": K.DRY}


class Parameters:
    """Reads and writes neutral parameters. The axes of inertia are fixed by the build.

    So are centres of mass, for Bullet: where one is moved the env gets a new client, in its present state.
    """

    def __init__(self, world: World, envs: list[Env], laws: Laws, rebuild: Callable[[int], None], looks: Looks) -> None:
        self._world, self._envs, self._laws, self._rebuild = world, envs, laws, rebuild
        n = len(envs)
        self.com = np.tile(nominal("body.com", world), (n, 1, 1))
        self.friction = np.tile(np.array([g.surface.friction for g in world.geoms], dtype=float), (n, 1))
        self.restitution, self.texture, self.material = (
            np.tile(nominal(f"geom.{name}", world), (n, 1)) for name in ("restitution", "texture", "material")
        )
        self.color = np.tile(np.array([g.color for g in world.geoms], dtype=float).reshape(-1, 4), (n, 1, 1))
        self.looks = looks
        self._defaults = {name: self._all(name)[0].copy() for name in PARAMETERS if name not in looks}
        self._touched: list[dict[str, None]] = [{} for _ in envs]

    def get(self, name: str) -> Array:
        """All values (N, K, ...)."""
        return self.looks.get(name) if name in self.looks else self._all(name).copy()

    def default(self, name: str) -> Array:
        """Values (K, ...) as built."""
        return self.looks.default(name) if name in self.looks else self._defaults[name].copy()

    def set(self, name: str, values: Array, ids: Array, indices: Array) -> None:
        """Write values (E, K, ...)."""
        if name in self.looks:
            self.looks.set(name, values, ids, indices)
            return
        if name == "joint.friction" and self._laws.motors is not None:
            for joint, friction in zip(indices.tolist(), values.max(axis=0).tolist(), strict=True):
                refuse_dry_friction(self._world, joint, friction)
        if name == "body.inertia":
            self._check_axes(values, indices)
        at = np.ix_(ids, indices)
        if name in _JOINT:
            self._laws.drives[:, :, _JOINT[name]][at] = values
            self._laws.refresh()
        elif name == "world.gravity":
            self._laws.gravity[ids] = values[:, 0]
        elif name == "body.inertia":
            self._laws.bodies[:, :, K.INERTIA : K.INERTIA + 6][at] = values
        elif name == "body.com":
            if np.array_equal(self.com[at], values):
                return
            self.com[at] = values
            anchor = self._envs[0].plan.frames.anchor
            self._laws.bodies[ids, :, K.COM : K.COM + 3] = self.com[ids] - anchor
        else:
            self._array(name)[at] = values
            if name.startswith(("actuator.", "body.linear_damping", "body.angular_damping")):
                self._laws.refresh()
        for index in ids.tolist():
            self._touched[index][name] = None
            self._push(index, name, indices)

    def _push(self, index: int, name: str, indices: Array) -> None:
        """Give Bullet what it simulates itself, of what is there; the rest waits here."""
        p, env = bullet(), self._envs[index]
        if name == "world.gravity":
            p.setGravity(*self._laws.gravity[index].tolist(), physicsClientId=env.id)
        elif name in ("geom.friction", "geom.restitution"):
            self.push_surfaces(index)
        elif name == "body.com":
            self._rebuild(index)
        elif name == "joint.friction":
            for joint in np.intersect1d(indices, env.cast.joints).tolist():
                env.set_dry_friction(joint, float(self._laws.drives[index, joint, K.DRY]))
        elif name in ("body.mass", "body.inertia"):
            for body in indices.tolist():
                if env.cast.bodies[body] and self._world.bodies[body].kind != "static":
                    # a mass without moments would be given those of the shapes
                    p.changeDynamics(
                        *env.body_at[body],
                        mass=float(self._laws.bodies[index, body, K.MASS]),
                        localInertiaDiagonal=self._moments(index, body),
                        physicsClientId=env.id,
                    )

    def shifted_com(self, index: int) -> Array | None:
        """The centres of mass (B, 3) of an env, None where they are the World's."""
        moved = not np.array_equal(self.com[index], self._defaults["body.com"])
        return self.com[index] if moved else None

    def push_surfaces(self, index: int) -> None:
        """Give Bullet the coefficients of friction and restitution of an env."""
        env = self._envs[index]
        geoms = env.plan.rules.geoms
        env.set_surfaces(self.friction[index, geoms], self.restitution[index, geoms])

    def renew(self, index: int) -> None:
        """Give an env that was built anew what was changed in it before."""
        for name in self._touched[index]:
            if name == "body.com":  # the client was built with it
                continue
            self._push(index, name, np.arange(self._all(name).shape[1]))

    def _array(self, name: str) -> Array:
        laws = self._laws
        return {
            "body.mass": laws.bodies[:, :, K.MASS],
            "body.com": self.com,
            "geom.friction": self.friction,
            "geom.color": self.color,
            "geom.restitution": self.restitution,
            "geom.texture": self.texture,
            "geom.material": self.material,
            "body.linear_damping": laws.damping[:, :, 0],
            "body.angular_damping": laws.damping[:, :, 1],
            "actuator.kp": laws.kp,
            "actuator.kd": laws.kd,
            "actuator.effort_limit": laws.limit,
        }[name]

    def _all(self, name: str) -> Array:
        laws = self._laws
        if name in _JOINT:
            return laws.drives[:, :, _JOINT[name]]
        if name == "world.gravity":
            return laws.gravity[:, None]
        if name == "body.inertia":
            return laws.bodies[:, :, K.INERTIA : K.INERTIA + 6]
        return self._array(name)

    def _in_axes(self, body: int, inertia: Array) -> Array:
        """A tensor in the principal axes of the build (3, 3)."""
        x, y, z, w = self._envs[0].plan.frames.inertial[body, 3:].tolist()
        axes = np.empty((3, 3))
        K.rotation(x, y, z, w, axes)
        xx, yy, zz, xy, xz, yz = inertia.tolist()
        return axes.T @ tensor(Inertial(1.0, inertia=(xx, yy, zz, xy, xz, yz))) @ axes

    def _moments(self, index: int, body: int) -> list[float]:
        inertia = self._laws.bodies[index, body, K.INERTIA : K.INERTIA + 6]
        if np.array_equal(inertia, self._defaults["body.inertia"][body]):
            # turned into its axes again it would have other last bits than those of the build
            return self._envs[0].plan.frames.moments[body].tolist()
        return np.diag(self._in_axes(body, inertia)).tolist()

    def _check_axes(self, values: Array, indices: Array) -> None:
        for row in values:
            for body, inertia in zip(indices.tolist(), row, strict=True):
                matrix = self._in_axes(body, inertia)
                off = np.abs(matrix - np.diag(np.diag(matrix))).max()
                if off > 1e-6 * np.abs(matrix).max():
                    raise EngineError(
                        f"pybullet cannot turn the axes of inertia of body '{self._world.bodies[body].name}': off by "
                        f"{off:.3g} kg m^2 in the axes it was built with; change the moments along these axes, or the "
                        f"world's inertia before the build"
                    )

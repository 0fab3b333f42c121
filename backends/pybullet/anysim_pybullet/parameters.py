"""Physical and visual parameters per env: Bullet's through changeDynamics, the others are the drive law's own."""

from collections.abc import Callable

import numpy as np

from anysim.conventions import Array
from anysim.engine.parameters import ParameterTable
from anysim.errors import EngineError
from anysim.kinematics.inertia import tensor
from anysim.math import matrix as M
from anysim.model.world import Inertial, World
from anysim_mechanics import articulation as K
from anysim_pybullet.bullet import bullet
from anysim_pybullet.client import Env
from anysim_pybullet.law import Laws
from anysim_pybullet.motors import refuse_dry_friction
from anysim_pybullet.options import PybulletOptions, own_scenery


class Parameters(ParameterTable):
    """Reads and writes neutral parameters. The axes of inertia are fixed by the build.

    So are centres of mass, for Bullet: where one is moved the env gets a new client, in its present state.
    """

    def __init__(
        self, world: World, envs: list[Env], laws: Laws, rebuild: Callable[[int], None], options: PybulletOptions
    ) -> None:
        self._envs, self._laws, self._rebuild = envs, laws, rebuild
        kept = {
            "body.mass": laws.bodies[:, :, K.MASS],
            "body.inertia": laws.bodies[:, :, K.INERTIA : K.INERTIA + 6],
            "body.linear_damping": laws.damping[:, :, 0],
            "body.angular_damping": laws.damping[:, :, 1],
            "joint.damping": laws.drives[:, :, K.DAMPING],
            "joint.armature": laws.drives[:, :, K.ARMATURE],
            "joint.friction": laws.drives[:, :, K.DRY],
            "actuator.kp": laws.gains.kp,
            "actuator.kd": laws.gains.kd,
            "actuator.effort_limit": laws.gains.limit,
            "world.gravity": laws.gravity[:, None],
        }
        super().__init__(world, len(envs), own_scenery(options), kept)

    def set(self, name: str, values: Array, ids: Array, indices: Array) -> None:
        """Write values (E, K, ...)."""
        if name != "body.com" or not np.array_equal(self.values[name][np.ix_(ids, indices)], values):
            super().set(name, values, ids, indices)

    def check(self, name: str, values: Array, indices: Array) -> None:
        if name == "joint.friction" and self._laws.motors is not None:
            for joint, friction in zip(indices.tolist(), values.max(axis=0).tolist(), strict=True):
                refuse_dry_friction(self.world, joint, friction)
        elif name == "body.inertia":
            self._check_axes(values, indices)

    def push(self, name: str, ids: Array, indices: Array) -> None:
        if name == "body.com":
            self._laws.bodies[ids, :, K.COM : K.COM + 3] = self.values[name][ids] - self._envs[0].plan.frames.anchor
        elif name.startswith(("actuator.", "joint.", "body.linear_damping", "body.angular_damping")):
            self._laws.refresh()
        for index in ids.tolist():
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
                if env.cast.bodies[body] and self.world.bodies[body].kind != "static":
                    # a mass without moments would be given those of the shapes
                    p.changeDynamics(
                        *env.body_at[body],
                        mass=float(self._laws.bodies[index, body, K.MASS]),
                        localInertiaDiagonal=self._moments(index, body),
                        physicsClientId=env.id,
                    )

    def shifted_com(self, index: int) -> Array | None:
        """The centres of mass (B, 3) of an env, None where they are the World's."""
        return self.values["body.com"][index] if self.changed("body.com", index) else None

    def push_surfaces(self, index: int) -> None:
        """Give Bullet the coefficients of friction and restitution of an env."""
        env = self._envs[index]
        geoms = env.plan.rules.geoms
        env.set_surfaces(self.values["geom.friction"][index, geoms], self.values["geom.restitution"][index, geoms])

    def renew(self, index: int) -> None:
        """Give an env that was built anew what is not as the World says; its surfaces and centres of mass it has."""
        for name in ("world.gravity", "body.mass", "body.inertia", "joint.friction"):
            if self.changed(name, index):
                self._push(index, name, np.arange(self.values[name].shape[1]))

    def _in_axes(self, body: int, inertia: Array) -> Array:
        """A tensor in the principal axes of the build (3, 3)."""
        x, y, z, w = self._envs[0].plan.frames.inertial[body, 3:].tolist()
        axes = np.empty((3, 3))
        K.rotation(x, y, z, w, axes)
        xx, yy, zz, xy, xz, yz = inertia.tolist()
        return M.product(axes.T, tensor(Inertial(1.0, inertia=(xx, yy, zz, xy, xz, yz))), axes)

    def _moments(self, index: int, body: int) -> list[float]:
        inertia = self._laws.bodies[index, body, K.INERTIA : K.INERTIA + 6]
        if np.array_equal(inertia, self._built["body.inertia"][body]):
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
                        f"pybullet cannot turn the axes of inertia of body '{self.world.bodies[body].name}': off by "
                        f"{off:.3g} kg m^2 in the axes it was built with; change the moments along these axes, or the "
                        f"world's inertia before the build"
                    )

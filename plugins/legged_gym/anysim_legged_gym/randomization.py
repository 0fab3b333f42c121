"""Domain randomization: what differs between envs, drawn from named streams and written into the engine."""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.kinematics import inertia
from anysim.randomization.streams import Streams
from anysim_legged_gym.layout import Layout
from anysim_legged_gym.spec import ControlSpec, DomainRandSpec


class Variation(NamedTuple):
    """What is in force in each env; as built where nothing is drawn."""

    friction: Array
    """(N, 1) factor"""
    restitution: Array
    """(N, 1)"""
    added_base_mass: Array
    """(N, 1) [kg]"""
    base_com_bias: Array
    """(N, 3) [m]"""
    joint_armature: Array
    """(N, D) [kg m^2]"""
    kp_scale: Array
    """(N, D)"""
    kd_scale: Array
    """(N, D)"""


class DomainRandomization:
    """Draws for all envs of one engine.

    Attributes:
        drawn: what is in force.
    """

    def __init__(
        self, engine: SimEngine, layout: Layout, spec: DomainRandSpec, control: ControlSpec, streams: Streams
    ) -> None:
        self._engine, self._layout, self._spec, self._streams = engine, layout, spec, streams
        self._velocity = control.control_type == "V"
        n, d = engine.num_envs, len(layout.dof_names)
        restitution = engine.built_parameters("geom.restitution")[layout.geoms]
        armature = engine.built_parameters("joint.armature")[layout.joints]
        self.drawn = Variation(
            np.ones((n, 1)),
            np.full((n, 1), restitution.max(initial=0.0)),
            np.zeros((n, 1)),
            np.zeros((n, 3)),
            np.repeat(armature[None], n, axis=0),
            np.ones((n, d)),
            np.ones((n, d)),
        )
        self._once()

    def _uniform(self, ids: Array, name: str, span: tuple[float, float], count: int) -> Array:
        rows = [self._streams.shared_generator(int(env), f"legged/{name}").uniform(*span, count) for env in ids]
        return np.array(rows).reshape(len(ids), count)

    def _once(self) -> None:
        """What an env keeps for good."""
        spec, drawn, engine, layout = self._spec, self.drawn, self._engine, self._layout
        every = np.arange(engine.num_envs)
        geoms = len(layout.geoms)
        if spec.friction is not None:
            drawn.friction[:] = self._uniform(every, "friction", spec.friction, 1)
            built = engine.built_parameters("geom.friction")[layout.geoms]
            engine.set_parameters("geom.friction", drawn.friction * built, indices=layout.geoms)
        if spec.restitution is not None:
            drawn.restitution[:] = self._uniform(every, "restitution", spec.restitution, 1)
            engine.set_parameters("geom.restitution", np.repeat(drawn.restitution, geoms, axis=1), indices=layout.geoms)
        if spec.added_base_mass is not None:
            drawn.added_base_mass[:] = self._uniform(every, "added_base_mass", spec.added_base_mass, 1)
            self._load_base()
        if spec.base_com_bias is not None:
            drawn.base_com_bias[:] = self._uniform(every, "base_com_bias", spec.base_com_bias, 3)
            built = engine.built_parameters("body.com")[layout.root]
            engine.set_parameters("body.com", (built + drawn.base_com_bias)[:, None], indices=[layout.root])
        if spec.joint_armature is not None:
            drawn.joint_armature[:] = self._uniform(every, "joint_armature", spec.joint_armature, 1)
            engine.set_parameters("joint.armature", drawn.joint_armature, indices=layout.joints)

    def _load_base(self) -> None:
        """Mass and inertia grow alike: the base is as it was built, of another density."""
        root, engine = [self._layout.root], self._engine
        built = engine.world.bodies[self._layout.root].inertial
        factor = 1.0 + self.drawn.added_base_mass[:, 0] / built.mass
        scaled = [inertia.scaled(built, float(f)) for f in factor]
        engine.set_parameters("body.mass", np.array([[i.mass] for i in scaled]), indices=root)
        engine.set_parameters("body.inertia", np.array([[i.inertia] for i in scaled]), indices=root)

    def redraw(self, ids: Array) -> None:
        """New gains of envs."""
        d = len(self._layout.dof_names)
        for name, span, table in (
            ("kp", self._spec.kp_scale, self.drawn.kp_scale),
            ("kd", self._spec.kd_scale, self.drawn.kd_scale),
        ):
            if span is None:
                continue
            table[ids] = self._uniform(ids, f"{name}_scale", span, d)
            self._write_gains(name, ids, table[ids])

    def _write_gains(self, name: str, ids: Array, scale: Array) -> None:
        parameter, drives = f"actuator.{name}", self._layout.drives
        if self._velocity:  # kp is the gain of a velocity's error, which the drive law calls kd
            if name == "kd":
                return
            parameter = "actuator.kd"
        built = self._engine.built_parameters(parameter)[drives]
        self._engine.set_parameters(parameter, scale * built, ids, drives)

    def delays(self, ids: Array) -> Array:
        """(E,) new delays of envs, in actions."""
        if self._spec.ctrl_delay is None:
            return np.zeros(len(ids), dtype=int)
        least, most = self._spec.ctrl_delay
        streams = self._streams
        return np.array([streams.shared_generator(int(e), "legged/delay").integers(least, most + 1) for e in ids])

"""The scenes of all envs of an engine: building, writing, stepping, saving and restoring one of them.

A scene is thrown away and built again where PhysX would remember something: at a reset, when a snapshot comes back,
and for parameters that PhysX reads once.
"""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike

from anysim.conventions import WORLD, Array
from anysim.engine.control import Control
from anysim.engine.state import SnapshotLevel
from anysim.model.world import World
from anysim_mechanics.contact_friction import contact_points, sensor_forces
from anysim_mechanics.one_world.base import EnvWorlds, Painter
from anysim_mechanics.one_world.last_substep import LastSubstep
from anysim_sapien.audit import geom_volumes, joint_limits
from anysim_sapien.contacts import pairs_of
from anysim_sapien.drives import drives_of
from anysim_sapien.momentum import Momentum
from anysim_sapien.motion import Motion, motion_of, put_motion, put_twists, twists_of
from anysim_sapien.options import SapienOptions
from anysim_sapien.parameters import Parameters
from anysim_sapien.raw import raw_loop
from anysim_sapien.recipe import Recipe, Recipes
from anysim_sapien.scene import EnvScene
from anysim_sapien.state import StateReader
from anysim_sapien.stepping import advance, past_of, relive, wrenches

REACH = 1e6
"""[m]: PhysX wants a longest distance of rays."""


class Envs(EnvWorlds):
    """The scenes, and all that is kept beside them."""

    parameters: Parameters

    def __init__(self, world: World, present: Array, options: SapienOptions) -> None:
        """With the entities (N, E) that are there in each env."""
        num_envs = len(present)
        self.world, self.options = world, options
        self.recipes = Recipes(world, options, num_envs)
        self.scenes: list[EnvScene] = []
        self.last = LastSubstep(world, num_envs, self._exerted, self._touched)
        self.lost = np.zeros(num_envs, dtype=bool)
        self.drives = drives_of(world, num_envs)
        self.parameters = Parameters(self.recipes, self.drives, self.scenes, self._rebuild, self._bound)
        self._recipes: list[Recipe] = [self.recipes.of(row) for row in present]
        self.scenes += [EnvScene(recipe, self.parameters.of(env)) for env, recipe in enumerate(self._recipes)]
        self._momentum = Momentum(self.recipes, num_envs)
        self._reader = StateReader(world, self.scenes)
        self._wrench: Array | None = None

    def close(self) -> None:
        self.scenes.clear()

    def _exerted(self, env: int) -> None:
        self.drives.exerted(env, self.last.effort)

    def _touched(self, env: int) -> Array:
        sensors = self.world.contact_sensors
        return sensor_forces(self.world, pairs_of(self.world, self.scenes[env], self._momentum, env) if sensors else ())

    # ------------------------------------------------------------------ new scenes

    def populate(self, env: int, present: Array) -> None:
        recipe, values = self.recipes.of(present), self.parameters.of(env)
        recipe.copies(values.geom_friction, values.geom_restitution)  # fails here where the reset would
        self._recipes[env] = recipe

    def reset(self, env: int) -> None:
        # a used scene would remember contacts
        self.scenes[env] = EnvScene(self._recipes[env], self.parameters.of(env))
        self.drives.forget(env)
        self._momentum.forget(env)

    def _place(self, env: int, motion: Motion) -> None:
        """A new scene for an env, in a given state."""
        self.reset(env)
        put_motion(self.scenes[env], motion)
        self.scenes[env].journal.base()

    def _rebuild(self, env: int) -> None:
        """A new scene for an env, in its present state."""
        self.last.settle(env)
        self._place(env, motion_of(self.scenes[env]))

    def _bound(self, env: int) -> None:
        """What is written again and again and never stepped has its scene built anew, too."""
        if self.scenes[env].journal.writes > self.options.rebase_steps:
            self._rebuild(env)

    # ------------------------------------------------------------------ stepping and reading

    def step(self, env: int, n_steps: int) -> None:
        pushes = None if self._wrench is None else wrenches(self._wrench[env], self.recipes.layout.fixed)
        while n_steps:
            room = self.options.rebase_steps - self.scenes[env].journal.steps
            if room <= 0:
                self._place(env, motion_of(self.scenes[env]))
                continue
            advance(self.scenes[env], self.drives, self._momentum, env, pushes, min(n_steps, room))
            n_steps -= min(n_steps, room)

    def read(self, name: str) -> Array:
        return self._reader.fields[name]()

    def apply_control(self, control: Control) -> None:
        self.drives.apply(control)

    def apply_wrench(self, wrench: Array | None) -> None:
        self._wrench = wrench

    # ------------------------------------------------------------------ writing

    def write_joints(self, env: int, joints: Array, position: Array | None, velocity: Array | None) -> None:
        scene = self.scenes[env]
        full_position = full_velocity = None
        if position is not None:
            full_position = scene.joint_positions()
            full_position[joints] = position
        if velocity is not None:
            full_velocity = scene.joint_velocities()
            full_velocity[joints] = velocity
        scene.place_joints(full_position, full_velocity)
        self._bound(env)

    def write_bodies(self, env: int, bodies: Array, pose: Array | None, twist: Array | None) -> None:
        scene = self.scenes[env]
        turn = scene.poses()[bodies, 3:]
        moved = self.recipes.layout.free[bodies]
        if pose is not None:
            if twist is None:
                # the origin keeps its velocity; PhysX would keep that of the centre of mass
                twist = np.zeros((len(bodies), 6))
                if moved.any():
                    twist[moved] = twists_of(scene, bodies[moved], turn[moved])
            for body, place in zip(bodies, pose, strict=True):
                scene.place_body(int(body), place)
            turn = scene.poses()[bodies, 3:]
        if twist is not None:
            put_twists(scene, bodies[moved], twist[moved], turn[moved])
        self._bound(env)

    # ------------------------------------------------------------------ snapshots

    def rows(self, env: int, level: SnapshotLevel) -> Mapping[str, ArrayLike]:
        scene = self.scenes[env]
        data = past_of(scene) if level is SnapshotLevel.TRAJECTORY else motion_of(scene)._asdict()
        return data | self.parameters.rows(env)

    def put_rows(self, env: int, rows: Mapping[str, Array], level: SnapshotLevel) -> None:
        self.parameters.put_rows(env, rows)
        if level is SnapshotLevel.TRAJECTORY:
            self.scenes[env], drives, momentum = relive(self._recipes[env], rows)
            self.drives.adopt(env, drives)
            self._momentum.adopt(env, momentum)
        else:
            self._place(env, Motion(*(rows[name] for name in Motion._fields)))

    # ------------------------------------------------------------------ sensing and checks

    def contacts(self, env: int) -> list[tuple[Array, ...]]:
        return contact_points(pairs_of(self.world, self.scenes[env], self._momentum, env))

    def raycast(self, env: int, origins: Array, directions: Array) -> tuple[Array, Array]:
        distance, body, scene = np.full(len(origins), np.inf), np.full(len(origins), WORLD), self.scenes[env]
        for ray, (origin, direction) in enumerate(zip(origins, directions, strict=True)):
            hit = scene.system.raycast(origin, direction, REACH)
            if hit is not None:
                distance[ray], body[ray] = hit.distance, scene.body_of[hit.component]
        return distance, body

    def painter(self) -> Painter:
        from anysim_sapien.render import Painter

        return Painter(self.world, self.parameters.looks, self.options)

    def read_back(self) -> Mapping[str, Array]:
        scene = self.scenes[0]
        return {"joint.limits": joint_limits(scene), "geom.volume": geom_volumes(self.world, scene)}

    def handles(self) -> Mapping[str, int]:
        # scenes that are alive in this process, and the entities in those of this engine
        entities = sum(len(scene.scene.entities) for scene in self.scenes)
        return {"scenes": len(EnvScene.alive), "entities": entities}

    def raw_loop(self, control: Control) -> Callable[[int], None]:
        return raw_loop(self, control)

"""SAPIEN's own loop over the same envs, which the engine is measured against."""

from collections.abc import Callable
from dataclasses import replace
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from anysim.engine.control import Control, alternating
from anysim.model.world import Actuation
from anysim_sapien.drives import NativeDrives
from anysim_sapien.motion import motion_of, put_motion
from anysim_sapien.recipe import Recipes
from anysim_sapien.scene import EnvScene

if TYPE_CHECKING:
    from anysim_sapien.envs import Envs


def raw_loop(envs: "Envs", control: Control) -> Callable[[int], None]:
    """A function of the number of physics steps: set targets, step private scenes, copy the state out into arrays.

    As one would write it for SAPIEN alone: PhysX' own drives, whose gains were set before; all targets are set in each
    call, two commands in turn, and joint positions and velocities, poses and velocities of bodies copied as SAPIEN
    gives them.
    """
    world, drives, originals = envs.world, envs.drives, envs.scenes
    native = replace(world, physics=replace(world.physics, actuation=Actuation.NATIVE))
    recipes = Recipes(native, envs.options)
    scenes = [EnvScene(recipes.of(o.recipe.present), envs.parameters.of(env)) for env, o in enumerate(originals)]
    own = NativeDrives(native, len(scenes))
    own.gains.values[...], own.passive[...] = drives.gains.values, drives.passive
    own.apply(control)
    for env, (scene, original) in enumerate(zip(scenes, originals, strict=True)):
        put_motion(scene, motion_of(original))
        own.begin(env, scene)
    driven = [a.joint for a in world.actuators]
    written: list[list[list[tuple[Any, float, float]]]] = []
    for commands in alternating(control):
        own.apply(commands)
        written.append(
            [
                [(scene.joints[j], *own.wanted[env, j, :2].tolist()) for j in driven if scene.layout.joint_there[j]]
                for env, scene in enumerate(scenes)
            ]
        )
    turns = cycle(written)
    moving = [i for i in range(len(world.bodies)) if not recipes.layout.fixed[i]]
    position = np.zeros((len(scenes), len(world.joints)))
    velocity, twist = np.zeros_like(position), np.zeros((len(scenes), len(world.bodies), 6))
    poses = [np.zeros((len(scene.scene.entities), 7)) for scene in scenes]

    def loop(steps: int) -> None:
        targets = next(turns)
        for env, scene in enumerate(scenes):
            for joint, place, speed in targets[env]:
                joint.set_drive_target(place)
                joint.set_drive_velocity_target(speed)
            system = scene.system
            for _ in range(steps):
                system.step()
            for tree in scene.trees:
                position[env, tree.joints] = tree.handle.get_qpos()
                velocity[env, tree.joints] = tree.handle.get_qvel()
            poses[env][...] = np.frombuffer(scene.scene.pack_poses(), dtype=np.float32).reshape(-1, 7)
            twist[env, moving] = [(*scene.bodies[b].linear_velocity, *scene.bodies[b].angular_velocity) for b in moving]

    return loop

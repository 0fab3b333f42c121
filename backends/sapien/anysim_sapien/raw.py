"""SAPIEN's own loop over the same envs, which the engine is measured against."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from anysim.engine.commands import Control
from anysim.world.model import Actuation, World
from anysim_sapien.drives import Drives
from anysim_sapien.motion import Motion, put_motion
from anysim_sapien.native import NativeDrives
from anysim_sapien.options import SapienOptions
from anysim_sapien.recipe import Recipe, Values
from anysim_sapien.scene import EnvScene


def raw_loop(
    world: World, options: SapienOptions, values: list[Values], motions: list[Motion], drives: Drives, control: Control
) -> Callable[[int], None]:
    """A function of the number of physics steps: set targets, step private scenes, copy the state out into arrays.

    As one would write it for SAPIEN alone: PhysX' own drives, whose gains were set before; all targets are set in each
    call, and joint positions and velocities, poses and velocities of bodies copied as SAPIEN gives them.
    """
    native = replace(world, physics=replace(world.physics, actuation=Actuation.NATIVE))
    recipe = Recipe(native, options)
    scenes = [EnvScene(recipe, row) for row in values]
    own = NativeDrives(native, len(scenes))
    own.kp[...], own.kd[...], own.limit[...], own.passive[...] = drives.kp, drives.kd, drives.limit, drives.passive
    own.apply(control)
    for env, (scene, motion) in enumerate(zip(scenes, motions, strict=True)):
        put_motion(scene, recipe.layout, motion)
        own.begin(env, scene)
    driven = [a.joint for a in world.actuators]
    targets = [[(scene.joints[j], *own.target(env, j)) for j in driven] for env, scene in enumerate(scenes)]
    moving = [i for i in range(len(world.bodies)) if not recipe.layout.fixed[i]]
    position = np.zeros((len(scenes), len(world.joints)))
    velocity, count = np.zeros_like(position), len(scenes[0].scene.entities) if scenes else 0
    pose, twist = np.zeros((len(scenes), count, 7)), np.zeros((len(scenes), len(world.bodies), 6))

    def loop(steps: int) -> None:
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
            pose[env] = np.frombuffer(scene.scene.pack_poses(), dtype=np.float32).reshape(-1, 7)
            twist[env, moving] = [(*scene.bodies[b].linear_velocity, *scene.bodies[b].angular_velocity) for b in moving]

    return loop

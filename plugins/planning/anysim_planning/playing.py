"""A motion played on an engine: an arm goes along joint positions with its own drives, and its tool is looked at."""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.factory import create_simulation
from anysim.errors import AnysimError, listing
from anysim.math import pose as P
from anysim.model.world import World
from anysim_planning.retarget import arm_of

FOLLOWED = 0.005
"""[m] that a tool may be off the path by which it was to go, with the drives of the catalogue's arms."""


class Playback(NamedTuple):
    """T control steps of an arm.

    Attributes:
        engine: its name and version.
        times: (T,) [s] at the ends of the steps, on the clock of the motion.
        joint_pos: (T, K) where the joints were.
        tool_pose: (T, 7) where the tool was.
    """

    engine: str
    times: Array
    joint_pos: Array
    tool_pose: Array

    def strays(self, times: Array, poses: Array) -> tuple[float, float]:
        """[m], [rad] by which the tool was off poses (M, 7) that are wanted at times (M,), at most.

        Between two of them positions go straight, and the turn is that of the nearer one.
        """
        wanted = np.column_stack([np.interp(self.times, times, column) for column in poses[:, :3].T])
        nearest = np.abs(self.times[:, None] - times).argmin(axis=1)
        away = np.linalg.norm(self.tool_pose[:, :3] - wanted, axis=1)
        return float(away.max()), float(P.angle_between(self.tool_pose[:, 3:], poses[nearest, 3:]).max())


def play(world: World, robot: str, tool: str, times: Array, joint_pos: Array, engine: str | None = None) -> Playback:
    """Play joint positions (M, K) of the arm of a tool at times (M,) on an engine, from rest; all else holds still.

    Raises:
        NameLookupError: there is no such tool.
        AnysimError: a joint of the arm has no drive.
        EngineError, CapabilityError: the engine cannot run here, or not with this world.
    """
    arm = arm_of(world, robot, tool)
    site = world.sites[next(r for r in world.robots if r.name == robot).tools[tool]]
    drives = {actuator.joint: a for a, actuator in enumerate(world.actuators)}
    joints = arm.joints.tolist()
    if bare := [name for name, j in zip(arm.joint_names, joints, strict=True) if j not in drives]:
        raise AnysimError(
            f"{arm.name}: {listing(bare)} have no drive, so nothing can play the motion; take another robot"
        )
    actuators, dt = [drives[j] for j in joints], world.physics.control_dt
    clock = times[0] + dt * np.arange(1 + max(1, int(np.ceil((times[-1] - times[0]) / dt))))
    told = np.column_stack([np.interp(clock, times, column) for column in joint_pos.T])
    speed = np.gradient(told, dt, axis=0)
    joint_rows, poses = list[Array](), list[Array]()
    simulation = create_simulation(engine).create_world(world, 1)
    try:
        simulation.set_joint_state(told[:1], np.zeros_like(told[:1]), joints=joints)
        for position, velocity in zip(told[1:], speed[1:], strict=True):
            simulation.set_control(position[None], velocity[None], actuators=actuators)
            simulation.step(world.physics.substeps)
            state = simulation.get_state()
            joint_rows.append(state.joint_pos[0, joints])
            poses.append(P.compose(state.body_pose[0, site.body], P.pose(site.position, site.quaternion)))
        named = f"{simulation.name} {simulation.version}"
    finally:
        simulation.destroy()
    return Playback(named, clock[1:], np.array(joint_rows), np.array(poses))

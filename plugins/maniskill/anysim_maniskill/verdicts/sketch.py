"""Sketches: many states of a task's scene, written as arrays into an engine that moves nothing."""

from collections.abc import Sequence
from types import TracebackType
from typing import Self

import numpy as np

from anysim.api import load, make
from anysim.compile.joints import ends
from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.math import pose as P
from anysim.model.world import BodyKind


class Sketch:
    """N states of a task's scene: one env each on the engine `null`, which draws no picture and moves nothing.

    Poses are (N, 7) in the world frame, xyzw; twists (N, 6) are of the body's own origin. What no one places is where
    an episode begins.

    Attributes:
        env: the task's env.
        notes: what states have beside poses and joints, by name (N, ...), such as the force of a finger [N].
    """

    def __init__(self, task: str, num_states: int, overrides: Sequence[str] = ()) -> None:
        """Raises SpecError where the task does not take the overrides."""
        blind = [f"world.cameras.{name}=null" for name in load(task).spec.world.cameras]
        fixed = ["record.cameras=[]", "task.hold=1", *blind, *overrides]
        self.env = make(task, engine="null", num_envs=num_states, overrides=fixed)
        self.env.reset(seed=0)
        self.num_states = num_states
        self.notes: dict[str, Array] = {}
        self._look()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.env.close()

    def _look(self) -> None:
        self.env.scene.look(None)

    # ------------------------------------------------------------------ writing

    def place(self, frame: str, pose: Array, twist: Array | None = None) -> None:
        """Put the free or fixed body that a frame belongs to, or a whole robot, so that the frame has a pose.

        `twist` (N, 6) is that of the frame's origin; zero where not given.
        """
        world, index = self.env.engine.world, self.env.scene.index
        body = index.frame(frame).body
        entity = next(e for e in world.entities if e.body_start <= body < e.body_stop)
        root = entity.body_start
        here = self.env.engine.get_state().body_pose[:, root]
        offset = P.compose(P.inverse(self.pose(frame)), here)
        there = P.compose(pose, offset)
        free = world.bodies[root].kind is BodyKind.FREE
        if twist is not None and not free:
            raise TaskError(f"'{frame}' belongs to a body that cannot move: it has a pose and no twist")
        moving = np.zeros((self.num_states, 6)) if twist is None else twist.copy()
        moving[:, :3] += P.cross(moving[:, 3:], there[:, :3] - pose[:, :3])
        self.env.engine.set_body_state(there[:, None], moving[:, None] if free else None, bodies=[root])
        self._look()

    def move_joints(self, joints: Sequence[int], position: Array | None, velocity: Array | None) -> None:
        """Write joints of the world, by index: positions and velocities (N, K) [rad, m; rad/s, m/s]."""
        self.env.engine.set_joint_state(position, velocity, joints=list(joints))
        self._look()

    def open_joint(self, name: str, share: Array, velocity: Array) -> None:
        """Open a joint by a share (N,) of its range, moving at a velocity (N,) [rad/s, m/s] in its own direction."""
        closed, opened = self.joint_ends(name)
        self.move_joints([self._number(name)], (closed + share * (opened - closed))[:, None], velocity[:, None])

    # ------------------------------------------------------------------ reading

    def pose(self, frame: str) -> Array:
        """(N, 7) of a frame or a goal."""
        return self.env.scene.frame(frame).pose.copy()

    def twist(self, frame: str) -> Array:
        """(N, 6) of a frame's origin."""
        return self.env.scene.frame(frame).twist.copy()

    def joint_position(self, name: str) -> Array:
        """(N,) [rad, m]."""
        return self.env.engine.get_state().joint_pos[:, self._number(name)]

    def joint_ends(self, name: str) -> tuple[float, float]:
        """Where a joint is closed, and where it is open [rad, m]."""
        return ends(self.env.engine.world.joints[self._number(name)])

    def _number(self, name: str) -> int:
        return [joint.name for joint in self.env.engine.world.joints].index(name)

    def arm_joints(self, robot: str) -> Array:
        """(K,) indices of a robot's joints that are not its grippers'."""
        return self.env.scene.robot(robot).arm_joints

    def joint_velocities(self, robot: str) -> Array:
        """(N, J) of all joints of a robot, those of its gripper last [rad/s, m/s]."""
        return self.env.scene.robot(robot).joint_vel.copy()

    def judge(self) -> Array:
        """(N,) bool: the task's success at this moment, without any time for which it has to hold."""
        self.env.mdp.held[:] = 0
        self._look()
        return self.env.mdp.judge()[0]

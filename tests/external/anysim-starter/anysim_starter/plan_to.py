"""A skill that can be a command: it brings a tool to a goal around what is in the way, by any planner."""

from collections.abc import Sequence
from weakref import WeakKeyDictionary

import numpy as np

from anysim.conventions import Array
from anysim.kinematics.chain import Chain
from anysim.planning.motion import Budget, PlanRequest, PlanStatus, Scenes, ToolGoal, Trajectory, motion_planner
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Mover, Phase, PhasedSkill, Rung
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, RobotView

FAILURES = {
    PlanStatus.NO_IK: Outcome.NO_IK,
    PlanStatus.NO_PATH: Outcome.NO_PATH,
    PlanStatus.START_IN_COLLISION: Outcome.COLLISION,
}
"""Of a skill whose plan failed; a planner that was too late is a timeout."""


_JOINTS: WeakKeyDictionary[TaskEnv, dict[str, "Joints"]] = WeakKeyDictionary()


class Joints(Mover):
    """A mover: the joints of an arm, told where to be in each control step. All skills of an env share one."""

    def __init__(self, env: TaskEnv, robot: str, chain: Chain) -> None:
        self._env, self._chain, self._slice = env, chain, env.actions.slice_of(robot, "arm")
        self.wanted = np.zeros((env.num_envs, len(chain)))
        self._fresh = np.ones(env.num_envs, dtype=bool)

    @classmethod
    def of(cls, env: TaskEnv, robot: str, chain: Chain) -> "Joints":
        """The one of a robot's arm."""
        return _JOINTS.setdefault(env, {}).setdefault(robot, cls(env, robot, chain))

    def renew(self, ids: Array) -> None:
        self._fresh[ids] = True

    def prepare(self, ids: Array) -> None:
        fresh = ids[self._fresh[ids]]
        self.wanted[fresh] = self._env.scene.state.joint_pos[np.ix_(fresh, self._chain.joints)]
        self._fresh[fresh] = False

    def act(self, ids: Array, action: Array) -> None:
        part = self._slice
        action[ids, part.start : part.stop] = part.controller.action_for(self.wanted[ids], ids)


class PlanTo(PhasedSkill):
    """Plan a free motion of an arm to a goal, with the tool turned as it is, and follow it."""

    def __init__(
        self, env: TaskEnv, *, robot: RobotView, goal: Frame, tool: str = "tool", planner: str = "starter_hop"
    ) -> None:
        world = env.engine.world
        self._robot, self._goal, self._name, self._tool = robot.name, goal, tool, robot.tool(tool)
        self._chain = Chain.from_world(world, robot.name, "arm", tool)
        self._planner, self._scenes = motion_planner(world, planner), Scenes(world, env.num_envs)
        self._ways: list[Trajectory | None] = [None] * env.num_envs
        self._said = np.full(env.num_envs, GO_ON)
        self._joints = Joints.of(env, robot.name, self._chain)
        super().__init__(env, [self._joints])

    def make_phases(self) -> Sequence[Phase]:
        return (Phase("plan", self._plan, lambda ids, _: self._said[ids], 1), Phase("follow", None, self._follow, 600))

    def retry(self, rung: Rung, env: int) -> int | None:
        """Another seed, which is what the number of the attempt makes; there is one goal and no other candidate."""
        return 0 if rung is Rung.REPLAN else None

    def _plan(self, ids: Array, at: Array) -> None:
        state = self.env.scene.state
        self._scenes.update(state.body_pose)
        for env, row in zip(ids.tolist(), at.tolist(), strict=True):
            pose = np.concatenate([self._goal.position[row], self._tool.pose[row, 3:]])
            request = PlanRequest(
                self._chain.joint_names,
                self._joints.wanted[env],
                (ToolGoal(self._robot, self._name, pose[None]),),
                velocity_scale=0.5,
                acceleration=4.0,
                seed=int(self.env.streams.episode_seed[env]) + int(self.attempts[env]),
            )
            budget = Budget(request.deadline)
            budget.begin()
            answer = self._planner.plan(request, self._scenes.scene(env), budget)
            self._ways[env] = answer.trajectory
            failed = FAILURES.get(answer.status, Outcome.TIMEOUT)
            self._said[env] = GO_ON if answer.status is PlanStatus.OK else OUTCOMES.index(failed)

    def _follow(self, ids: Array, at: Array) -> Array:
        clock = (self.steps[ids] + 1) * self.env.engine.world.physics.control_dt
        for env, now in zip(ids.tolist(), clock.tolist(), strict=True):
            way = self._ways[env]
            assert way is not None
            self._joints.wanted[env] = [np.interp(now, way.times, column) for column in way.joint_pos.T]
        near = np.linalg.norm(self._goal.position[at] - self._tool.position[at], axis=1) < 0.01
        over = clock >= [way.times[-1] if way is not None else 0.0 for way in map(self._ways.__getitem__, ids)]
        return np.where(near & over, GO_ON, STAY)

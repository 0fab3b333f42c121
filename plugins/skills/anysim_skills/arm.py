"""An arm with its gripper, as skills drive it: a tool pose to go to for each env, and how the fingers are.

Skills of all kinds write `target`, `speed` and `closed` of the envs they act in; the arm then moves all of them at
once, each along a straight line, with inverse kinematics solved for the commanded pose. It never leads the real tool by
more than `lead`, which bounds the force with which it presses on what it cannot pass. Where the way may not be free a
skill asks for a planned move instead.
"""

from collections.abc import Callable, Sequence
from typing import Self

import numpy as np

from anysim.controllers.gripper import GripperForce
from anysim.conventions import Array
from anysim.errors import SpecError, SpecIssue, TaskError, listing
from anysim.math import pose as P
from anysim.model.world import JointType
from anysim.planning.api import inverse_kinematics
from anysim.planning.service import PlannerService
from anysim.skills.phases import Mover, Phase
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, ObjectView, RobotView
from anysim_skills.arm_columns import ArmColumns
from anysim_skills.env_lifetime import PerEnv
from anysim_skills.planned_arms import PlannedArm
from anysim_skills.planned_moves import PlannedMoves, Stage
from anysim_skills.planning import LATENCY, Latency, planner_of
from anysim_skills.sag import Sag

ARRIVED = 0.004
"""[m] distance of the tool at which a straight move counts as done."""
TURNED = 0.04
"""[rad] the same for its rotation."""
LEAD = 0.05
"""[m] the commanded tool runs at most this far ahead of the real one where nothing is to be pressed."""
SLIPPED = 0.05
"""[m] what has moved further in the hand is not held any more."""
AT_REST = 0.02
"""[m/s] a tool that moves slower, while its command is ahead of it, is held up by something."""
_PRESSED = 0.8
STALLED = 15
"""Control steps without inverse kinematics after which the arm leaves the line and moves joint by joint."""
DETOUR_SPEED = 0.3
"""Of the joints' velocity limits, on such a way."""
TURN_RATE = 5.0
"""[rad/m] rotation allowed for each metre of a step; position and rotation arrive together."""

_ARMS: PerEnv[tuple[str, str, str, str], "Arm"] = PerEnv()


class Arm(Mover):
    """One arm of a robot in all envs, with its gripper where it has one.

    Of a channel with several arms it moves the joints that the catalogue gives to the `group` of its tool.

    Attributes:
        tool: the frame that is moved.
        chain: its joints.
        target: (N, 7) where the tool is to go.
        speed: (N,) [m/s] of the commanded tool.
        lead: (N,) [m] bound of the distance from the tool to its command.
        closed: (N,) bool, whether the gripper is told to close.
        press: (N,) with which share of its force it then presses; all of it again once it has opened.
        command: (N, 7) where the tool is told to be now.
        joints: (N, K) what the joints are told.
        grip: (N, 3) [m] where what is held was in the tool's frame when it was taken.
        aperture: [m] how wide the gripper opens; infinite where its fingers turn, or there is none.
        stuck: (N,) bool: the last step towards the target had no inverse kinematics.
        plans: the planned moves of it alone; None as long as no skill has a planner for these.
        moves: all planned moves that it takes part in, those with another arm too, each with its place in them.
    """

    plans: PlannedMoves | None = None

    def __init__(self, env: TaskEnv, robot: RobotView, channel: str, gripper: str, tool: str, solver: str) -> None:
        self.env, self.robot = env, robot
        self.tool = robot.tool(tool)
        self._columns = ArmColumns(env, robot, channel, tool)
        self.chain = self._columns.chain
        self._eef = env.actions.slice_of(robot.name, gripper) if gripper in robot.model.channels else None
        self.solver = inverse_kinematics(self.chain, solver)
        self._dt = env.engine.world.physics.control_dt
        self._fingers = np.array(robot.channel(gripper).joints if self._eef is not None else (), dtype=int)
        self.aperture = _aperture(env, robot, gripper) if self._eef is not None else float("inf")
        n = env.num_envs
        self.target, self.command = np.zeros((n, 7)), np.zeros((n, 7))
        self.speed, self.lead = np.zeros(n), np.full(n, LEAD)
        self.press = np.ones(n)
        self.closed, self.stuck = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
        self.grip = np.zeros((n, 3))
        self.joints = np.zeros((n, len(self.chain)))
        entry = self.robot.model.entry
        self._sag = Sag(n, self._dt) if entry is not None and not entry.gravity_compensation else None
        self._fresh = np.ones(n, dtype=bool)
        self._stalled, self._detour = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=bool)
        self._way = np.zeros((n, len(self.chain)))
        """Where the joints go on a detour."""
        self.moves: dict[PlannedMoves, int] = {}

    @classmethod
    def of(
        cls,
        env: TaskEnv,
        robot: RobotView,
        *,
        channel: str = "arm",
        gripper: str = "eef",
        tool: str = "tool",
        solver: str = "numba_ik",
        planner: str = "",
        latency: Latency = LATENCY,
    ) -> Self:
        """The arm of an env, shared by all skills that drive it.

        Args:
            env, robot, channel, gripper, tool, solver: whose arm it is, and how it is moved.
            planner: what plans its moves, by name; empty: this skill has no moves planned.
            latency: control steps until a plan takes effect; `realtime`: as soon as it is ready.

        Raises:
            NameLookupError, TaskError: the robot has no such channels or tool, or they have no controllers; two skills
                want other planners for the same arm.
            PluginError: no planner of that name is installed.
        """
        key = (robot.name, channel, gripper, tool)
        arm = _ARMS.of(env, key, lambda: cls(env, robot, channel, gripper, tool, solver))
        if planner:
            arm.plan_with(planner, latency)
        return arm  # pyright: ignore[reportReturnType]

    def plan_with(self, planner: str, latency: Latency) -> None:
        """Have moves planned from now on."""
        if self.plans is None:
            self.plans = planned_moves((self,), planner, latency)
        self.agree(planner, latency)

    def agree(self, planner: str, latency: Latency) -> None:
        """Refuse another planner or latency than that of its planned moves."""
        for plans in self.moves:
            if (plans.planner.name, plans.latency) != (planner, latency):
                raise TaskError(
                    f"skills plan moves of '{self.robot.name}' with {plans.planner.name} at a latency of "
                    f"{plans.latency} control steps, and with {planner} at {latency}; give all skills of an arm the "
                    f"same planner and latency"
                )

    # ------------------------------------------------------------------ what skills ask and say; the scene looks at ids

    def renew(self, ids: Array) -> None:
        """These envs have just been reset: whatever was commanded is forgotten."""
        self._fresh[ids] = True
        for plans in self.moves:
            plans.renew(ids)

    @property
    def planners(self) -> tuple[PlannerService, ...]:
        """The service that plans its moves, if they are planned."""
        return tuple(dict.fromkeys(plans.planner.service for plans in self.moves))

    def describe(self, env: int) -> dict[str, object]:
        """What records say of how it is moved."""
        del env
        return {"planner": next(iter(self.moves)).describe()} if self.moves else {}

    def prepare(self, ids: Array) -> None:
        """Begin from where the arm is, in envs that have been reset; the scene looks at `ids`."""
        fresh = self._fresh[ids]
        if not fresh.any():
            return
        pose, ids = self.tool.pose[fresh], ids[fresh]
        self._fresh[ids] = False
        self.command[ids] = self.target[ids] = pose
        self.joints[ids] = self.env.scene.state.joint_pos[np.ix_(ids, self.chain.joints)]
        self.speed[ids], self.lead[ids], self.closed[ids], self.stuck[ids] = 0.2, LEAD, False, False
        self._stalled[ids], self._detour[ids] = 0, False
        if self._sag is not None:
            self._sag.forget(ids)

    def go(self, ids: Array, target: Array, speed: float, lead: float = LEAD) -> None:
        """Move straight towards tool poses (n, 7) at a speed [m/s]."""
        self._leave_plans(ids)
        self.target[ids], self.speed[ids], self.lead[ids] = target, speed, lead

    def turn_to(self, ids: Array, joints: Array) -> None:
        """Move joint by joint to positions (n, K), whatever is in the way; then the tool is told to be there."""
        if self.plans is not None:
            self.plans.drop(ids)
        if self._sag is not None:
            self._sag.forget(ids)  # on such a way the tool is far from where it is told to be
        self._way[ids], self._detour[ids], self._stalled[ids] = joints, True, 0
        self.target[ids] = self.command[ids] = self.chain.tool_pose(self._base(ids), joints)

    def home(self, ids: Array) -> Array:
        """(n, 7) where the tool is in the posture that the arm began in, as its base stands now."""
        return self.chain.tool_pose(self._base(ids), np.broadcast_to(self.chain.initial, (len(ids), len(self.chain))))

    def stay(self, ids: Array) -> None:
        """Hold the commanded pose."""
        self._leave_plans(ids)
        self.target[ids] = self.command[ids]

    def _leave_plans(self, ids: Array) -> None:
        for plans in self.moves:
            plans.drop(ids)

    def plan(
        self,
        ids: Array,
        goals: Array,
        *,
        held: ObjectView | None = None,
        then: Array | None = None,
        touched: ObjectView | None = None,
    ) -> None:
        """Move to one of the tool poses (n, G, 7) around whatever is in the way; see `planned` for how that goes.

        The arm holds its pose until the answer takes effect, and follows it in the space of its joints.

        Args:
            ids: the envs.
            goals: the goal set of each; the planner chooses what is nearest and free.
            held: the object in the hand, which is to hit nothing either.
            then: (n, 7) or (n, S, 7) the ends of straight lines after the move, on which nothing may be in the way but
                `touched`.
            touched: what the robot may touch on those lines.

        Raises:
            TaskError: the arm has no planner.
        """
        if self.plans is None:
            raise TaskError(f"the arm of '{self.robot.name}' has no planner; give one to `Arm.of`")
        self.stay(ids)
        self.plans.ask(
            ids, list(goals[:, None]), held, None if then is None else then.reshape(len(ids), 1, -1, 7), touched
        )

    def planned(self, ids: Array) -> Array:
        """(n,) STAY while a move is planned or followed, GO_ON where it has arrived, else its failure in OUTCOMES."""
        assert self.plans is not None
        return self.plans.said(ids)

    def planned_phase(self, ask: Callable[[Array, Array], None]) -> Phase:
        """A phase that begins with `ask`, which calls `plan` for envs and their rows, and ends where the move does."""
        assert self.plans is not None
        return self.plans.phase(ask)

    def arrived(self, ids: Array, at: Array, distance: float = ARRIVED, angle: float = TURNED) -> Array:
        """(n,) bool: the tool is at its target. `at` are the rows of these envs in the scene."""
        tool, target = self.tool.pose[at], self.target[ids]
        there = P.norm(target[:, :3] - tool[:, :3]) < distance
        if there.any():
            there[there] = P.angle_between(tool[there, 3:], target[there, 3:]) < angle
        return there

    def ahead(self, ids: Array, at: Array) -> Array:
        """(n,) [m] how far the command is ahead of the tool: what is in the way makes it grow."""
        return P.norm(self.command[ids, :3] - self.tool.position[at])

    def touching(self, ids: Array, at: Array) -> Array:
        """(n,) bool: something holds the tool up: the command is as far ahead as it may be, and the tool rests."""
        still = P.norm(self.tool.twist[at, :3]) < AT_REST
        return still & (self.ahead(ids, at) > _PRESSED * self.lead[ids])

    def take(self, ids: Array, at: Array, thing: Frame) -> None:
        """From here on `thing` is held as it is now."""
        self.grip[ids] = self._in_tool(at, thing)

    def holds(self, ids: Array, at: Array, thing: Frame) -> Array:
        """(n,) bool: `thing` has not slipped from where it was taken."""
        return ~(P.norm(self._in_tool(at, thing) - self.grip[ids]) > SLIPPED)

    def _in_tool(self, at: Array, thing: Frame) -> Array:
        tool = self.tool.pose[at]
        return P.rotate_inverse(tool[:, 3:], thing.position[at] - tool[:, :3])

    def check_gripper(self) -> None:
        """Refuse to grasp with an arm that has no gripper.

        Raises:
            TaskError: the robot has no channel for it.
        """
        if self._eef is None:
            channels = listing(list(self.robot.model.channels))
            raise TaskError(f"'{self.robot.name}' has no gripper to grasp with, a channel `eef` (channels: {channels})")

    def share_of(self, force: float | None) -> float:
        """The share of the gripper's force with which each finger presses by so much [N]; None: all of it.

        Raises:
            SpecError: at `force`, why the gripper cannot be told to press so hard.
        """
        if force is None:
            return 1.0
        self.check_gripper()
        assert self._eef is not None
        channel, controller = f"{self.robot.name}.{self._eef.channel}", self._eef.controller
        limit = controller.channel.effort_limit
        if not isinstance(controller, GripperForce):
            key = f"world.robots.{self.robot.name}.actions.{self._eef.channel}"
            words = f"'{channel}' always closes with all its force; say `gripper_force` at {key}, or leave `force` out"
        elif not np.isfinite(self.aperture) or np.ptp(limit) > 0:
            words = f"the fingers of '{channel}' turn, or are not alike: what they press with is not known"
        elif force > limit[0]:
            words = f"a finger of '{channel}' presses with at most {limit[0]:g} N, {force:g} N are asked for"
        else:
            return force / float(limit[0])
        raise SpecError([SpecIssue("", "force", words)])

    def finger_speed(self, ids: Array) -> Array:
        """(n,) [rad/s, m/s] of the fastest joint of the gripper."""
        return np.abs(self.env.scene.state.joint_vel[np.ix_(ids, self._fingers)]).max(axis=1, initial=0.0)

    def reach(
        self, ids: Array, targets: Array, seeds: Array | None = None, where: Array | None = None
    ) -> tuple[Array, Array]:
        """Inverse kinematics of many tool poses (n, g, 7): from the live configuration, else from where it began.

        `seeds` (n, g, K) are configurations in place of the live one. Only those `where` (n, g) bool says so are looked
        at; the others count as out of reach.

        Returns:
            joint_pos (n, g, K) and the largest joint motion (n, g) to get there; infinite where there is no solution.
        """
        n, g = targets.shape[:2]
        live = self.env.scene.state.joint_pos[np.ix_(ids, self.chain.joints)]
        seeds = np.repeat(live, g, axis=0) if seeds is None else seeds.reshape(n * g, -1)
        keys = np.repeat(self.env.streams.episode_seed[ids], g)
        base, poses = np.repeat(self._base(ids), g, axis=0), targets.reshape(-1, 7)
        asked = np.arange(n * g) if where is None else np.flatnonzero(where)
        found = self.solver.solve(poses[asked], base[asked], seeds[asked], random_restarts=0, rng_seeds=keys[asked])
        joints, moved = seeds.copy(), np.full(n * g, np.inf)
        joints[asked], reached, left = found.joint_pos, asked[found.converged], asked[~found.converged]
        if len(left):
            home = np.repeat(self.chain.initial[None], len(left), axis=0)
            again = self.solver.solve(poses[left], base[left], home, random_restarts=0, rng_seeds=keys[left])
            won = left[again.converged]
            joints[won], reached = again.joint_pos[again.converged], np.concatenate([reached, won])
        moved[reached] = np.abs(joints[reached] - seeds[reached]).max(axis=1)
        return joints.reshape(n, g, -1), moved.reshape(n, g)

    def effort(self, ids: Array, ways: Array) -> Array:
        """(n, ...) the largest joint motion to a pose of each of ways (n, ..., m, 7), as of `reach`."""
        return self.reach(ids, ways.reshape(len(ids), -1, 7))[1].reshape(ways.shape[:-1]).max(axis=-1)

    def _base(self, ids: Array) -> Array:
        return self.env.scene.state.body_pose[ids, self.chain.root]

    # ------------------------------------------------------------------ moving

    def act(self, ids: Array, action: Array) -> None:
        """Write the action of these envs, which the scene looks at: one step towards their targets."""
        led = np.zeros(len(ids), dtype=bool)
        for plans, place in self.moves.items():
            own = plans.move(ids)
            if own.any():
                self._follow(ids[own], plans, place)
            led |= own
        if not led.all():
            self._straight(ids[~led], self.tool.position[~led])
        self._columns.write(ids, self.joints[ids], action)
        if self._eef is not None:
            self.press[ids[~self.closed[ids]]] = 1.0
            action[ids, self._eef.start : self._eef.stop] = np.where(self.closed[ids], -self.press[ids], 1.0)[:, None]

    def _follow(self, ids: Array, plans: PlannedMoves, place: int) -> None:
        """The joints are told by a plan: commands follow them."""
        self.command[ids] = self.chain.tool_pose(self._base(ids), self.joints[ids])
        under_way = plans.stage[ids] != Stage.ARRIVED
        self.target[ids] = np.where(under_way[:, None], self.command[ids], plans.goal[ids, place])
        self.stuck[ids], self._stalled[ids], self._detour[ids] = False, 0, False

    def _straight(self, ids: Array, tool: Array) -> None:
        """One step of the joints along straight lines, of tools at (n, 3)."""
        free = P.norm(self.command[ids, :3] - tool) < self.lead[ids]
        rows = ids[free]
        if len(rows):
            distance = self.speed[rows] * self._dt
            self.command[rows] = P.step_toward(self.command[rows], self.target[rows], distance, TURN_RATE * distance)
        keys = self.env.streams.episode_seed[ids]
        command = self.command[ids]
        if self._sag is not None:
            there = P.norm(self.target[ids, :3] - command[:, :3]) < 1e-6
            self._sag.learn(ids[there], (command[:, :3] - tool)[there])
            command[:, :3] += self._sag.offset[ids]
        found = self.solver.solve(command, self._base(ids), self.joints[ids], random_restarts=0, rng_seeds=keys)
        self.stuck[ids] = ~found.converged
        if self._detour.any() or not found.converged.all():
            self._around(ids)
        own = found.converged & ~self._detour[ids]
        self.joints[ids[own]] = found.joint_pos[own]

    def _around(self, ids: Array) -> None:
        """Where a straight line runs into the limit of a joint: joint by joint to another posture at its end."""
        self._stalled[ids] = np.where(self.stuck[ids], self._stalled[ids] + 1, 0)
        lost = (self._stalled[ids] >= STALLED) & ~self._detour[ids]
        if lost.any():
            rows, begun = ids[lost], np.repeat(self.chain.initial[None], int(lost.sum()), axis=0)
            found = self.solver.solve(
                self.target[rows],
                self._base(rows),
                begun,
                random_restarts=0,
                rng_seeds=self.env.streams.episode_seed[rows],
            )
            won = rows[found.converged]
            self._way[won], self._detour[won], self._stalled[rows] = found.joint_pos[found.converged], True, 0
        on = self._detour[ids]
        if not on.any():
            return
        rows = ids[on]
        step = DETOUR_SPEED * np.minimum(self.chain.velocity_limit, 10.0) * self._dt
        left = self._way[rows] - self.joints[rows]
        share = np.minimum(1.0, 1.0 / np.maximum((np.abs(left) / step).max(axis=1), 1e-9))
        self.joints[rows] += share[:, None] * left
        self.command[rows] = self.target[rows]  # the line goes on from its end
        self._detour[rows] = share < 1.0


def planned_moves(arms: Sequence[Arm], planner: str, latency: Latency) -> PlannedMoves:
    """Moves of one arm, or of several that move at once, planned from now on."""
    env = arms[0].env
    planned = [PlannedArm(a.robot.name, a.tool.name.partition(".")[2], a.solver, a.joints) for a in arms]
    made = PlannedMoves(env, planner_of(env, planner), latency, planned)
    for place, arm in enumerate(arms):
        arm.moves[made] = place
    return made


def _aperture(env: TaskEnv, robot: RobotView, gripper: str) -> float:
    channel, joints = robot.channel(gripper), env.engine.world.joints
    fingers = [joints[j] for j in channel.joints]
    if channel.opened is None or any(finger.type is not JointType.PRISMATIC for finger in fingers):
        return float("inf")
    ends = zip(channel.opened, fingers, strict=False)
    return float(sum(abs(opened - finger.lower) for opened, finger in ends))

"""Planned moves of arms: a question to the planner, the wait for its answer, and the way along the trajectory.

An answer takes effect a fixed number of control steps after its question, by the env's own clock; a loop that is there
earlier waits. So what an env does depends on no other env, nor on the number of workers.
"""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from time import perf_counter
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.planning.motion import Attachment, PlanAnswer, PlanRequest, PlanStatus, Scenes, ToolGoal, Trajectory
from anysim.planning.service import PlanFuture
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase
from anysim.task.env import TaskEnv
from anysim.task.scene import ObjectView
from anysim_skills.planned_arms import PlannedArm, PlannedArms
from anysim_skills.planning import REALTIME, EnvPlanner, Latency

PADDING = 0.01
"""[m] kept from obstacles: more than an arm strays from its trajectory."""
VELOCITY_SCALE = 0.5
DEADLINE = 20.0
"""[s] only a net: searches are bounded by their own counts."""
TOLERANCE = (5e-4, 5e-3)
"""[m], [rad] of the goals."""
LAG = 0.15
"""[rad] an arm may be behind what it is told; the trajectory then waits for it."""
NEAR = 0.02
"""[rad] from the end of a trajectory at which the arm has arrived."""
PLANNED_STEPS = 500
"""Control steps that a planned move may take; the planner's limits end it long before."""
PATIENCE = 50
"""Control steps without getting on after which the controller has not followed."""


class Stage(IntEnum):
    """How the planned move of an env stands."""

    NONE = 0
    PLANNING = 1
    FOLLOWING = 2
    ARRIVED = 3
    FAILED = 4


class Way(NamedTuple):
    """What a move is to lead to.

    Attributes:
        goals: (A, G, 7) tool poses of each arm; several arms take the same one of the G.
        then: (A, S, 7) the ends of straight lines after the move that have to be free too, or None.
        touched: the entity that the robots may touch on those lines, or None.
        settled: the posture at the goal is not to be changed any more.
    """

    goals: Array
    then: Array | None
    touched: str | None
    settled: bool = False


@dataclass(eq=False)
class Question:
    """What was asked for one env.

    Attributes:
        future: of the answer.
        scenes: the scene that it was asked in.
        due: the control step of the episode at which the answer takes effect; None: when it is ready.
        way: what for.
    """

    future: PlanFuture
    scenes: Scenes
    due: int | None
    way: Way


class PlannedMoves:
    """The planned moves of one arm, or of several that move at once, in all envs.

    Several arms have one plan, in which none of them hits another, and keep pace along it.

    Attributes:
        stage: (N,) of `Stage`.
        failure: (N,) index into OUTCOMES, where the stage is FAILED.
        goal: (N, A, 7) the tool poses that were chosen of the goals.
    """

    def __init__(self, env: TaskEnv, planner: EnvPlanner, latency: Latency, arms: Sequence[PlannedArm]) -> None:
        if latency == REALTIME:
            warnings.warn(
                "plans take effect once they are ready (latency: realtime): what is recorded replays, but the run "
                "cannot be repeated; a number of control steps as latency makes it so",
                stacklevel=2,
            )
        self.planner, self.latency = planner, latency
        self._env, self._arms = env, PlannedArms(env, arms)
        n = env.num_envs
        self.stage, self.failure = np.zeros((2, n), dtype=np.int64)
        self.goal = np.zeros((n, len(arms), 7))
        self._questions: dict[int, Question] = {}
        self._paths: dict[int, Array] = {}
        """(S, K) for each env that follows one: where the joints are told to be in each control step."""
        self._row, self._waited, self._asked = np.zeros((3, n), dtype=np.int64)
        self._moved, self._led = np.full(n, -1), np.zeros(n, dtype=bool)
        """The control step of the last `move`, and what it said."""

    def describe(self) -> dict[str, object]:
        """For records."""
        return {"name": self.planner.name, "version": self.planner.version, "latency": self.latency}

    def renew(self, ids: Array) -> None:
        """These envs have just been reset."""
        self.drop(ids)
        self._asked[ids], self._moved[ids] = 0, -1

    def drop(self, ids: Array) -> None:
        """Something else moves the arms in these envs from here on."""
        for i in ids[self.stage[ids] != Stage.NONE].tolist():
            if (question := self._questions.pop(i, None)) is not None:
                question.future.cancel()
            self._paths.pop(i, None)
            self.stage[i] = Stage.NONE

    def ask(
        self,
        ids: Array,
        goals: Sequence[Array],
        held: ObjectView | None,
        then: Array | None,
        touched: ObjectView | None,
    ) -> None:
        """Plan in these envs; the skill that asks sees to it that the service is flushed, as `MovingSkill.act` does.

        Args:
            ids: the envs.
            goals: of each env the goal sets (A, G, 7) of its arms.
            held: what is in the hand of the first arm; see `Arm.plan`.
            then: (n, A, S, 7), or None.
            touched: see `Arm.plan`.
        """
        self.drop(ids)
        holding, touching = _present(held, ids), _present(touched, ids)
        begin = np.clip(self._arms.told(ids), self._arms.lower, self._arms.upper)
        for row, i in enumerate(ids.tolist()):
            sets = np.array(goals[row])
            request = PlanRequest(
                self._arms.joint_names,
                begin[row],
                tuple(
                    ToolGoal(arm.robot, arm.tool, poses, (1.0, 1.0, 1.0), *TOLERANCE)
                    for arm, poses in zip(self._arms.arms, sets, strict=True)
                ),
                attached=(self._attached(i, holding[i]),) if i in holding else (),
                padding=PADDING,
                velocity_scale=VELOCITY_SCALE,
                seed=self._seed(i),
                deadline=DEADLINE,
            )
            lines = None if then is None else then[row].copy()
            self._submit(i, request, Way(sets, lines, touching.get(i)))
        self.stage[ids] = Stage.PLANNING

    def _submit(self, env: int, request: PlanRequest, way: Way) -> None:
        scene = self._env.scene
        scenes = self.planner.scenes(scene.state.body_pose[env], scene.presence[env])
        future = self.planner.service.submit(request, scenes.scene(0), env=env, latency=None)
        due = int(scene.elapsed[env]) + self.latency if isinstance(self.latency, int) else None
        self._questions[env] = Question(future, scenes, due, way)

    def _seed(self, env: int) -> int:
        """Of the next question: it depends on the episode, and on how many were asked in it."""
        key = [int(self._env.streams.episode_seed[env]), int(self._asked[env])]
        self._asked[env] += 1
        return int(np.random.SeedSequence(key).generate_state(1)[0])

    def _attached(self, env: int, entity: str) -> Attachment:
        world, pose = self._env.engine.world, self._env.scene.state.body_pose[env]
        root, holder = world.entities[world.entity_numbers[entity]].root, self._arms.holder
        offset = P.compose(P.inverse(pose[holder]), pose[root])
        return Attachment(entity, world.bodies[holder].name, offset)

    # ------------------------------------------------------------------ what skills ask

    def said(self, ids: Array) -> Array:
        """(n,) STAY while a move is planned or followed, GO_ON where it has arrived, else its failure in OUTCOMES."""
        stage = self.stage[ids]
        failed = np.where(stage == Stage.FAILED, self.failure[ids], STAY)
        return np.where(stage == Stage.ARRIVED, GO_ON, failed)

    def phase(self, ask: Callable[[Array, Array], None]) -> Phase:
        """A phase that begins with `ask`, which asks for envs and their rows, and ends where the move does."""
        return Phase("plan", ask, lambda ids, _: self.said(ids), PLANNED_STEPS)

    # ------------------------------------------------------------------ moving

    def move(self, ids: Array) -> Array:
        """Tell the joints where to be in this control step; (n,) bool: in which envs that was told.

        Each of several arms asks; the first of them in a control step moves all.
        """
        step = self._env.scene.elapsed[ids]
        fresh = self._moved[ids] != step
        self._moved[ids] = step
        self._advance(ids[fresh])
        return self._led[ids]

    def _advance(self, ids: Array) -> None:
        for i in ids[self.stage[ids] == Stage.PLANNING].tolist():
            question = self._questions[i]
            if question.future.done if question.due is None else self._env.scene.elapsed[i] >= question.due:
                self._answered(i)
        self._led[ids] = np.isin(self.stage[ids], (Stage.PLANNING, Stage.FOLLOWING))
        following = ids[self.stage[ids] == Stage.FOLLOWING]
        if len(following):
            actual = self._env.scene.state.joint_pos[np.ix_(following, self._arms.numbers)]
            lag = np.abs(self._arms.told(following) - actual).max(axis=1)
            for i, behind in zip(following.tolist(), lag.tolist(), strict=True):
                self._follow(i, behind)

    def _follow(self, env: int, lag: float) -> None:
        path, row = self._paths[env], int(self._row[env])
        self._waited[env] += 1
        if row < len(path) and lag < LAG:
            self._arms.tell(env, path[row])
            self._row[env], self._waited[env] = row + 1, 0
        elif row >= len(path) and lag < NEAR:
            self.stage[env] = Stage.ARRIVED
        elif self._waited[env] > PATIENCE:
            self._fail(env, Outcome.CONTROLLER)

    def _fail(self, env: int, why: Outcome) -> None:
        self.stage[env], self.failure[env] = Stage.FAILED, OUTCOMES.index(why)

    # ------------------------------------------------------------------ answers

    def _answered(self, env: int) -> None:
        """Follow the answer, if there is one that still holds; ask again where only the padding was in the way."""
        question = self._questions.pop(env)
        answer, request = self._wait(question.future), question.future.request
        if answer.status is PlanStatus.START_IN_COLLISION and request.padding:
            self._submit(env, replace(request, padding=0.0), question.way)
            return
        why = self._judged(env, question, answer)
        if why is None and question.way.then is not None and answer.trajectory is not None:
            why = self._after(env, question, answer.trajectory.joint_pos[-1])
            if why is not None and self._otherwise(env, question, answer):
                return
        if why is not None or answer.trajectory is None:
            self._fail(env, why or Outcome.NO_PATH)
            return
        self._paths[env] = self._told(answer.trajectory)
        self._row[env] = self._waited[env] = 0
        chosen = answer.chosen[0] if answer.chosen else 0
        self.goal[env], self.stage[env] = question.way.goals[:, chosen], Stage.FOLLOWING

    def _otherwise(self, env: int, question: Question, answer: PlanAnswer) -> bool:
        """Whether a posture at the chosen goal from which the lines can be gone is there, and now asked for."""
        request, way = question.future.request, question.way
        if way.settled:
            return False
        chosen, scene = way.goals[:, answer.chosen[0]], question.scenes.scene(0)
        postures = self._arms.postures(env, chosen, request.seed)
        for posture in postures[np.argsort(np.abs(postures - request.start).max(axis=1), kind="stable")]:
            free = self.planner.checker.is_free(request, scene, posture[None])
            if free and self._after(env, question, posture) is None:
                wanted = replace(request, goals=(), joint_goal=posture, seed=self._seed(env))
                self._submit(env, wanted, way._replace(goals=chosen[:, None], settled=True))
                return True
        return False

    def _told(self, trajectory: Trajectory) -> Array:
        """(S, K) what the joints are told in each control step: ahead by what their drives stay behind."""
        dt = self._env.engine.world.physics.control_dt
        steps = dt * np.arange(1, int(np.ceil(trajectory.times[-1] / dt)) + 1)
        position, velocity = (
            np.column_stack([np.interp(steps, trajectory.times, column) for column in rows.T])
            for rows in (trajectory.joint_pos, trajectory.joint_vel)
        )
        return np.clip(position + self._arms.behind * velocity, self._arms.lower, self._arms.upper)

    def _wait(self, future: PlanFuture) -> PlanAnswer:
        """The answer; one that is late is waited for and counted."""
        service, late, begun = self.planner.service, not future.done, perf_counter()
        answer = future.result()
        if late:
            service.counts.late += 1
            service.counts.waited += perf_counter() - begun
        service.harvest(0)  # what is answered need not be kept
        return answer

    def _judged(self, env: int, question: Question, answer: PlanAnswer) -> Outcome | None:
        """Why an answer is of no use; None where it is."""
        if answer.status is PlanStatus.NO_IK:
            return Outcome.COLLISION if self._arms.reach(env, question.way.goals) else Outcome.NO_IK
        if answer.status is not PlanStatus.OK or answer.trajectory is None:
            return _OUTCOMES.get(answer.status, Outcome.NO_PATH)
        request, path = question.future.request, answer.trajectory.joint_pos
        scenes, state = question.scenes, self._env.scene.state
        scenes.update(state.body_pose[env][None], self._env.scene.presence[env][None])
        stale = scenes.is_stale(0, answer) and not self.planner.checker.is_free(request, scenes.scene(0), path)
        return Outcome.NO_PATH if stale else None

    def _after(self, env: int, question: Question, joints: Array) -> Outcome | None:
        """Why the straight lines from joint positions (K,) to the poses after the move cannot be gone."""
        assert question.way.then is not None
        rows = self._arms.lines(env, joints, question.way.then)
        if rows is None:
            return Outcome.NO_IK
        touched = question.way.touched
        touching = () if touched is None else tuple((arm.robot, touched) for arm in self._arms.arms)
        request = replace(question.future.request, allowed=touching, padding=0.0)
        free = self.planner.checker.is_free(request, question.scenes.scene(0), rows)
        return None if free else Outcome.COLLISION


def _present(thing: ObjectView | None, ids: Array) -> dict[int, str]:
    """For each of these envs the name of the entity that an object is."""
    found = () if thing is None else thing.by_entity(ids)
    return {int(i): entity.name for entity, own in found for i in own}


_OUTCOMES = {PlanStatus.START_IN_COLLISION: Outcome.COLLISION, PlanStatus.TIMEOUT: Outcome.TIMEOUT}
"""What a planner's failures are for a skill; every other one is that there is no path."""

"""Planners with one defect each; the docstring names the test of the planners' suite that must find it."""

from dataclasses import replace

import numpy as np

from anysim.planning.motion import Budget, PlanAnswer, PlanStatus
from anysim_planning.rrt import RrtPlanner


class ThroughWalls(RrtPlanner):
    """test_paths.py::test_the_way_around_a_wall"""

    def plan(self, request, scene, budget):
        present = scene.present.copy()
        present[self.world.entity_numbers["wall"]] = False
        return super().plan(request, scene._replace(present=present), budget)


class KeepsNoDistance(RrtPlanner):
    """test_paths.py::test_padding_is_kept"""

    def plan(self, request, scene, budget):
        return super().plan(replace(request, padding=0.0), scene, budget)


class AllowsAll(RrtPlanner):
    """test_paths.py::test_allowed_pairs_may_touch"""

    def plan(self, request, scene, budget):
        allowed = (("arm", "wall"),) if request.allowed else ()
        return super().plan(replace(request, allowed=allowed), scene, budget)


class Blind(RrtPlanner):
    """test_paths.py::test_what_is_not_there"""

    def is_free(self, request, scene, joint_pos):
        return True


class NeverGivesUp(RrtPlanner):
    """test_paths.py::test_no_way_at_all"""

    def plan(self, request, scene, budget):
        answer = super().plan(request, scene, budget)
        return replace(answer, status=PlanStatus.FAILED) if answer.status is PlanStatus.NO_PATH else answer


class TooFast(RrtPlanner):
    """test_paths.py::test_limits_of_joints_are_kept"""

    def plan(self, request, scene, budget):
        answer = super().plan(request, scene, budget)
        if answer.trajectory is None:
            return answer
        times, _, velocity = answer.trajectory
        faster = answer.trajectory._replace(times=times / 1.3, joint_vel=velocity * 1.3)
        return replace(answer, trajectory=faster)


class ChoosesTheFirst(RrtPlanner):
    """test_goals.py::test_a_goal_set"""

    def plan(self, request, scene, budget):
        answer = super().plan(request, scene, budget)
        return replace(answer, chosen=(0,) * len(answer.chosen))


class PairsNothing(RrtPlanner):
    """test_goals.py::test_paired_tools"""

    def plan(self, request, scene, budget):
        return super().plan(replace(request, pairing="independent"), scene, budget)


class Bows(RrtPlanner):
    """test_goals.py::test_a_straight_line"""

    def plan(self, request, scene, budget):
        return super().plan(replace(request, straight=None), scene, budget)


class DropsWhatIsHeld(RrtPlanner):
    """test_goals.py::test_a_held_object"""

    def plan(self, request, scene, budget):
        return super().plan(replace(request, attached=()), scene, budget)


class HoldsElsewhere(RrtPlanner):
    """test_goals.py::test_a_held_object"""

    def plan(self, request, scene, budget):
        shift = np.array([0.0, 0.0, -0.25, 0.0, 0.0, 0.0, 0.0])
        held = tuple(one._replace(offset=one.offset + shift) for one in request.attached)
        return super().plan(replace(request, attached=held), scene, budget)


class Remembers(RrtPlanner):
    """test_answers.py::test_an_answer_depends_on_its_request_alone"""

    count = 0

    def plan(self, request, scene, budget):
        self.count += 1
        return super().plan(replace(request, seed=request.seed + self.count), scene, budget)


class HasNoClock(RrtPlanner):
    """test_answers.py::test_a_deadline_ends_a_search"""

    def plan(self, request, scene, budget):
        return super().plan(request, scene, Budget(1e9))


class CannotBeStopped(HasNoClock):
    """test_answers.py::test_a_cancelled_search_ends"""


class ForgetsTheScene(RrtPlanner):
    """test_answers.py::test_an_answer_says_where_it_comes_from"""

    def plan(self, request, scene, budget):
        return replace(super().plan(request, scene, budget), world_version=0)


class BesideThePose(RrtPlanner):
    """test_ik.py::test_joint_positions"""

    def plan(self, request, scene, budget):
        answer = super().plan(request, scene, budget)
        return answer if answer.joint_pos is None else replace(answer, joint_pos=answer.joint_pos + 0.001)


class ReachesThroughWalls(ThroughWalls):
    """test_ik.py::test_joint_positions"""


class TurnsBeyondItsLimits(RrtPlanner):
    """test_ik.py::test_joint_positions"""

    def plan(self, request, scene, budget):
        answer = super().plan(request, scene, budget)
        if answer.joint_pos is None:
            return answer
        turned = answer.joint_pos.copy()
        turned[0] += 2 * np.pi
        return replace(answer, joint_pos=turned)


class WantsAFreeStart(RrtPlanner):
    """test_ik.py::test_a_start_in_collision"""

    def plan(self, request, scene, budget):
        if not request.path and not self.is_free(request, scene, request.start[None]):
            return PlanAnswer(PlanStatus.START_IN_COLLISION, message="it begins in a collision")
        return super().plan(request, scene, budget)


class MixesAnswers(RrtPlanner):
    """test_ik.py::test_many_together"""

    def plan_all(self, requests, scenes, budgets):
        return super().plan_all(requests, scenes, budgets)[::-1]


class PairsNoPostures(PairsNothing):
    """test_ik.py::test_two_tools"""

"""Pick and insert: grasp a peg near its head, and put it into a hole."""

from typing import Annotated

from pydantic import Field

from anysim.skills.base import Outcome
from anysim.skills.sequence import SkillSequence
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, ObjectView, RobotView
from anysim_skills.grasping.bank_files import refuse_counts
from anysim_skills.grasping.banked import BankFile, CountsFolder, Pinned
from anysim_skills.grasping.grasp import Force, Grasp, Metres, Offset, Speed
from anysim_skills.insertion.insert import Insert, InsertionsFile


class PickInsert(SkillSequence):
    """Grasp `object` with `robot`, and put it into the hole; what falls is grasped again."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        object: ObjectView,
        tip: Frame,
        hole: Frame,
        mouth: Frame,
        tool: str = "tool",
        solver: str = "numba_ik",
        offset: Offset = (0.0, 0.0, 0.0),
        hover: Metres = 0.1,
        speed: Speed = 0.4,
        force: Force = None,
        symmetry: Annotated[int, Field(ge=1, description="turns about the axis in which the object fits")] = 4,
        max_attempts: Annotated[int, Field(ge=1)] = 3,
        bank: BankFile = None,
        living: CountsFolder = None,
        pinned: Pinned = "",
        insertions: InsertionsFile = None,
        pinned_insertions: Pinned = "",
    ) -> None:
        """`bank` is of grasps, `insertions` of turns in which the object goes into the hole; `living` is of both."""
        arm = {"robot": robot, "object": object, "tool": tool, "solver": solver, "speed": speed}
        keys = ("insertions", "pinned_insertions")
        if insertions is None:
            refuse_counts(bank, living, "", ("bank` or `insertions", ""))
        known = {"bank": bank, "living": living if bank else None, "pinned": pinned}
        into = {"bank": insertions, "living": living if insertions else None, "pinned": pinned_insertions}
        insert = Insert(env, keys, **arm, **into, tip=tip, hole=hole, mouth=mouth, symmetry=symmetry)
        members = {
            "grasp": Grasp(env, insert, **arm, **known, force=force, offset=offset, hover=hover, lift=0.0),
            "insert": insert,
        }
        again = {("insert", why): "grasp" for why in (Outcome.UNSTABLE_GRASP, Outcome.LOST)}
        super().__init__(env, members, back=again, max_attempts=max_attempts)

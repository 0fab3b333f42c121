"""Tidy: several objects, one after the other, into places in a row on something."""

from collections.abc import Sequence
from typing import Annotated

from pydantic import Field

from anysim.errors import NameLookupError, SpecError, SpecIssue
from anysim.skills.sequence import SkillSequence
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, ObjectView, RobotView
from anysim_skills.grasping.grasp import Force, Metres, Speed
from anysim_skills.grasping.pick_place import PickPlace
from anysim_skills.grasping.spot import Spot

Names = Annotated[tuple[str, ...], Field(description="names of objects")]
Objects = Annotated[tuple[str, ...], Field(min_length=1, description="names of objects, first one first")]


class Tidy(SkillSequence):
    """Put `objects` down on `target` with `robot`, in a row along its y, the first at its negative end."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        objects: Objects,
        target: Frame,
        spacing: Annotated[float, Field(gt=0, description="[m] from one object to the next")] = 0.12,
        tool: str = "tool",
        solver: str = "numba_ik",
        hover: Metres = 0.1,
        speed: Speed = 0.4,
        force: Force = None,
        above: Annotated[float, Field(gt=0, description="[m] over the place on the way there and back")] = 0.1,
        tolerance: Annotated[float, Field(gt=0, description="[m] horizontally, once it rests")] = 0.03,
        max_attempts: Annotated[int, Field(ge=1, description="for each object")] = 3,
    ) -> None:
        arm = {"robot": robot, "tool": tool, "solver": solver, "hover": hover, "speed": speed}
        pace = {"above": above, "tolerance": tolerance, "max_attempts": max_attempts, "force": force}
        members: dict[str, PickPlace] = {}
        for number, thing in enumerate(handles(env, objects)):
            spot = Spot(target, 0.0, spacing * (number - (len(objects) - 1) / 2))
            members[thing.name] = PickPlace(env, **arm, **pace, object=thing, target=spot)
        super().__init__(env, members)


def handles(env: TaskEnv, names: Sequence[str], key: str = "objects") -> list[ObjectView]:
    """The objects of these names, which a file has at `key`.

    Raises:
        SpecError: at `<key>.<number>`, a name that is not that of an object, or that comes twice.
    """
    found: list[ObjectView] = []
    for number, name in enumerate(names):
        try:
            found.append(ObjectView(env.scene, name))
        except NameLookupError as error:
            raise SpecError([SpecIssue("", f"{key}.{number}", str(error))]) from None
        if name in names[:number]:
            raise SpecError([SpecIssue("", f"{key}.{number}", f"'{name}' is named twice; name each object once")])
    return found

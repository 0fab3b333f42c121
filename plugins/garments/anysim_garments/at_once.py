"""AtOnce: skills of different arms at the same time, until all have ended well or one has failed."""

from collections.abc import Mapping

import numpy as np

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.skills.base import Skill
from anysim.skills.phases import GO_ON, STAY, MovingSkill
from anysim.task.env import TaskEnv


class AtOnce(MovingSkill):
    """Skills of which each moves what no other moves, all at once.

    What has succeeded waits for the others. The first failure ends it, with the type of that failure.
    """

    phases = ("at once",)

    def __init__(self, env: TaskEnv, members: Mapping[str, MovingSkill]) -> None:
        """Raises TaskError where two members move the same thing."""
        super().__init__(env)
        self.members = dict(members)
        self.movers = tuple(mover for member in self.members.values() for mover in member.movers)
        if len(set(self.movers)) < len(self.movers):
            raise TaskError(
                f"{' and '.join(self.members)} cannot be done at once: they move the same arm; name two robots, or a "
                f"tool of each arm"
            )

    def start(self, env_ids: Array) -> None:
        Skill.begin(self, env_ids)
        for member in self.members.values():
            member.start(env_ids)

    def decide(self, ids: Array, at: Array) -> None:
        going = self.outcome[ids] == STAY
        done = np.ones(len(ids), dtype=bool)
        for member in self.members.values():
            here = going & (member.outcome[ids] == STAY)
            if here.any():
                member.decide(ids[here], at[here])
            said = member.outcome[ids]
            done &= said == GO_ON
            failed = going & (said > GO_ON) & (self.outcome[ids] == STAY)
            self.outcome[ids[failed]] = said[failed]
        self.outcome[ids[going & done]] = GO_ON

    def history(self, env: int) -> tuple[tuple[str, str], ...]:
        return tuple(climb for member in self.members.values() for climb in member.history(env))

    def moment(self, env: int) -> tuple[int, ...]:
        return *super().moment(env), *(n for member in self.members.values() for n in member.moment(env))

    def about(self, env: int) -> dict[str, object]:
        return {key: value for member in self.members.values() for key, value in member.about(env).items()}

    def describe(self, env: int) -> dict[str, object]:
        """`phase` names that of each member."""
        now = {name: member.describe(env)["phase"] for name, member in self.members.items()}
        return super().describe(env) | {"phase": ", ".join(f"{name}: {phase}" for name, phase in now.items())}

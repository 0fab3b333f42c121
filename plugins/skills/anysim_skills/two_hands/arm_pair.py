"""Two arms that move at once: one plan for both, in which neither hits the other, and one pace along it."""

from collections.abc import Callable, Sequence
from typing import Self

from anysim.conventions import Array
from anysim.errors import TaskError, listing
from anysim.skills.phases import Phase
from anysim.task.scene import ObjectView
from anysim_skills.arm import Arm, planned_moves
from anysim_skills.env_lifetime import PerEnv
from anysim_skills.planning import LATENCY, Latency

_PAIRS: PerEnv[tuple[Arm, Arm], "ArmPair"] = PerEnv()


class ArmPair:
    """Planned moves of two arms of an env. Each is moved by its own arm, so both are among a skill's movers.

    Attributes:
        arms: whose moves they are.
        plans: what plans and follows.
    """

    def __init__(self, arms: tuple[Arm, Arm], planner: str, latency: Latency) -> None:
        """As of `of`."""
        shared = set(arms[0].chain.joint_names) & set(arms[1].chain.joint_names)
        if shared:
            raise TaskError(
                f"moves of '{arms[0].tool.name}' and '{arms[1].tool.name}' cannot be planned at once: both move "
                f"{listing(sorted(shared))}; give the skill no planner, or tools that share no joint"
            )
        self.arms, self.plans = arms, planned_moves(arms, planner, latency)

    @classmethod
    def of(cls, first: Arm, second: Arm, planner: str, latency: Latency = LATENCY) -> Self:
        """The one of two arms, shared by all skills that move both.

        Raises:
            TaskError: the arms share a joint, or a skill plans moves of one of them otherwise.
            PluginError: no planner of that name is installed.
        """
        pair = _PAIRS.of(first.env, (first, second), lambda: cls((first, second), planner, latency))
        for arm in pair.arms:
            arm.agree(planner, latency)
        return pair  # pyright: ignore[reportReturnType]

    def plan(
        self,
        ids: Array,
        goals: Sequence[Array],
        *,
        held: ObjectView | None = None,
        then: Array | None = None,
        touched: ObjectView | None = None,
    ) -> None:
        """Move both at once, to the same one of their candidates; `plans.said` tells how that goes.

        Args:
            ids: the envs.
            goals: of each env the tool poses (2, G, 7) of the two arms, which belong together one by one.
            held: the object in the hand of the first arm, which is to hit nothing either.
            then: (n, 2, S, 7) the ends of straight lines of both after the move, on which nothing may be in the way
                but `touched`.
            touched: what the robots may touch on those lines.
        """
        for arm in self.arms:
            arm.stay(ids)
        self.plans.ask(ids, goals, held, then, touched)

    def planned_phase(self, ask: Callable[[Array, Array], None]) -> Phase:
        """A phase that begins with `ask`, which calls `plan` for envs and their rows, and ends where the move does."""
        return self.plans.phase(ask)

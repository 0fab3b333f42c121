"""Worth of success beside the rewards of each step: whether a learner does better by not succeeding."""

from collections.abc import Iterator

from anysim.task.contract import MOST
from anysim.task.term_registry import find
from anysim_schemas.task import TaskSpec

STEPS = 100
"""Control steps of reward that a learner with the usual discount of 0.99 looks ahead: 1 / (1 - 0.99)."""


def doubts(task: TaskSpec) -> Iterator[tuple[str, str]]:
    """The key to change and a sentence, where success ends the steps' rewards and is worth less than they are.

    Counted are terms that say how much they are `at_most`.
    """
    if task.on_success != "end" or not task.success:
        return
    steps = min(task.horizon, STEPS)
    bounds = [(term.weight, vars(find("reward", term.term)).get(MOST, 0.0)) for term in task.rewards.values()]
    gain = steps * sum(max(weight * most, 0.0) for weight, most in bounds)
    worth = sum(term.reward for term in task.success.values())
    if worth < gain:
        yield (
            "task.success",
            f"success is worth {worth:g} and ends rewards of up to {gain:g} in the {steps} steps that a learner with a "
            f"discount of 0.99 looks ahead, so that not to succeed can pay more; give a predicate of success `reward: "
            f"{gain - worth:g}` or more, or say `on_success: continue`",
        )

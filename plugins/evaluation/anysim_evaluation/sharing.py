"""Evaluations that workers of an executor share: some seeds at a time, logged by the one that asked."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from typing import Any, NamedTuple

from anysim.api import make
from anysim.task.env import TaskEnv
from anysim_evaluation.driver import Episode, drive
from anysim_evaluation.log import identity
from anysim_evaluation.policy import Policy, make_policy


class Question(NamedTuple):
    """What a worker evaluates, as `anysim.make`, `make_policy` and `drive` take it."""

    task: Any
    engine: Mapping[str, Any] | str | None
    num_envs: int
    overrides: tuple[str, ...]
    policy: str
    privileged: bool
    modality: tuple[str, ...] | None = None


class Answer(NamedTuple):
    """What came of some seeds: the engine, what the episodes depend on, and these."""

    engine: str
    what: dict[str, str]
    episodes: list[Episode]


class Answerer:
    """Answers questions for some seeds each. The env and the policy of the last question are kept for the next one."""

    def __init__(self) -> None:
        self._open: tuple[Question, TaskEnv, Policy] | None = None

    def prepare(self, question: Question) -> tuple[TaskEnv, Policy]:
        """The env and the policy.

        Raises:
            CapabilityError: the engine cannot run the task.
            TaskError: the policy is none for it.
        """
        if self._open is None or self._open[0] != question:
            self.close()
            asked = {"engine": question.engine, "num_envs": question.num_envs, "overrides": question.overrides}
            env = make(question.task, **asked)
            try:
                self._open = question, env, make_policy(env, question.policy)
            except BaseException:
                env.close()
                raise
        return self._open[1:]

    def answer(self, question: Question, seeds: tuple[int, ...]) -> Answer:
        """What came of these seeds."""
        env, policy = self.prepare(question)
        what = identity(env, question.policy, policy, question.privileged)
        episodes = list(drive(env, policy, seeds, privileged=question.privileged, groups=question.modality))
        return Answer(env.engine.name, what, episodes)

    def close(self) -> None:
        """Free the engine."""
        if self._open is not None:
            self._open[1].close()
            self._open = None


@contextmanager
def answering() -> Iterator[Callable[[Question, tuple[int, ...]], Answer]]:
    """What answers a question for some seeds."""
    with closing(Answerer()) as answerer:
        yield answerer.answer


def portions(seeds: Sequence[int], size: int) -> list[tuple[int, ...]]:
    """Seeds in portions, in order; an empty one where there are none, which says what would have been evaluated."""
    return [tuple(seeds[begin : begin + size]) for begin in range(0, len(seeds), size)] or [()]

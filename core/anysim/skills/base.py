"""The contract of a skill: phases, typed outcomes, one row of state for each env, and nothing but actions."""

from abc import ABC, abstractmethod
from enum import StrEnum

import numpy as np

from anysim.conventions import Array
from anysim.task.env import TaskEnv


class Outcome(StrEnum):
    """How a skill stands or ended. The words are the same for all skills, so that failures can be counted."""

    RUNNING = "running"
    OK = "ok"
    NO_IK = "no_ik"
    COLLISION = "collision"
    MISSED_CONTACT = "missed_contact"
    UNSTABLE_GRASP = "unstable_grasp"
    TIMEOUT = "timeout"
    CONTROLLER = "controller"
    ADVERSE_STATE = "adverse_state"
    NO_PATH = "no_path"
    WRONG_OBJECT = "wrong_object"
    JAMMED = "jammed"
    LOST = "lost"
    UNREACHABLE_BASE = "unreachable_base"


OUTCOMES = tuple(Outcome)
_WORDS = tuple(map(str, OUTCOMES))


class Skill(ABC):
    """A state machine over a batch: each env is in a phase of its own. Keyword-only arguments are the YAML parameters.

    Attributes:
        phases: the names of the phases.
        phase: (N,) index of each env's phase.
        outcome: (N,) index into OUTCOMES.
        attempts: (N,) how often the env has started the skill anew, 1 at first.
    """

    phases: tuple[str, ...]

    def __init__(self, env: TaskEnv) -> None:
        self.env = env
        self.phase = np.zeros(env.num_envs, dtype=np.int64)
        self.outcome = np.zeros(env.num_envs, dtype=np.int64)
        self.attempts = np.ones(env.num_envs, dtype=np.int64)

    def begin(self, env_ids: Array) -> None:
        """Start in these envs, which have just been reset."""
        self.phase[env_ids] = 0
        self.outcome[env_ids] = 0
        self.attempts[env_ids] = 1

    @abstractmethod
    def act(self, env_ids: Array, action: Array) -> None:
        """Write the rows `env_ids` of the action (N, A) for the next control step, and move on between phases.

        Reads live state only; never writes state. May set `outcome` of a row, which ends the skill there.
        """

    def moment(self, env: int) -> tuple[int, ...]:
        """Numbers that change whenever `describe` says something else; empty if that cannot be told."""
        del env
        return ()

    def describe(self, env: int) -> dict[str, object]:
        """What an env is doing, for records and tables."""
        return {
            "phase": self.phases[self.phase[env]],
            "outcome": _WORDS[self.outcome[env]],
            "attempt": int(self.attempts[env]),
        }

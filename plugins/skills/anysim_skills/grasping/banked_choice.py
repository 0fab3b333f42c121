"""Candidates of a bank in all envs: which is chosen, which were given up, and what became of them.

Where outcomes are kept, an episode counts for the candidate that was last carried out, and against the one before where
it is begun anew.
"""

import numpy as np

from anysim.conventions import Array
from anysim.task.contract import Status
from anysim.task.env import TaskEnv
from anysim.task.scene import ObjectView
from anysim_skills.grasping.bank_files import Banks
from anysim_skills.grasping.outcomes import OUTCOMES

ALIKE = 0.8
"""Of the best score: what is better than that is as good, and the nearest of those is taken."""


class BankedChoice:
    """Candidates of `object`, of which at most `goals` are a goal set.

    Attributes:
        banks: where they come from.
        number: (N,) the chosen candidate of each env, -1: none.
    """

    def __init__(self, env: TaskEnv, object: ObjectView, banks: Banks, goals: int) -> None:
        self._env, self._object, self.banks = env, object, banks
        n, count = env.num_envs, banks.score.shape[1]
        self.number, self._closed = np.full((2, n), -1)
        self._entity = np.zeros(n, dtype=np.int64)
        self._given_up = np.zeros((n, count), dtype=bool)
        self._page, self._left = np.zeros((n, min(goals, count)), dtype=np.int64), np.zeros(n, dtype=np.int64)
        OUTCOMES.watch(env, self)

    @property
    def goal_count(self) -> int:
        """How many candidates a goal set has."""
        return self._page.shape[1]

    def offer(self, ids: Array, score: Array) -> tuple[Array, Array]:
        """The goal sets of these envs by scores (n, G): candidates (n, g), best first, and (n, g) their scores.

        Those that do not fit, or were given up, have the score of minus infinity.
        """
        score[self._given_up[ids]] = -np.inf
        page = np.argsort(-score, axis=1, kind="stable")[:, : self._page.shape[1]]
        self._page[ids], self._left[ids] = page, np.isfinite(score).sum(axis=1)
        return page, score[np.arange(len(ids))[:, None], page]

    def alike(self, ids: Array, fit: Array) -> Array:
        """(n, g) bool: those of the goal sets that fit (n, g) and are as good as the best that does."""
        score = np.where(fit, self.banks.score[self.which(ids)[:, None], self._page[ids]], -np.inf)
        return fit & (score >= ALIKE * score.max(axis=1, keepdims=True))

    def choose(self, ids: Array, place: Array, reachable: Array) -> None:
        """Take the candidates at these places (n,) of the goal sets; none where nothing is reachable (n,) bool."""
        self.number[ids] = np.where(reachable, self._page[ids, place], -1)

    def closed(self, ids: Array) -> None:
        """The chosen candidates are carried out: fingers close in them."""
        self._closed[ids], self._entity[ids] = self.number[ids], self.which(ids)

    def start(self, ids: Array) -> None:
        """It is begun; where a candidate was carried out in this episode before, it did not hold."""
        self._failed(ids[self._closed[ids] >= 0])

    def give_up(self, env: int) -> bool:
        """Give the chosen candidate up, or all of the goal set if none could be reached; False if no other is left."""
        tried = self._page[env] if self.number[env] < 0 else self.number[env : env + 1]
        self._given_up[env, tried] = True
        self._failed(np.array([env])[self._closed[env : env + 1] >= 0])
        return bool(self._left[env] > len(tried))

    def again(self, ids: Array | int) -> None:
        """All candidates may be chosen again in these envs."""
        self._given_up[ids] = False

    def about(self, env: int) -> dict[str, object]:
        """Which candidate of which bank this is, for records."""
        return {self.banks.keys[0]: self.banks.about | {"candidate": int(self.number[env])}}

    def which(self, ids: Array) -> Array:
        """(n,) which of the entities that it can be the object is."""
        if len(self._object.entities) == 1:
            return np.zeros(len(ids), dtype=np.int64)
        return np.argmax(self._env.scene.presence[ids][:, self._object.slot.entities], axis=1)

    # ------------------------------------------------------------------ episodes, as an observer sees them

    def begun(self, ids: Array) -> None:
        """Episodes begin in these envs; those before them that were left early have failed."""
        self._failed(ids[self._closed[ids] >= 0])
        self._given_up[ids], self.number[ids] = False, -1

    def ended(self, ids: Array) -> None:
        """Episodes have ended in these envs."""
        own = ids[self._closed[ids] >= 0]
        won = self._env.status[own] == Status.SUCCESS
        self._note(own[won], success=True)
        self._failed(own[~won])

    def _failed(self, ids: Array) -> None:
        self._given_up[ids, self._closed[ids]] = True
        self._note(ids, success=False)

    def _note(self, ids: Array, success: bool) -> None:
        for which, number in zip(self._entity[ids].tolist(), self._closed[ids].tolist(), strict=True):
            self.banks.note(which, number, success)
        self._closed[ids] = -1

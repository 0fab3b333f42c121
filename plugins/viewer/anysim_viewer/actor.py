"""Sources of actions in a view: none, the task's expert, or a policy by the name that `anysim evaluate` knows."""

import numpy as np

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.task.env import TaskEnv
from anysim_evaluation.policy import Judging, Policy, make_policy

NOTHING = "nothing"
EXPERT = "expert"


def names_of(env: TaskEnv, policy: str | None) -> tuple[str, ...]:
    """Who may act in an env, `policy` among them."""
    task = env.spec.task
    solved = env.spec.collect is not None or (task is not None and task.expert is not None)
    low, high = env.action_bounds
    bounded = env.action_dim > 0 and bool(np.isfinite([low, high]).all())
    found = [NOTHING, *([EXPERT] if solved else []), *(["random"] if bounded else [])]
    return tuple(dict.fromkeys([*found, *([] if policy is None else [policy])]))


class Actor:
    """Acts in all envs of an env, each on its own timeline.

    Attributes:
        name: of who acts.
    """

    def __init__(self, env: TaskEnv, name: str = NOTHING) -> None:
        """Raises what `anysim_evaluation.policy.make_policy` raises of a name that is none."""
        self._env, self.name = env, name
        self._policy: Policy | None = None if name == NOTHING else make_policy(env, name)
        self._still = np.clip(np.zeros(env.action_dim), *env.action_bounds)
        self._chunks: list[Array] = [np.zeros((0, env.action_dim))] * env.num_envs

    def begin(self, env_ids: Array) -> None:
        """These envs have just begun an episode."""
        for i in env_ids.tolist():
            self._chunks[i] = self._chunks[i][:0]
        if self._policy is not None:
            self._policy.reset(env_ids)

    def act(self, env_ids: Array) -> Array:
        """Actions (N, A); rows other than `env_ids` mean nothing."""
        action = np.tile(self._still, (self._env.num_envs, 1))
        if self._policy is None:
            return action
        asked = np.array([i for i in env_ids.tolist() if len(self._chunks[i]) == 0], dtype=int)
        if len(asked):
            obs = {name: rows[asked] for name, rows in self._env.obs.items() if name != "privileged"}
            given = np.asarray(self._policy.act(obs, asked))
            given = given[:, None] if given.ndim == 2 else given
            if given.ndim != 3 or given.shape[0] != len(asked) or given.shape[2] != self._env.action_dim:
                raise TaskError(
                    f"the policy '{self.name}' gave {given.shape}; expected actions ({len(asked)}, "
                    f"{self._env.action_dim}) or chunks of them"
                )
            for i, chunk in zip(asked.tolist(), given, strict=True):
                self._chunks[i] = chunk
        for i in env_ids.tolist():
            action[i], self._chunks[i] = self._chunks[i][0], self._chunks[i][1:]
        return action

    def over(self, env_ids: Array) -> Array:
        """(n,) bool: who acts has done all that it was to do, or has given up."""
        if not isinstance(self._policy, Judging):
            return np.zeros(len(env_ids), dtype=bool)
        return self._policy.solved(env_ids) | self._policy.gave_up(env_ids)

    def failure(self, i: int) -> str:
        """Why an env's episode failed, as one word; empty where that is not known."""
        return self._policy.failure(i) if isinstance(self._policy, Judging) else ""

"""Episodes of an external environment, one after another, each from its own seed."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.task.contract import Obs, Status
from anysim_evaluation.driver import Episode
from anysim_evaluation.external.benchmark import ExternalEnv
from anysim_evaluation.policy import load_function, parse

Act = Callable[[Obs], Array]
"""Actions (1, A) or chunks (1, K, A) for observations whose first axis has length 1."""


def external_policy(env: ExternalEnv, text: str) -> Callable[[int], Act]:
    """The policy of a name; it is begun anew with each episode's seed.

    Raises:
        TaskError: it needs a task of ours, or is not there.
    """
    said = parse(text)
    if said.function:
        function = load_function(said.name, said.function)
        return lambda seed: lambda obs: np.asarray(function(obs))
    if said.options or said.name not in ("random", "zero"):
        raise TaskError(
            f"--policy {text}: it is made for tasks of anysim; expected random, zero or MODULE:FUNCTION for a task of "
            "an external benchmark"
        )
    if said.name == "zero":
        return lambda seed: lambda obs: np.clip(np.zeros((1, len(env.low))), env.low, env.high)
    if not (np.isfinite(env.low) & np.isfinite(env.high)).all():
        raise TaskError("the policy 'random' needs bounds of every action, which this environment does not have")

    def begun(seed: int) -> Act:
        generator = np.random.default_rng(seed)
        return lambda obs: generator.uniform(env.low, env.high)[None]

    return begun


def drive_external(env: ExternalEnv, policy: Callable[[int], Act], seeds: Sequence[int]) -> Iterator[Episode]:
    """Run an episode of each seed, and yield it when it has ended.

    An episode ends with the first step after which the verdict is success, when the environment ends it (that is a
    failure), or after its horizon (truncated).

    Raises:
        TaskError: the policy gives something else than actions.
    """
    size = len(env.low)
    for seed in seeds:
        obs, act = env.reset(seed), policy(seed)
        chunk, total, status, steps = np.zeros((0, size)), 0.0, Status.TRUNCATED, 0
        while steps < env.horizon:
            if len(chunk) == 0:
                chunk = _chunk(act({name: values[None] for name, values in obs.items()}), size)
            action, chunk = np.clip(chunk[0], env.low, env.high), chunk[1:]
            obs, reward, terminated = env.step(action)
            total, steps = total + reward, steps + 1
            if env.verdict():
                status = Status.SUCCESS
                break
            if terminated:
                status = Status.FAILED
                break
        yield Episode(seed, str(status), "" if status is Status.SUCCESS else str(status), steps, total)


def _chunk(given: Array, size: int) -> Array:
    """Actions (K, A) of one env."""
    chunk = given[0] if given.ndim == 3 else given
    if len(given) != 1 or chunk.ndim != 2 or len(chunk) == 0 or chunk.shape[1] != size:
        raise TaskError(f"the policy gave {given.shape}; expected an action (1, {size}) or a chunk (1, K, {size})")
    return chunk

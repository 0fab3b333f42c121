"""Shares of the episodes with which tasks of a mixture get as many segments, or CPU seconds, as their weights say.

They follow from costs that were measured once and lie beside a task's `task.yaml`: not from the machine that collects.
"""

import json
from collections.abc import Sequence
from typing import Annotated

from pydantic import Field

from anysim import registry
from anysim.api import task_path
from anysim.errors import TaskError
from anysim_collect.mixture import Balance, Part
from anysim_schemas.base import Positive, Spec

COSTS_FILE = "costs.json"
LEAST_SHARE = 0.02
"""Of the episodes, for each task."""


class Cost(Spec):
    """What some episodes of a task took on one engine, and the segments that were kept of them."""

    episodes: Annotated[int, Field(gt=0)]
    segments: Annotated[int, Field(ge=0)]
    cpu_s: Positive


class TaskCosts(Spec):
    """The content of costs.json: costs by engine, and the digest of the spec that they were measured with."""

    spec: str
    engines: dict[str, Cost]


def balanced(parts: Sequence[Part], engines: Sequence[str], balance: Balance) -> list[Part]:
    """Shares of the episodes with which segments or CPU seconds come out as the parts' shares are.

    Each task is to run on its one of `engines`, and to cost what was measured there, not what this machine is like: the
    shares are the same in every run. None is below `LEAST_SHARE`.

    Raises:
        TaskError: a task whose cost is not known.
    """
    if balance is Balance.EPISODES or len(parts) == 1:
        return list(parts)
    wanted = [
        part.share / _each_episode(part.task, engine, balance) for part, engine in zip(parts, engines, strict=True)
    ]
    return [Part(part.task, share) for part, share in zip(parts, _with_floor(wanted), strict=True)]


def _each_episode(task: str, engine: str, balance: Balance) -> float:
    """The segments that an episode leaves, or the CPU seconds that it takes, as measured.

    Raises:
        TaskError: nothing was measured, or no episode left a segment.
    """
    costs = costs_of(task)
    cost, remedy = costs.get(engine), f"leave out `--balance {balance}`, or the task"
    if cost is None:
        where = f"on {engine} (measured: {', '.join(costs)})" if costs else "for it"
        raise TaskError(f"{balance} cannot be balanced for '{task}': no costs are stored {where}; {remedy}")
    if balance is Balance.SECONDS:
        return cost.cpu_s / cost.episodes
    if cost.segments == 0:
        raise TaskError(f"segments cannot be balanced for '{task}': {cost.episodes} episodes left none; {remedy}")
    return cost.segments / cost.episodes


def _with_floor(wanted: Sequence[float]) -> list[float]:
    """Shares as wanted, but none below `LEAST_SHARE`; the others make room for it in proportion."""
    least, raised = min(LEAST_SHARE, 0.5 / len(wanted)), set[int]()
    while True:
        rest = (1.0 - least * len(raised)) / sum(w for k, w in enumerate(wanted) if k not in raised)
        low = {k for k, w in enumerate(wanted) if k not in raised and w * rest < least}
        if not low:
            return [least if k in raised else w * rest for k, w in enumerate(wanted)]
        raised |= low


def costs_of(task: str) -> dict[str, Cost]:
    """The costs of a task by engine; empty where none were measured, and for a YAML file.

    Raises:
        TaskError: the file is damaged.
    """
    if task not in registry.names("tasks"):
        return {}
    path = task_path(task).with_name(COSTS_FILE)
    try:
        return TaskCosts.model_validate(json.loads(path.read_text("utf-8"))).engines
    except FileNotFoundError:
        return {}
    except ValueError as error:
        first = str(error).splitlines()[0]
        raise TaskError(f"{path} is damaged ({first}); install the package of the task '{task}' anew") from error

"""An observer that counts how episodes end."""

import logging
from collections import Counter
from weakref import WeakKeyDictionary

from anysim.conventions import Array
from anysim.hooks import hookimpl
from anysim.task.env import TaskEnv

_log = logging.getLogger(__name__)
_ended: WeakKeyDictionary[TaskEnv, Counter[str]] = WeakKeyDictionary()


def tally(env: TaskEnv) -> Counter[str]:
    """How many episodes of an env have ended as `success`, `failed` and `truncated` so far."""
    return _ended.setdefault(env, Counter())


@hookimpl
def after_episode(env: TaskEnv, env_ids: Array) -> None:
    """Count these."""
    tally(env).update(str(word) for word in env.status[env_ids])


@hookimpl
def on_close(env: TaskEnv) -> None:
    """Say it once, to the listeners of the log."""
    _log.info("%s: %s", env.name, ", ".join(f"{count} {word}" for word, count in sorted(tally(env).items())))

"""A change of one key: the file before and after, and what has to differ."""

from typing import Any, Literal, NamedTuple

from tests.task.helpers import BLOCKS

Seen = Literal["world", "episode", "stepped", "engine", "expert", "shipped", "recorded", "filmed"]
"""The World's hash · what two envs draw, observe and earn on the kinematic engine, and the same where those that ended
are stepped too · the engine that was made, and what it was given · the task's expert · what is said of its shipped
policy · the files of recorded episodes · the same with images, and which were observed."""

FILE: dict[str, Any] = {
    **BLOCKS,
    "world": {
        **BLOCKS["world"],
        "layout": {
            "table": {"position": [0.0, 0.0, 0.2]},
            "red": {"on": "table", "x": -0.2, "y": 0.1, "yaw": 0.3},
            "ball": {"on": "table", "x": {"range": [0.1, 0.4]}, "y": {"range": [-0.4, 0.4]}},
        },
    },
}
"""The file of all rows: a table, a red box on it that does not move, and a ball somewhere else."""

SEEING = "engine=mujoco", "world.cameras.eye.size=[16, 12]", "world.cameras.eye.channels=[rgb]", "record.keep=all"
OBSERVED = *SEEING, "task.images={eye: {}}"
"""On an engine that draws; with an image that is observed."""


class Row(NamedTuple):
    """Overrides that make the file before and those that change the key; where the change is seen, or its error."""

    given: tuple[str, ...]
    change: tuple[str, ...]
    seen: Seen | None
    error: str


def row(*change: str, given: str | tuple[str, ...] = (), seen: Seen | None = None, error: str = "") -> Row:
    """A change; it is seen in the World's hash or, where that is the same, in episodes, unless `seen` says where.

    With `error` the file before runs, and the change is refused with a sentence that matches.
    """
    return Row((given,) if isinstance(given, str) else given, change, seen, error)

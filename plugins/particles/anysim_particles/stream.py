"""Points of matter in recordings: `matter/FAMILY`, for every family that has points, at a rate of its own."""

from collections.abc import Iterator
from weakref import WeakKeyDictionary

import numpy as np

from anysim.conventions import Array
from anysim.errors import AnysimError, listing
from anysim.managers.camera import interval
from anysim.record.columns import EpisodeColumns
from anysim.record.header import StreamInfo
from anysim.record.streams import StreamPart, StreamRow, StreamSource
from anysim.task.env import TaskEnv
from anysim_schemas.base import Positive

FOLLOWED: "WeakKeyDictionary[TaskEnv, MatterStream]" = WeakKeyDictionary()
"""Who is told of an env's steps."""


class MatterStream(StreamSource):
    """Single precision, as points are drawn and learned from; what is exact is what a snapshot or a replay gives."""

    def __init__(self, env: TaskEnv, *, families: tuple[str, ...] = (), fps: Positive = 10.0) -> None:
        """`families`: those of the world that draw their matter, if not given; `fps`: images of them a second [Hz]."""
        manager = env.families
        known = {} if manager is None else {name: manager.family(name) for name in env.spec.world.families or {}}
        chosen = families or tuple(name for name, family in known.items() if family.drawn)
        if not chosen or not set(chosen) <= set(known):
            raise AnysimError(f"record.streams.matter needs families of the world (families: {listing(known)})")
        self._env, self.every = env, interval(env.engine.world.physics.control_dt, fps)
        self._chosen = chosen
        self._rows: dict[int, dict[int, dict[str, Array]]] = {}
        about = {"every": self.every, "control_dt": env.engine.world.physics.control_dt}
        self.streams = {
            f"matter/{name}": StreamInfo(
                kind="points",
                shape=(None, 3),
                dtype="float32",
                unit="m",
                words=f"points of {known[name].setting.name}, those that are there",
                about={**about, "radius": known[name].state(np.array([0])).radius[:1].tolist()},
            )
            for name in chosen
        }
        FOLLOWED[env] = self

    def begin(self, index: int) -> None:
        self._rows[index] = {}
        self._keep(index, 0)

    def look(self, steps: Array) -> None:
        """A control step is complete: keep the points of the episodes that are open and due."""
        for index, rows in self._rows.items():
            step = int(steps[index])
            if step % self.every == 0 and step not in rows:
                self._keep(index, step)

    def _keep(self, index: int, step: int) -> None:
        assert self._env.families is not None
        found = dict[str, Array]()
        for name in self._chosen:
            state = self._env.families.state(name, np.array([index]))
            there = state.fields.get("there")
            found[name] = (state.points[0] if there is None else state.points[0][there[0]]).astype(np.float32)
        self._rows[index][step] = found

    def parts(self, index: int, columns: EpisodeColumns, status: str) -> Iterator[StreamPart]:
        rows = self._rows.pop(index, {})
        for step, found in sorted(rows.items()):
            if columns.first_step <= step <= columns.steps:
                made = [StreamRow(f"matter/{name}", step, points) for name, points in found.items()]
                yield StreamPart(lambda made=made: made, sum(points.nbytes for points in found.values()))

    def close(self) -> None:
        FOLLOWED.pop(self._env, None)
        self._rows.clear()

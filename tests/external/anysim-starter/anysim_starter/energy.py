"""A stream: how fast the joints are, squared, at each control step of an episode that is kept."""

from collections.abc import Iterator

from anysim.record.columns import EpisodeColumns
from anysim.record.header import StreamInfo
from anysim.record.streams import StreamPart, StreamRow, StreamSource
from anysim.task.env import TaskEnv


class Energy(StreamSource):
    """`energy/joints`, from the recorded states."""

    def __init__(self, env: TaskEnv, *, scale: float = 1.0) -> None:
        self._scale = scale
        shape = (len(env.engine.world.joints),)
        self.streams = {"energy/joints": StreamInfo(kind="array", shape=shape, unit="rad^2/s^2")}

    def parts(self, index: int, columns: EpisodeColumns, status: str) -> Iterator[StreamPart]:
        rows = self._scale * columns.state["joint_vel"] ** 2
        steps = range(columns.first_step, columns.steps + 1)
        yield StreamPart(lambda: (StreamRow("energy/joints", step, row) for step, row in zip(steps, rows, strict=True)))

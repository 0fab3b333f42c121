"""Depth and segmentation of cameras as streams, drawn from the recorded states of an episode that is kept.

Of a camera with a video the trajectory has lens and place; of others they are streams too, once.
"""

from collections.abc import Iterator

import numpy as np

from anysim.errors import RecordError
from anysim.record.columns import EpisodeColumns
from anysim.record.film import camera_of, capture_of, refuse_changed
from anysim.record.header import StreamInfo
from anysim.record.streams import StreamPart, StreamRow, StreamSource
from anysim.task.env import TaskEnv
from anysim_mcap import messages as m

CAMERA = "camera"
"""The family of these streams."""


class CameraChannels(StreamSource):
    """`camera/NAME/depth` float32 [m], at most the far plane's, `…/segmentation` uint16, `…/calibration`, `…/place`."""

    def __init__(self, env: TaskEnv) -> None:
        self._env, self._since = env, np.zeros(env.num_envs, dtype=np.int64)
        self._channels = env.spec.record.channels or {}
        world = env.engine.world
        legend = [{"id": k, "name": e.name, "label": e.label} for k, e in enumerate(world.entities, 1)]
        if len(legend) >= 1 << 16:
            raise RecordError(f"record.channels: {len(legend)} entities have no numbers of 16 bits; leave it out")
        self.streams = {}
        self._far: dict[str, np.float32] = {}
        for name, channels in self._channels.items():
            lens = world.cameras[env.engine.index.camera(name)]
            size, frame = (lens.height, lens.width), f"{CAMERA}/{name}"
            self._far[name] = np.float32(lens.far)
            depth = {"near": lens.near, "far": lens.far}
            words = "entities of the legend; 0 is the ground, and nothing"
            kinds = {
                "depth": {"dtype": "float32", "unit": "m", "about": depth},
                "segmentation": {"dtype": "uint16", "words": words, "about": {"legend": legend}},
            }
            for channel in channels:
                said = {"kind": "image", "shape": size, "frame": frame, **kinds[channel]}
                self.streams[f"{frame}/{channel}"] = StreamInfo.model_validate(said)
            if name not in env.spec.record.cameras:
                for stream, schema in (("calibration", m.CALIBRATION), ("place", m.TRANSFORMS)):
                    self.streams[f"{frame}/{stream}"] = StreamInfo(kind="data", frame=frame, about={"schema": schema})

    def begin(self, index: int) -> None:
        self._since[index] = self._env.engine.appearance_changes[index]

    def parts(self, index: int, columns: EpisodeColumns, status: str) -> Iterator[StreamPart]:
        refuse_changed(self._env, index, int(self._since[index]))
        every, render = capture_of(self._env).every, self._env.engine.render
        yield StreamPart(self._places(index, columns.first_step).copy)
        for step in range(columns.first_step, columns.steps + 1):
            if step % every:
                continue
            poses = columns.state["body_pose"][step - columns.first_step][None]
            rows: list[StreamRow] = []
            for name, channels in self._channels.items():
                found = render(name, env_ids=[index], channels=channels, body_pose=poses)
                if "depth" in found:  # as it is observed
                    found["depth"] = np.minimum(found["depth"], self._far[name])
                if "segmentation" in found:
                    found["segmentation"] = found["segmentation"].astype(np.uint16)
                rows += [StreamRow(f"{CAMERA}/{name}/{channel}", step, found[channel][0]) for channel in channels]
            yield StreamPart(rows.copy, sum(row.value.nbytes for row in rows))

    def _places(self, index: int, step: int) -> list[StreamRow]:
        """Lenses and places of the cameras without a video."""
        rows: list[StreamRow] = []
        for name in self._channels:
            if f"{CAMERA}/{name}/place" in self.streams:
                one = camera_of(self._env, index, name)
                lens = {"width": one.width, "height": one.height, "k": m.intrinsics(one)}
                rows.append(StreamRow(f"{CAMERA}/{name}/calibration", step, lens))
                place = {"parent": one.parent, "pose": list(one.pose)}
                rows.append(StreamRow(f"{CAMERA}/{name}/place", step, place))
        return rows

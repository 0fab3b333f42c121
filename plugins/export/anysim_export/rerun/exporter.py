"""The exporter `rerun`: a file of each episode, to be looked at with the viewer of Rerun."""

import io
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.errors import RecordError
from anysim.task.contract import Status
from anysim_export.api import DataSet, Episode, Exporter, take_over
from anysim_export.envs import EpisodeEnv
from anysim_export.rerun.shapes import drawn
from anysim_export.streams import Channel, others_of

RECORDING = "episode.rrd"


class RerunExporter(Exporter):
    """`episodes/000000/episode.rrd`: a world that moves, cameras with their images, curves, and what was said.

    Bodies are at `world/BODY` with their visible shapes in the colours of the episode, cameras at `world/cameras/NAME`
    with their images, depth and segmentation, which are without loss and uncompressed, the legend with the latter;
    numbers at `reward`, `success`, `action/NAME`, `joint_pos/NAME`, words at `instruction` and `sub_task`. The
    timelines are `step` and `time`. Rerun gives chunks ids of its own, so equal exports have equal content and not
    equal bytes.
    """

    needs: ClassVar[dict[str, str]] = {"rerun": "anysim-export[rerun]"}

    def __init__(
        self,
        *,
        images: Annotated[bool, Field(description="whether the images of cameras are in it")] = True,
        channels: Annotated[bool, Field(description="whether recorded depth and segmentation are in it")] = True,
        quality: Annotated[int, Field(ge=1, le=100, description="of the images, as JPEG has it")] = 90,
        engine: Annotated[str | None, Field(description="that tells where cameras are; None: the recording's")] = None,
    ) -> None:
        self._images, self._channels, self._quality, self._env = images, channels, quality, EpisodeEnv(engine)

    def places(self, data: DataSet) -> Mapping[str, str]:
        """Entities."""
        first = data.first
        found = {"action": "`action/NAME`", "collect/reward": "`reward`", "collect/status": "`success`"}
        found |= {
            "annotation": "`sub_task`: skill, phase",
            "language": "`instruction`",
            "state/body_pose": "`world/BODY`",
        }
        if "joint_pos" in first.layout.state:
            found["state/joint_pos"] = "`joint_pos/NAME`"
        found |= {f"camera/{name}": f"`world/cameras/{name}/image`" for name in first.cameras if self._images}
        found |= {name: f"`{name}`" for name in others_of(first, "text")}
        pictures = data.channels if self._channels else ()
        return found | {one.stream: f"`world/cameras/{one.camera}/{one.name}`" for one in pictures}

    def check(self, data: DataSet) -> None:
        """Refuse recordings without poses."""
        if "body_pose" not in data.first.layout.state:
            raise RecordError("these trajectories do not hold body_pose, and nothing could be seen of them in Rerun")

    def write_episode(self, folder: Path, episode: Episode, data: DataSet) -> None:
        """The recording of an episode, put together in memory: Rerun does not say where a disk is full."""
        import rerun as rr  # pyright: ignore[reportMissingImports]

        manifest = episode.manifest
        engine = self._env.begun(manifest).engine
        identity = f"{manifest.task}-{manifest.episode_seed}"
        with rr.RecordingStream("anysim", recording_id=identity, send_properties=False) as stream:
            sink = stream.binary_stream()
            stream.send_recording_name(f"{manifest.task}, episode {episode.index}: {manifest.status}")
            images = list(manifest.cameras) if self._images else []
            channels = data.channels if self._channels else ()
            _Log(stream, episode, data.first.control_dt).all(engine, images, channels, self._quality)
            content = sink.read(flush=True)
        stream.disconnect()
        assert content is not None
        (folder / RECORDING).write_bytes(content)

    def assemble(self, folder: Path, parts: Sequence[Path], data: DataSet) -> None:
        """All recordings, side by side."""
        for i, part in enumerate(parts):
            take_over(part, folder / "episodes" / f"{i:06d}")

    def close(self) -> None:
        """Free the engine."""
        self._env.close()


class _Log:
    """What is logged of an episode, to one stream."""

    def __init__(self, stream: Any, episode: Episode, control_dt: float) -> None:
        import rerun as rr  # pyright: ignore[reportMissingImports]

        self._rr, self._stream, self._episode, self._dt = rr, stream, episode, control_dt

    def all(self, engine: SimEngine, images: Sequence[str], channels: Sequence[Channel], quality: int) -> None:
        """Everything, with the images of these cameras, and these channels."""
        self._stream.log("world", self._rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        self._bodies(engine)
        for camera in dict.fromkeys([*images, *(one.camera for one in channels)]):
            self._camera(engine, camera)
        for camera in images:
            steps, shown = _taken(self._episode.images(camera))
            blobs = self._rr.EncodedImage.columns(
                blob=[_jpeg(image, quality) for image in shown], media_type=["image/jpeg"] * len(shown)
            )
            self._stream.send_columns(f"{_camera_path(camera)}/image", indexes=self._at(steps), columns=blobs)
        for channel in channels:
            self._channel(channel)
        self._numbers()
        self._words("instruction", self._episode.tasks)
        self._words("sub_task", self._episode.segments)
        for name in others_of(self._episode.manifest, "text"):
            self._words(name, list(self._episode.held(name)))

    def _at(self, steps: Array) -> list[Any]:
        times = self._rr.TimeColumn("time", duration=steps * self._dt)
        return [self._rr.TimeColumn("step", sequence=steps), times]

    def _poses(self, path: Any, poses: Array) -> None:
        """Poses (T+1, 7) of an entity."""
        columns = self._rr.Transform3D.columns(translation=poses[:, :3], quaternion=poses[:, 3:])
        self._stream.send_columns(path, indexes=self._at(np.arange(len(poses))), columns=columns)

    def _bodies(self, engine: SimEngine) -> None:
        world, names = engine.world, self._episode.manifest.layout.bodies
        colors, present = engine.get_parameters("geom.color")[0], engine.presence[0]
        for name, poses in zip(names, np.moveaxis(self._episode.states["body_pose"], 1, 0), strict=True):
            self._poses(_path("world", name), poses)
        for geom, color in zip(world.geoms, colors, strict=True):
            body = world.bodies[geom.body].name if geom.body >= 0 else ""
            if not geom.visible or (body and (not present[world.body_entity[geom.body]] or body not in names)):
                continue
            path = _path("world", *([body] if body else []), geom.name)
            place = self._rr.Transform3D(translation=geom.position, quaternion=geom.quaternion)
            self._stream.log(path, place, drawn(world, geom.shape, color), static=True)

    def _camera(self, engine: SimEngine, camera: str) -> None:
        """Where it is, and its lens."""
        path, bodies = _camera_path(camera), self._episode.states["body_pose"]
        views = [engine.camera_view(camera, [0], _in_order(engine, self._episode, row)[None]) for row in bodies]
        first = views[0]
        focal = float(first.height / (2 * np.tan(np.radians(first.fov[0]) / 2)))
        lens = self._rr.Pinhole(
            focal_length=focal, width=first.width, height=first.height, camera_xyz=self._rr.ViewCoordinates.RDF
        )
        self._stream.log(path, lens, static=True)
        self._poses(path, np.concatenate([view.pose for view in views]))

    def _channel(self, channel: Channel) -> None:
        """Depth in metres, or segmentation with its legend."""
        rr, path = self._rr, f"{_camera_path(channel.camera)}/{channel.name}"
        steps, shown = _taken(self._episode.channel(channel))
        height, width = channel.size
        if channel.name == "depth":
            kind, said, number = rr.DepthImage, {"meter": 1.0}, rr.ChannelDatatype.F32
        else:
            kind, said, number = rr.SegmentationImage, {}, rr.ChannelDatatype.U16
            words = [(one["id"], one["name"]) for one in channel.about.get("legend", ())]
            self._stream.log(path, rr.AnnotationContext(words), static=True)
        form = rr.components.ImageFormat(width=width, height=height, channel_datatype=number)
        self._stream.log(path, kind.from_fields(format=form, **said), static=True)
        raw = kind.columns(buffer=[np.ascontiguousarray(image).tobytes() for image in shown])
        self._stream.send_columns(path, indexes=self._at(steps), columns=raw)

    def _numbers(self) -> None:
        """An action is at the step at which it was taken, its reward and what came of it at the next one."""
        episode, manifest = self._episode, self._episode.manifest
        taken = np.arange(episode.steps)
        won = np.where(taken == episode.steps - 1, manifest.status == Status.SUCCESS, False)
        self._curve("reward", taken + 1, episode.rewards)
        self._curve("success", taken + 1, won.astype(float))
        for name, values in zip(manifest.layout.action, episode.actions.T, strict=True):
            self._curve(_path("action", name), taken, values)
        if "joint_pos" in episode.states:
            for name, values in zip(manifest.layout.joints, episode.states["joint_pos"].T, strict=True):
                self._curve(_path("joint_pos", name), np.arange(episode.steps + 1), values)

    def _curve(self, path: str, steps: Array, values: Array) -> None:
        columns = self._rr.Scalars.columns(scalars=values)
        self._stream.send_columns(path, indexes=self._at(steps), columns=columns)

    def _words(self, path: str, said: Sequence[str | None]) -> None:
        """Words at the steps from which on they held."""
        steps = [t for t, one in enumerate(said) if one is not None and (t == 0 or one != said[t - 1])]
        columns = self._rr.TextLog.columns(text=[said[t] for t in steps])
        self._stream.send_columns(path, indexes=self._at(np.array(steps)), columns=columns)


def _path(*parts: str) -> str:
    """A path of entities; what is no letter in a name is escaped."""
    import rerun as rr  # pyright: ignore[reportMissingImports]

    return rr.new_entity_path(list(parts))


def _camera_path(camera: str) -> str:
    return _path("world", "cameras", camera)


def _taken(images: Iterator[Array]) -> tuple[Array, list[Array]]:
    """Images when they were taken, without those that hold, and the steps of these."""
    steps, shown = list[int](), list[Array]()
    for step, image in enumerate(images):
        if not shown or image is not shown[-1]:
            steps.append(step)
            shown.append(image)
    return np.array(steps), shown


def _in_order(engine: SimEngine, episode: Episode, poses: Array) -> Array:
    """Recorded poses (R, 7) for the bodies of an engine's world; one that was not recorded stands where it is now."""
    names = episode.manifest.layout.bodies
    rows = engine.get_state().body_pose[0].copy()
    for i, body in enumerate(engine.world.bodies):
        if body.name in names:
            rows[i] = poses[names.index(body.name)]
    return rows


def _jpeg(image: Array, quality: int) -> bytes:
    from PIL import Image

    packed = io.BytesIO()
    Image.fromarray(image).save(packed, "jpeg", quality=quality)
    return packed.getvalue()

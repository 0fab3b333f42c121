"""Annotations as streams of trajectories, made while episodes are collected, of those that are kept.

The thread that steps draws what the engine must draw, from the recorded states; annotators label it on the recorder's
thread. Labels of segments, of which there are few, ask the env what its commands meant, and so are made at once.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from anysim.errors import AnysimError
from anysim.record.columns import EpisodeColumns
from anysim.record.film import capture_of, refuse_changed
from anysim.record.header import StreamInfo
from anysim.record.json import plain
from anysim.record.streams import StreamPart, StreamRow, StreamSource
from anysim.task.env import TaskEnv
from anysim_annotation.api import Annotator, Field, Record, SegmentAnnotator
from anysim_annotation.capture import Capture, Moment, SegmentLabels, refuse_unknown_cameras
from anysim_annotation.files import as_png, tidied
from anysim_annotation.view import Source, View


class AnnotationStream(StreamSource):
    """`annotation/CAMERA/ANNOTATOR`, or `…/ARRAY` below it, for each array and the records of each annotator."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        annotators: tuple[str, ...] | dict[str, dict[str, Any]],
        cameras: tuple[str, ...] = (),
        source: Source = "engine",
    ) -> None:
        """`cameras`: those of the record if not given, else all; images are labelled when those of videos are due."""
        chosen = cameras or env.spec.record.cameras or tuple(env.spec.world.cameras)
        refuse_unknown_cameras(env.engine, chosen)
        if not annotators or not chosen:
            raise AnysimError("record.streams.annotations needs annotators, and a camera of the world")
        orders = annotators if isinstance(annotators, dict) else {name: {} for name in annotators}
        self._env, self._capture = env, Capture(env, dict.fromkeys(chosen, orders), source)
        self._since = np.zeros(env.num_envs, dtype=np.int64)
        self.streams = {}
        for camera in chosen:
            scene = self._capture.scene(camera)
            for name, annotator in self._capture.annotators(camera).items():
                about = {"annotator": name, "parameters": orders[name], "source": source}
                about["legend"] = scene.legend.to_dict()
                arrays = annotator.arrays if isinstance(annotator, Annotator) else {}
                for key, field in arrays.items():
                    self.streams[_name(camera, name, key)] = _info(field, camera, scene.height, scene.width, about)
                if annotator.records:
                    keys = {key: {"unit": field.unit, "words": field.words} for key, field in annotator.records.items()}
                    info = StreamInfo(kind="data", frame=f"camera/{camera}", about={**plain(about), "records": keys})
                    self.streams[_records(camera, name, annotator)] = info

    def begin(self, index: int) -> None:
        self._since[index] = self._env.engine.appearance_changes[index]

    def parts(self, index: int, columns: EpisodeColumns, status: str) -> Iterator[StreamPart]:
        refuse_changed(self._env, index, int(self._since[index]))
        every, capture = capture_of(self._env).every, self._capture
        changes = dict(columns.annotations)
        said: Mapping[str, Any] = {}
        capture.follow_from([index])
        yield StreamPart(lambda: self._forget(index))
        step = columns.first_step
        for row in range(len(columns)):
            step = columns.first_step + row
            said = changes.get(row, said)
            moment = Moment(
                np.array([index]),
                np.array([step]),
                columns.state["body_pose"][row][None],
                columns.state["joint_pos"][row][None],
                columns.state["control_position"][row][None],
                (said if step else {},),
            )
            yield from self._segments(step - 1, capture.follow(moment))
            if step % every == 0:
                seen = capture.look(moment)
                nbytes = sum(8 * view.scene.width * view.scene.height for view in seen.values())
                yield StreamPart(lambda step=step, seen=seen: self._labels(step, seen), nbytes)
        yield from self._segments(step, capture.finish([index]))

    # ------------------------------------------------------------------ on the recorder's thread

    def _forget(self, index: int) -> Sequence[StreamRow]:
        self._capture.forget([index])
        return ()

    def _labels(self, step: int, seen: Mapping[str, View]) -> Iterator[StreamRow]:
        for camera, found in self._capture.label(seen).items():
            for name, labels in found.items():
                annotator = self._capture.annotators(camera)[name]
                for key, rows in labels.arrays.items():
                    yield StreamRow(_name(camera, name, key), step, rows[0])
                if annotator.records:
                    yield StreamRow(_records(camera, name, annotator), step, _tidy(labels.records[0]))

    def _segments(self, step: int, ended: Sequence[SegmentLabels]) -> Iterator[StreamPart]:
        for one in ended:
            annotator = self._capture.annotators(one.camera)[one.annotator]
            row = StreamRow(_records(one.camera, one.annotator, annotator), max(step, 0), _tidy(one.records))
            yield StreamPart(lambda row=row: (row,))


def _tidy(records: Sequence[Record]) -> list[Any]:
    return [tidied(plain(record, "record")) for record in records]


def _name(camera: str, annotator: str, key: str) -> str:
    return f"annotation/{camera}/{annotator}" + ("" if key == annotator else f"/{key}")


def _records(camera: str, name: str, annotator: Annotator | SegmentAnnotator) -> str:
    """The stream of an annotator's records: its own name, unless an array has that."""
    taken = isinstance(annotator, Annotator) and name in annotator.arrays
    return _name(camera, name, "records" if taken else name)


def _info(field: Field, camera: str, height: int, width: int, about: Mapping[str, Any]) -> StreamInfo:
    sizes = {"H": height, "W": width}
    shape = tuple(sizes.get(size) if isinstance(size, str) else size for size in field.shape)
    image = as_png(field) or (field.shape == ("H", "W") and field.dtype == "float32")
    points = len(shape) == 2 and shape[1] == 3 and shape[0] is None and field.dtype == "float32"
    frame = f"camera/{camera}" if image or field.words.startswith("optical frame") else "world"
    return StreamInfo.model_validate(
        {"kind": "image" if image else "points" if points else "array", "shape": shape, "dtype": field.dtype}
        | {"unit": field.unit, "words": field.words, "frame": frame, "about": plain(about)}
    )

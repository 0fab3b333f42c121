"""Recorded episodes as moments, and their labels as files."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.record.reader import TrajectoryReader
from anysim.task.env import TaskEnv
from anysim_annotation.api import Annotator
from anysim_annotation.capture import Capture, Moment
from anysim_annotation.files import ArrayFile, json_line, lines_of
from anysim_annotation.orders import Orders
from anysim_annotation.sheet import AnnotatorEntry, CameraSheet, FieldEntry
from anysim_film.episode import Moments


def said_then(reader: TrajectoryReader, steps: Array) -> list[Mapping[str, Any]]:
    """What the skill said at each control step; nothing right after the reset."""
    return [reader.annotations[step - 1] if step > 0 else {} for step in steps.tolist()]


def joints_then(env: TaskEnv, reader: TrajectoryReader, steps: Array, field: str, names: Sequence[str]) -> Array | None:
    """A recorded array (K, n) of joints or actuators by name; None where it was not recorded."""
    layout = reader.manifest.layout
    recorded = layout.joints if field.startswith("joint") else layout.actuators
    if field not in layout.state or any(name not in recorded for name in names):
        return None
    rows = np.asarray(reader.states[field])
    first = reader.initial_state.get(field)
    if 0 in steps:
        rows = np.concatenate([(rows[:1] if first is None else first[None]), rows])
    return rows[:, [recorded.index(name) for name in names]]


class EpisodeFiles:
    """Files of the labels of one episode, in a directory where none of their names are yet."""

    def __init__(self, capture: Capture, orders: Mapping[str, Orders], directory: Path) -> None:
        self._capture, self._orders, self._directory = capture, orders, directory
        self._arrays: dict[tuple[str, str, str], ArrayFile] = {}
        self._lines: dict[tuple[str, str], list[str]] = {}
        for camera, wanted in orders.items():
            for name, annotator in capture.annotators(camera).items():
                if name not in wanted:
                    continue
                if annotator.records:
                    self._lines[camera, name] = []
                for key, field in annotator.arrays.items() if isinstance(annotator, Annotator) else ():
                    stem = f"{camera}.{name}" if key == name else f"{camera}.{name}.{key}"
                    self._arrays[camera, name, key] = ArrayFile(directory, stem, field)

    def draw(self, env: TaskEnv, reader: TrajectoryReader, moments: Moments, every: int) -> list[int]:
        """Label the episode, whose env has begun it; images at each `every`-th control step.

        Returns:
            The control steps whose images were labelled.
        """
        world, capture = env.engine.world, self._capture
        joints = joints_then(env, reader, moments.steps, "joint_pos", [j.name for j in world.joints])
        drives = joints_then(env, reader, moments.steps, "control_position", [a.name for a in world.actuators])
        said, steps = said_then(reader, moments.steps), list[int]()
        capture.begin()
        for row, step in enumerate(moments.steps.tolist()):
            moment = Moment(
                np.array([0]),
                np.array([step]),
                moments.body_pose[row][None],
                None if joints is None else joints[row][None],
                None if drives is None else drives[row][None],
                (said[row],),
            )
            self._keep_segments(capture.follow(moment))
            if step % every == 0:
                steps.append(step)
                self._keep(step, capture.take(moment))
        self._keep_segments(capture.finish())
        return steps

    def _keep(self, step: int, labels: Mapping[str, Mapping[str, Any]]) -> None:
        for (camera, name, key), file in self._arrays.items():
            file.append(step, labels[camera][name].arrays[key][0])
        for (camera, name), lines in self._lines.items():
            if name in labels[camera]:
                lines.append(lines_of(step, labels[camera][name].records[0]))

    def _keep_segments(self, ended: Sequence[Any]) -> None:
        for one in ended:
            self._lines[one.camera, one.annotator] += [json_line(record) for record in one.records]

    def finish(self, steps: Sequence[int]) -> tuple[dict[str, CameraSheet], list[str]]:
        """Close the files. Returns what a sheet says of the cameras, and all files."""
        files = list[str]()
        for file in self._arrays.values():
            file.close()
            files += file.members
        for (camera, name), lines in self._lines.items():
            (self._directory / f"{camera}.{name}.jsonl").write_text("".join(lines), "utf-8")
            files.append(f"{camera}.{name}.jsonl")
        return {camera: self._sheet(camera, len(steps)) for camera in self._orders}, files

    def _sheet(self, camera: str, frames: int) -> CameraSheet:
        scene, entries = self._capture.scene(camera), dict[str, AnnotatorEntry]()
        for name, annotator in self._capture.annotators(camera).items():
            arrays = annotator.arrays if isinstance(annotator, Annotator) else {}
            files = {key: self._arrays[camera, name, key].name for key in arrays}
            if (camera, name) in self._lines:
                files["records"] = f"{camera}.{name}.jsonl"
            entries[name] = AnnotatorEntry(
                parameters=dict(self._orders[camera][name]),
                arrays={key: FieldEntry(**field._asdict()) for key, field in arrays.items()},
                records={key: FieldEntry(**field._asdict()) for key, field in annotator.records.items()},
                files=files,
                frames=frames if isinstance(annotator, Annotator) else 0,
            )
        return CameraSheet(width=scene.width, height=scene.height, annotators=entries)

"""The exporter `lerobot`."""

import json
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.errors import RecordError
from anysim.record.json import dump_json
from anysim.task.contract import Status
from anysim_export.api import DataSet, Episode, Exporter, refuse_shared
from anysim_export.lerobot import depth, tables, video
from anysim_export.lerobot.stats import ImageStats, Stats, sampled, stats_of, thinned, together
from anysim_export.streams import Channel

VERSION = "v3.0"
STATE, PRIVILEGED, IMAGES = "observation.state", "observation.environment_state", "observation.images."
ARRAYS, WORDS, STATS = "arrays.npz", "words.json", "stats.json"
MEGABYTE = 1 << 20
COUNTED = {"timestamp": "float32"} | dict.fromkeys(
    ("frame_index", "episode_index", "index", "task_index", "subtask_index"), "int64"
)


def feature_name(group: str) -> str:
    """What an observation group is called: as the policy `lerobot` of anysim-policy expects it."""
    return {"policy": STATE, "privileged": PRIVILEGED}.get(group, f"observation.{group}")


class LeRobotExporter(Exporter):
    """A frame for each control step: what was observed before an action, the action, and the reward it got.

    An image holds until the next one where a camera was slower than the control steps. Videos have even sides. LeRobot
    has no place for depth and segmentation; where they are asked for, they are images of one channel.
    """

    needs: ClassVar[Mapping[str, str]] = {"pyarrow": "anysim-export[lerobot]", "av": "anysim-export[lerobot]"}

    def __init__(
        self,
        *,
        images: Annotated[bool, Field(description="whether there are videos of the cameras")] = True,
        channels: Annotated[
            bool, Field(description="whether recorded depth and segmentation are in it, as images of one channel")
        ] = False,
        privileged: Annotated[bool, Field(description="whether what only a simulator knows is in it")] = False,
        crf: Annotated[int, Field(ge=0, le=51, description="of the videos: lower is better and larger")] = 18,
        data_mb: Annotated[int, Field(ge=1, description="of a file of frames, at most")] = 100,
        video_mb: Annotated[int, Field(ge=1, description="of a file of videos, at most")] = 200,
    ) -> None:
        self._images, self._channels, self._privileged, self._crf = images, channels, privileged, crf
        self._data_mb, self._video_mb = data_mb, video_mb

    def places(self, data: DataSet) -> Mapping[str, str]:
        """Features of a frame."""
        found = {
            "action": "`action`",
            "collect/reward": "`next.reward`",
            "collect/status": "`next.done`, `next.success`",
        }
        found |= {"annotation": "`subtask_index`: skill, phase", "language": "`task_index`"}
        found |= {f"observation/{name}": f"`{feature_name(name)}`" for name in self._groups(data)}
        found |= {f"camera/{name}": f"`{IMAGES}{name}`" for name in self._cameras(data)}
        return found | {one.stream: f"`{name}`" for name, one in self._pictures(data)}

    def check(self, data: DataSet) -> None:
        """Refuse names and numbers that LeRobot's files cannot have."""
        refuse_shared([*(IMAGES + name for name in self._cameras(data)), *(name for name, _ in self._pictures(data))])
        depth.check([one for _, one in self._pictures(data)])
        taken = [name for name in data.first.layout.obs if name in ("state", "environment_state", "images")]
        if taken:
            raise RecordError(f"the observation group '{taken[0]}' has a name that LeRobot gives a meaning of its own")

    # --------------------------------------------------------------- an episode

    def write_episode(self, folder: Path, episode: Episode, data: DataSet) -> None:
        """Arrays, words, statistics, and a video of each camera."""
        steps = np.arange(episode.steps)
        columns: dict[str, Array] = {feature_name(name): episode.obs[name][:-1] for name in self._groups(data)}
        columns |= {"action": episode.actions, "next.reward": episode.rewards[:, None]}
        columns = {name: rows.astype(np.float32) for name, rows in columns.items()}
        columns["next.done"] = (steps == episode.steps - 1)[:, None]
        columns["next.success"] = np.array([one == Status.SUCCESS for one in episode.statuses])[:, None]
        columns["timestamp"] = (steps * data.first.control_dt).astype(np.float32)
        columns["frame_index"] = steps
        np.savez(folder / ARRAYS, allow_pickle=False, **columns)
        words = {"tasks": episode.tasks, "segments": episode.segments}
        (folder / WORDS).write_bytes(dump_json(words, "words"))
        stats = {name: _stats(rows) for name, rows in columns.items()}
        for camera in self._cameras(data):
            stats[IMAGES + camera] = self._write_video(folder, camera, episode, data)
        if pictures := self._pictures(data):
            stats |= depth.write(folder / depth.CHANNELS, pictures, episode)
        (folder / STATS).write_bytes(dump_json(stats, "stats"))

    def _write_video(self, folder: Path, camera: str, episode: Episode, data: DataSet) -> Stats:
        counted, wanted = ImageStats(), set(sampled(episode.steps).tolist())

        def images() -> Iterator[Array]:
            for t, image in zip(range(episode.steps), episode.images(camera), strict=False):
                shown = video.padded(image)
                if t in wanted:
                    counted.add(thinned(shown))
                yield shown

        video.encode(folder / f"{camera}.mp4", images(), _rate(data), self._crf)
        return counted.stats()

    def _groups(self, data: DataSet) -> list[str]:
        return [name for name in data.first.layout.obs if self._privileged or name != "privileged"]

    def _cameras(self, data: DataSet) -> list[str]:
        return list(data.first.cameras) if self._images else []

    def _pictures(self, data: DataSet) -> list[tuple[str, Channel]]:
        """Depth and segmentation by the names of their features."""
        return [(IMAGES + one.key, one) for one in data.channels] if self._channels else []

    # --------------------------------------------------------------- all of them

    def assemble(self, folder: Path, parts: Sequence[Path], data: DataSet) -> None:
        """`meta`, `data` and `videos`."""
        words = [json.loads((part / WORDS).read_text("utf-8")) for part in parts]
        tasks = list(dict.fromkeys(task for one in words for task in one["tasks"]))
        segments = list(dict.fromkeys(segment for one in words for segment in one["segments"]))
        lengths = [one.steps for one in data.manifests]
        starts = np.cumsum([0, *lengths]).tolist()
        stats = [_read_stats(part / STATS) for part in parts]
        rows: list[dict[str, Any]] = []
        frames_files = tables.filled([_frames_size(part) for part in parts], self._data_mb * MEGABYTE)

        def frames() -> Iterator[Any]:
            for i, part in enumerate(parts):
                with np.load(part / ARRAYS, allow_pickle=False) as arrays:
                    columns = dict(arrays)
                columns["episode_index"] = np.full(lengths[i], i)
                columns["index"] = np.arange(starts[i], starts[i + 1])
                columns["task_index"] = np.array([tasks.index(task) for task in words[i]["tasks"]])
                columns["subtask_index"] = np.array([segments.index(one) for one in words[i]["segments"]])
                for name in ("episode_index", "index", "task_index", "subtask_index"):
                    stats[i][name] = _stats(columns[name])
                table = tables.frame_table(columns)
                yield tables.beside(table, part / depth.CHANNELS) if self._pictures(data) else table

        tables.write_tables(folder / "data", frames(), frames_files)
        for i in range(len(parts)):
            chunk, file = tables.place(frames_files[i])
            rows.append(
                {
                    "episode_index": i,
                    "tasks": list(dict.fromkeys(words[i]["tasks"])),
                    "length": lengths[i],
                    "data/chunk_index": chunk,
                    "data/file_index": file,
                    "dataset_from_index": starts[i],
                    "dataset_to_index": starts[i + 1],
                    "meta/episodes/chunk_index": 0,
                    "meta/episodes/file_index": 0,
                }
            )
        for camera in self._cameras(data):
            self._join_videos(folder, camera, parts, data, rows)
        for row, one in zip(rows, stats, strict=True):
            row |= {f"stats/{name}/{key}": value.tolist() for name, own in one.items() for key, value in own.items()}
        meta = folder / "meta"
        tables.write_episodes(meta / "episodes" / tables.file_name(0, "parquet"), rows)
        tables.write_words(meta / "tasks.parquet", "task_index", tasks, "__index_level_0__")
        tables.write_words(meta / "subtasks.parquet", "subtask_index", segments, "__index_level_0__")
        whole = {name: together([one[name] for one in stats]) for name in stats[0]}
        (meta / "stats.json").write_bytes(dump_json(whole, "stats"))
        (meta / "info.json").write_bytes(dump_json(self._info(data, len(tasks)), "info"))

    def _join_videos(
        self, folder: Path, camera: str, parts: Sequence[Path], data: DataSet, rows: Sequence[dict[str, Any]]
    ) -> None:
        """The videos of a camera in files of many episodes, and in `rows` where each episode's is."""
        sources = [part / f"{camera}.mp4" for part in parts]
        files = tables.filled([source.stat().st_size for source in sources], self._video_mb * MEGABYTE)
        key = f"videos/{IMAGES}{camera}"
        for number in sorted(set(files)):
            inside = [i for i, file in enumerate(files) if file == number]
            path = folder / key / tables.file_name(number, "mp4")
            path.parent.mkdir(parents=True, exist_ok=True)
            video.join(path, [(sources[i], data.manifests[i].steps) for i in inside], _rate(data))
            done = 0
            for i in inside:
                chunk, file = tables.place(number)
                until = done + data.manifests[i].steps
                rows[i][f"{key}/chunk_index"], rows[i][f"{key}/file_index"] = chunk, file
                rows[i][f"{key}/from_timestamp"] = float(done / _rate(data))
                rows[i][f"{key}/to_timestamp"] = float(until / _rate(data))
                done = until

    def _info(self, data: DataSet, tasks: int) -> dict[str, Any]:
        layout, rate = data.first.layout, _rate(data)
        fps = int(rate) if rate.denominator == 1 else float(rate)
        features: dict[str, Any] = {}
        for group in self._groups(data):
            size = int(np.prod(layout.obs[group].shape))
            names = [f"{group}_{k}" for k in range(size)]
            features[feature_name(group)] = {"dtype": "float32", "shape": [size], "names": names}
        features["action"] = {"dtype": "float32", "shape": [len(layout.action)], "names": list(layout.action)}
        features["next.reward"] = {"dtype": "float32", "shape": [1], "names": None}
        features |= {name: {"dtype": "bool", "shape": [1], "names": None} for name in ("next.done", "next.success")}
        features |= {name: {"dtype": dtype, "shape": [1], "names": None} for name, dtype in COUNTED.items()}
        for camera in self._cameras(data):
            entry = data.first.cameras[camera]
            height, width = entry.height + entry.height % 2, entry.width + entry.width % 2
            about = {
                "video.height": height,
                "video.width": width,
                "video.codec": video.CODEC,
                "video.pix_fmt": video.PIXELS,
                "video.is_depth_map": False,
                "video.fps": fps,
                "video.channels": 3,
                "has_audio": False,
            }
            names = ["height", "width", "channels"]
            shown = {"dtype": "video", "shape": [height, width, 3], "names": names, "info": about}
            features[IMAGES + camera] = shown
        features |= {name: depth.feature(one) for name, one in self._pictures(data)}
        return {
            "codebase_version": VERSION,
            "robot_type": data.robot or None,
            "total_episodes": len(data.manifests),
            "total_frames": sum(one.steps for one in data.manifests),
            "total_tasks": tasks,
            "chunks_size": tables.CHUNK_FILES,
            "data_files_size_in_mb": self._data_mb,
            "video_files_size_in_mb": self._video_mb,
            "fps": fps,
            "splits": {"train": f"0:{len(data.manifests)}"},
            "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
            "video_path": "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
            if self._cameras(data)
            else None,
            "features": features,
        }


def _stats(rows: Array) -> Stats:
    return stats_of(rows.reshape(len(rows), -1))


def _frames_size(part: Path) -> int:
    return sum((part / name).stat().st_size for name in (ARRAYS, depth.CHANNELS) if (part / name).exists())


def _read_stats(path: Path) -> dict[str, Stats]:
    read = json.loads(path.read_text("utf-8"))
    return {name: {key: np.array(value) for key, value in own.items()} for name, own in read.items()}


def _rate(data: DataSet) -> Fraction:
    """Frames per second."""
    rate = 1 / Fraction(data.first.control_dt).limit_denominator(1_000_000)
    return rate.limit_denominator(100_000)

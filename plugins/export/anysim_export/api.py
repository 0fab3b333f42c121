"""The contract of exporters.

An exporter is an entry point of the group `anysim.exporters`: a class whose keyword-only parameters are its options. It
writes each episode into a folder of its own, and then makes one data set of all of them. What it writes follows from
its arguments alone, byte for byte: no clock, no draws, no paths. Then an export that was killed goes on with the
episodes that are whole, and gives the same bytes.
"""

import io
import os
import shutil
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

from anysim.conventions import Array
from anysim.errors import RecordError
from anysim.record.manifest import Manifest
from anysim.record.reader import TrajectoryReader
from anysim_export.streams import Channel, channels_of


class DataSet(NamedTuple):
    """What all episodes of a data set share.

    Attributes:
        manifests: of the trajectories, in the order of the episodes; layouts, control steps, cameras and what is taken
            of their streams are equal.
        options: of the exporter, as plain data.
    """

    manifests: Sequence[Manifest]
    options: Mapping[str, object]

    @property
    def first(self) -> Manifest:
        """What is equal in all of them."""
        return self.manifests[0]

    @property
    def robot(self) -> str:
        """The robots that act, by name; empty where none does."""
        return ", ".join(dict.fromkeys(name.partition(".")[0] for name in self.first.layout.action))

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Depth and segmentation of cameras, where they were recorded."""
        return channels_of(self.first)


class Episode:
    """A trajectory of T steps as trainers see it: row t is what was observed before action t, and that action.

    Attributes:
        index: its place in the data set.
        manifest: of the trajectory.
        obs: (T+1, D) float32 or float64 by group; the last row is what the last action led to.
        states: (T+1, …) float64 by name, likewise.
        actions: (T, A) float64; rewards (T,) float64; statuses T of them, after each action.
        tasks: T of them: the instruction under which each action was taken.
        annotations: T of them: what the policy said of each action, as plain data.
        segments: T of them: the skill, and its phase, that each action was taken by; empty where none said so.
    """

    def __init__(self, index: int, reader: TrajectoryReader) -> None:
        """Read everything but the images.

        Raises:
            RecordError: the trajectory is damaged.
        """
        self.index, self.manifest, self._reader = index, reader.manifest, reader
        self.obs = {name: reader.obs_from_reset(name) for name in reader.obs}
        self.states = {name: reader.states_from_reset(name) for name in reader.states}
        self.actions, self.rewards, self.statuses = reader.actions, reader.rewards, reader.statuses
        said = [words or reader.manifest.instruction or reader.manifest.task for words in reader.language]
        self.tasks = tuple(said)
        self.annotations = reader.annotations
        self.segments = tuple(_segment(held) for held in reader.annotations)

    @property
    def directory(self) -> Path:
        """Of the trajectory, for exporters that draw or compute from it anew; no path belongs into a data set."""
        return self._reader.directory

    @property
    def steps(self) -> int:
        """T, the number of actions."""
        return self.manifest.steps

    def images(self, camera: str) -> Iterator[Array]:
        """T+1 images (H, W, 3) uint8, one at a time: the latest before each action, and after the last one.

        Raises:
            RecordError: the video is damaged, or begins later than the episode.
        """
        return self._images(f"camera/{camera}")

    def channel(self, channel: Channel) -> Iterator[Array]:
        """T+1 images (H, W) of depth [m] or segmentation, as `images`, with every bit that was recorded.

        Raises:
            RecordError: the stream is damaged, or begins later than the episode.
        """
        return self._images(channel.stream)

    def held(self, stream: str) -> Iterator[Any]:
        """T+1 values of a stream beside the numbers: the latest before each action, None before its first row."""
        rows, value = self._reader.rows(stream), None
        following = next(rows, None)
        for now in range(self.steps + 1):
            while following is not None and following.step <= now:
                value, following = following.value, next(rows, None)
            yield value

    def _images(self, stream: str) -> Iterator[Array]:
        for image in self.held(stream):
            if image is None:
                raise RecordError(f"{self._reader.directory} has no image of '{stream}' from before the first action")
            yield image


def _segment(held: Mapping[str, object]) -> str:
    return ": ".join(str(held[key]) for key in ("skill", "phase") if held.get(key))


class Exporter(ABC):
    """A form of data sets. `needs` are the modules that it imports when used, by the extra that brings them."""

    needs: ClassVar[Mapping[str, str]] = {}

    def check(self, data: DataSet) -> None:
        """Refuse, before anything is written, what this form cannot hold; a RecordError that says what to do."""

    @abstractmethod
    def places(self, data: DataSet) -> Mapping[str, str]:
        """Where in a data set each stream of the recordings goes, by its name; streams that are left out are not in it.

        Names are those of `open_trajectory(path).names()`. The command prints what is left out.
        """

    @abstractmethod
    def write_episode(self, folder: Path, episode: Episode, data: DataSet) -> None:
        """Write what is needed of an episode into its empty folder."""

    @abstractmethod
    def assemble(self, folder: Path, parts: Sequence[Path], data: DataSet) -> None:
        """Make the data set in an empty folder, of the folders of all episodes in order, which stay as they are."""

    def close(self) -> None:
        """Free what was held from one episode to the next; called once, whatever came."""
        return


def refuse_shared(names: Iterable[str]) -> None:
    """Refuse observations of one name, as of a group `front_depth` beside depth of the camera `front`.

    Raises:
        RecordError: two of these names are equal.
    """
    found = list(names)
    shared = sorted({name for name in found if found.count(name) > 1})
    if shared:
        raise RecordError(
            f"two things that are observed would both be called '{shared[0]}': observation groups, cameras and their "
            "depth; rename one, or leave one out with --option images=false or --option channels=false"
        )


def write_image(path: Path, image: Array) -> None:
    """An image (H, W, 3) or (H, W), uint8 or uint16, as a PNG without a time."""
    path.write_bytes(png(image))


def png(image: Array) -> bytes:
    """The bytes of an image (H, W, 3) or (H, W), uint8 or uint16, as a PNG without a time."""
    from PIL import Image

    packed = io.BytesIO()
    Image.fromarray(image).save(packed, "png", compress_level=1)
    return packed.getvalue()


def take_over(part: Path, folder: Path) -> None:
    """The files of an episode in a folder of the data set, without a second copy where the disk can do so."""
    shutil.copytree(part, folder, copy_function=_link, dirs_exist_ok=True)


def _link(source: str, target: str) -> None:
    try:
        os.link(source, target)
    except OSError:  # a file system without links, or a full disk: then copying says so
        shutil.copyfile(source, target)

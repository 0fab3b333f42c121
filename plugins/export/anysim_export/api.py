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
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import ClassVar, NamedTuple

from anysim.conventions import Array
from anysim.errors import RecordError
from anysim.record.manifest import Manifest
from anysim.record.reader import TrajectoryReader


class DataSet(NamedTuple):
    """What all episodes of a data set share.

    Attributes:
        manifests: of the trajectories, in the order of the episodes; layouts, control steps and cameras are equal.
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


class Episode:
    """A trajectory of T steps as trainers see it: row t is what was observed before action t, and that action.

    Attributes:
        index: its place in the data set.
        manifest: of the trajectory.
        obs: (T+1, D) float32 or float64 by group; the last row is what the last action led to.
        states: (T+1, …) float64 by name, likewise.
        actions: (T, A) float64; rewards (T,) float64.
        tasks: T of them: the instruction under which each action was taken.
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
        self.actions, self.rewards = reader.actions, reader.rewards
        said = [words or reader.manifest.instruction or reader.manifest.task for words in reader.language]
        self.tasks = tuple(said)
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
        frames = self._reader.images(camera)
        step, image = next(frames, (1, None))
        if image is None or step != 0:
            raise RecordError(f"{self._reader.directory} has no image of '{camera}' from before the first action")
        following = next(frames, None)
        for now in range(self.steps + 1):
            while following is not None and following[0] <= now:
                image = following[1]
                following = next(frames, None)
            yield image


def _segment(held: Mapping[str, object]) -> str:
    return ": ".join(str(held[key]) for key in ("skill", "phase") if held.get(key))


class Exporter(ABC):
    """A form of data sets. `needs` are the modules that it imports when used, by the extra that brings them."""

    needs: ClassVar[Mapping[str, str]] = {}

    def check(self, data: DataSet) -> None:
        """Refuse, before anything is written, what this form cannot hold; a RecordError that says what to do."""

    @abstractmethod
    def write_episode(self, folder: Path, episode: Episode, data: DataSet) -> None:
        """Write what is needed of an episode into its empty folder."""

    @abstractmethod
    def assemble(self, folder: Path, parts: Sequence[Path], data: DataSet) -> None:
        """Make the data set in an empty folder, of the folders of all episodes in order, which stay as they are."""

    def close(self) -> None:
        """Free what was held from one episode to the next; called once, whatever came."""
        return


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

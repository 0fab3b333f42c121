"""The exporter `foxglove`: one MCAP file of each episode, with all that Foxglove draws."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

from pydantic import Field

from anysim.errors import RecordError
from anysim.record.reader import open_trajectory
from anysim_export.api import DataSet, Episode, Exporter, take_over
from anysim_export.envs import EpisodeEnv
from anysim_mcap.foxglove.episode import EpisodeTracks
from anysim_mcap.foxglove.merged import recorded_messages, write_merged
from anysim_mcap.writer import TRAJECTORY_FILE

EPISODE = "episode.mcap"


class FoxgloveExporter(Exporter):
    """`episodes/000000/episode.mcap`: every message of the recording and its streams, and what is worked out of them.

    Added are the shapes of the world (`/scene`), joints by name, videos, lenses and places of all cameras, what
    annotators said as drawings on the images, readings of LiDARs and depth cameras, and words when they change.
    """

    def __init__(
        self,
        *,
        images: Annotated[bool, Field(description="whether the images of cameras are in it")] = True,
        crf: Annotated[int, Field(ge=0, le=51, description="quality of the videos; less is better")] = 23,
        engine: Annotated[str | None, Field(description="that tells colours and places; None: the recording's")] = None,
    ) -> None:
        self._crf, self._env = crf if images else None, EpisodeEnv(engine)

    def places(self, data: DataSet) -> Mapping[str, str]:
        """Topics: those of the recording, and videos."""
        first = data.first
        found = {"action": "`/action`", "annotation": "`/annotation`", "language": "`/language`"}
        found |= {"collect/reward": "`/collect`", "collect/status": "`/collect`"}
        found |= {f"state/{name}": "`/state`" for name in first.layout.state}
        found |= {f"observation/{name}": "`/collect`" for name in first.layout.obs}
        found |= {f"camera/{name}": f"`/camera/{name}`" for name in first.cameras if self._crf is not None}
        return found | {name: f"`/{name}`" for name in first.streams}

    def check(self, data: DataSet) -> None:
        """Refuse recordings of other writers, and those without poses."""
        writers = {manifest.writer for manifest in data.manifests} - {"mcap"}
        if writers:
            raise RecordError(f"these trajectories were recorded by the writer '{min(writers)}'; record with `mcap`")
        options = data.first.spec.get("record", {}).get("options", {})
        if "body_pose" not in data.first.layout.state or not options.get("transforms", True):
            raise RecordError(
                "these trajectories hold no /tf, and nothing would move; record `body_pose`, with transforms"
            )

    def write_episode(self, folder: Path, episode: Episode, data: DataSet) -> None:
        """The file of an episode."""
        directory, manifest = episode.directory, episode.manifest
        topics = {one.topic.name for one in recorded_messages(directory / TRAJECTORY_FILE)} | manifest.streams.keys()
        own = EpisodeTracks(episode, open_trajectory(directory), self._env.begun(manifest), topics).all(self._crf)
        files = [TRAJECTORY_FILE, *sorted({stream.file for stream in manifest.streams.values()})]
        tracks = [*(recorded_messages(directory / name) for name in files), *own]
        write_merged(folder / EPISODE, directory / TRAJECTORY_FILE, tracks)

    def assemble(self, folder: Path, parts: Sequence[Path], data: DataSet) -> None:
        """All files, side by side."""
        for i, part in enumerate(parts):
            take_over(part, folder / "episodes" / f"{i:06d}")

    def close(self) -> None:
        """Free the engine."""
        self._env.close()

"""manifest.json: what a trajectory is. Equal runs give equal manifests, but for the key `clock`."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import Field, ValidationError, model_validator

from anysim.errors import RecordError
from anysim.record.header import CameraInfo, Count, EpisodeHeader, Header, Label, RunHeader, StreamInfo
from anysim.record.json import load_json
from anysim.record.names import MANIFEST_FILE, RUN_FILE, checked_file_name
from anysim_schemas.base import Name, Spec

TRAJECTORY_FORMAT = "anysim-trajectory-1"
RUN_FORMAT = "anysim-run-1"

Digest = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
S = TypeVar("S", bound=Spec)


class FileEntry(Spec):
    """Size [bytes] and SHA-256 of a file."""

    bytes: Count
    sha256: Digest


class CameraEntry(CameraInfo):
    """A recorded camera: its video, how many frames it has, and the control step of the first.

    The video may be padded to even sizes on the right and below; `width` and `height` are those of the images.
    """

    file: str
    frames: Count
    first_step: Count = 0
    fps: Annotated[float, Field(gt=0)]


class StreamEntry(StreamInfo):
    """A stream: its file, and how many rows it has there."""

    file: str
    rows: Count


class Manifest(RunHeader):
    """Everything about a committed trajectory but its arrays and images."""

    format: Literal["anysim-trajectory-1"] = TRAJECTORY_FORMAT
    writer: Label
    env: Count
    episode: Count
    episode_seed: Annotated[int, Field(ge=0)]
    drawn: dict[str, Any] = Field(default_factory=dict)
    overridden: dict[str, Any] = Field(default_factory=dict)
    instruction: str = Field(default="", max_length=1 << 16)
    status: Label
    steps: Count
    has_initial_frame: bool
    initial_digest: Digest | None = None
    final_digest: Digest
    outcome: dict[str, Any] = Field(default_factory=dict, description="what the collector says about it")
    cameras: dict[Name, CameraEntry] = Field(default_factory=dict, description="those that took an image")
    streams: dict[Label, StreamEntry] = Field(default_factory=dict)
    files: dict[str, FileEntry]
    clock: dict[str, Any] = Field(default_factory=dict, description="all that differs between equal runs")

    @model_validator(mode="after")
    def _files_stay_inside(self) -> "Manifest":
        try:
            for name in self.files:
                checked_file_name(name)
        except RecordError as error:
            raise ValueError(str(error)) from error
        for what, entries in (("video of camera", self.cameras), ("file of the stream", self.streams)):
            for name, entry in entries.items():
                if entry.file not in self.files:
                    raise ValueError(f"the {what} {name}, {entry.file!r}, is not among the files")
        return self

    def to_dict(self) -> dict[str, Any]:
        """Plain data, None included: every manifest has the same keys."""
        return self.model_dump(mode="json")

    def header(self) -> Header:
        """What its writer was told at the beginning."""
        run = RunHeader(**{name: getattr(self, name) for name in RunHeader.model_fields})
        cameras = {
            name: CameraInfo(**{field: getattr(entry, field) for field in CameraInfo.model_fields})
            for name, entry in self.cameras.items()
        }
        others = {name: getattr(self, name) for name in EpisodeHeader.model_fields if name != "cameras"}
        return Header(run, EpisodeHeader(cameras=cameras, **others))


class RunRecord(RunHeader):
    """The content of run.json."""

    format: Literal["anysim-run-1"] = RUN_FORMAT

    def to_dict(self) -> dict[str, Any]:
        """Plain data, None included."""
        return self.model_dump(mode="json")


def read_manifest(directory: Path) -> Manifest:
    """The manifest of a trajectory's directory.

    Raises:
        RecordError: it is missing, of another format, or inconsistent.
    """
    return read_format(directory / MANIFEST_FILE, TRAJECTORY_FORMAT, Manifest)


def read_run(out: Path) -> RunRecord:
    """What was run, from a run's directory.

    Raises:
        RecordError: it is missing, of another format, or inconsistent.
    """
    return read_format(out / RUN_FILE, RUN_FORMAT, RunRecord)


def read_format(path: Path, known: str, model: type[S]) -> S:
    """A JSON file that says by `format` what it is.

    Raises:
        RecordError: it is missing, of another format, or inconsistent.
    """
    data = load_json(path)
    found = data.get("format") if isinstance(data, Mapping) else None
    if found != known:
        raise RecordError(
            f"{path} has the format {found!r}; this version of anysim reads {known!r}: "
            "use the version of anysim that wrote it, or check that this is a file of a recorder"
        )
    try:
        return model.model_validate(data)
    except ValidationError as error:
        faults = "; ".join(f"{'.'.join(map(str, e['loc'])) or 'file'}: {e['msg']}" for e in error.errors()[:3])
        raise RecordError(f"{path} is damaged or was edited: {faults}") from error

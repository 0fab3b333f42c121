"""anysim.json: what a data set was exported from, at its root, and what its episodes begin with."""

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from anysim.record.header import Count, Label
from anysim.record.json import dump_json
from anysim.record.manifest import Digest, Manifest, read_format
from anysim_schemas.base import Spec

SHEET_FILE = "anysim.json"
SHEET_FORMAT = "anysim-export-1"


class ExportedEpisode(Spec):
    """An episode: enough to begin it anew. `source` is the digest of its trajectory's manifest, without clocks."""

    env: Count
    episode: Count
    episode_seed: Annotated[int, Field(ge=0)]
    status: Label
    steps: Count
    drawn: dict[str, Any] = Field(default_factory=dict)
    overridden: dict[str, Any] = Field(default_factory=dict)
    spec: Count = Field(default=0, description="its place in `specs`")
    source: Digest


class ExportSheet(Spec):
    """The content of anysim.json; equal exports of equal runs give equal sheets."""

    format: Literal["anysim-export-1"] = SHEET_FORMAT
    exporter: Label
    package: Label
    options: dict[str, Any] = Field(default_factory=dict)
    task: Label
    specs: tuple[dict[str, Any], ...] = Field(description="the resolved specs of the runs, as plain data")
    episodes: tuple[ExportedEpisode, ...]

    def encode(self) -> bytes:
        """The bytes of the file."""
        return dump_json(self.model_dump(mode="json"), "export")


def make_sheet(exporter: str, package: str, options: dict[str, Any], manifests: Sequence[Manifest]) -> ExportSheet:
    """The sheet of an export of these trajectories."""
    specs: list[dict[str, Any]] = []
    episodes: list[ExportedEpisode] = []
    for one in manifests:
        if one.spec not in specs:
            specs.append(one.spec)
        text = dump_json(one.model_dump(mode="json", exclude={"clock"}), "manifest")
        episodes.append(
            ExportedEpisode(
                **{name: getattr(one, name) for name in ExportedEpisode.model_fields if hasattr(one, name)}
                | {"spec": specs.index(one.spec), "source": hashlib.sha256(text).hexdigest()}
            )
        )
    return ExportSheet(
        exporter=exporter,
        package=package,
        options=options,
        task=manifests[0].task,
        specs=tuple(specs),
        episodes=tuple(episodes),
    )


def read_sheet(directory: Path) -> ExportSheet | None:
    """The sheet of an exported data set; None where there is none.

    Raises:
        RecordError: it is damaged, or of another format.
    """
    path = directory / SHEET_FILE
    return read_format(path, SHEET_FORMAT, ExportSheet) if path.exists() else None

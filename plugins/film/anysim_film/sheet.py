"""film.json: what a directory of videos shows that were drawn from a trajectory, beside it."""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from anysim.record.header import Count, Label
from anysim.record.manifest import CameraEntry, Digest, FileEntry, read_format
from anysim_schemas.base import Name, Spec

FILM_FILE = "film.json"
FILM_FORMAT = "anysim-film-1"


class DrawnSheet(Spec):
    """What was drawn from a trajectory, and with what. Equal commands give equal sheets, but for the key `clock`.

    `final_digest` says which episode it is: that of its last state. `engine`, `world_hash` and `spec` are those that it
    was drawn with, and `still` names the bodies that were not recorded and stand where a reset puts them.
    """

    format: str
    task: Label
    env: Count
    episode: Count
    episode_seed: Annotated[int, Field(ge=0)]
    final_digest: Digest
    engine: Label
    engine_version: Label
    world_hash: Label
    spec: dict[str, Any]
    still: tuple[Label, ...] = ()
    cameras: dict[Name, Any] = Field(default_factory=dict)
    files: dict[str, FileEntry] = Field(default_factory=dict)
    clock: dict[str, Any] = Field(default_factory=dict, description="all that differs between equal sheets")

    def to_dict(self) -> dict[str, Any]:
        """Plain data, None included."""
        return self.model_dump(mode="json")


class FilmSheet(DrawnSheet):
    """The content of film.json."""

    format: Literal["anysim-film-1"] = FILM_FORMAT
    cameras: dict[Name, CameraEntry] = Field(default_factory=dict)


def read_sheet(directory: Path) -> FilmSheet | None:
    """The sheet of a directory of videos; None where nothing was filmed yet.

    Raises:
        RecordError: it is damaged, or of another format.
    """
    path = directory / FILM_FILE
    return read_format(path, FILM_FORMAT, FilmSheet) if path.exists() else None

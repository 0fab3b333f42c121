"""A table of returns, one row an episode."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

from pydantic import Field

from anysim.errors import RecordError
from anysim_export.api import DataSet, Episode, Exporter


class Ledger(Exporter):
    """`returns.csv`: the steps of each episode, the sum of its rewards, and what was asked."""

    def __init__(self, *, digits: Annotated[int, Field(ge=0, le=12, description="after the point")] = 3) -> None:
        self._digits = digits

    def check(self, data: DataSet) -> None:
        """A row has room for one line."""
        for one in data.manifests:
            if "\n" in one.instruction:
                raise RecordError(f"the instruction {one.instruction!r} has more lines than a row; record another")

    def places(self, data: DataSet) -> Mapping[str, str]:
        """Columns of the table."""
        return {"collect/reward": "`return`", "language": "`instruction`"}

    def write_episode(self, folder: Path, episode: Episode, data: DataSet) -> None:
        """A row."""
        words = episode.tasks[0].replace('"', '""')
        row = f'{episode.index},{episode.steps},{episode.rewards.sum():.{self._digits}f},"{words}"\n'
        (folder / "row.csv").write_text(row, "utf-8")

    def assemble(self, folder: Path, parts: Sequence[Path], data: DataSet) -> None:
        """All rows, and what is in them."""
        rows = [(part / "row.csv").read_text("utf-8") for part in parts]
        (folder / "returns.csv").write_text("episode,steps,return,instruction\n" + "".join(rows), "utf-8")

"""Notes on what a format cannot hold of a model, gathered by kind: each said once, with how often and where."""

from anysim.assets.model import ImportNote
from anysim.errors import listing

_SHOWN = 4


class Notes:
    """Notes of one file that is written."""

    def __init__(self) -> None:
        self._found: dict[tuple[str, str, str], list[str]] = {}

    def lost(self, what: str, why: str, owner: str) -> None:
        """Something of the model that is not in the file."""
        self._add("dropped", what, why, owner)

    def changed(self, what: str, why: str, owner: str) -> None:
        """Something that the file says in another form."""
        self._add("info", what, why, owner)

    def _add(self, kind: str, what: str, why: str, owner: str) -> None:
        self._found.setdefault((kind, what, why), []).append(owner)

    def told(self) -> tuple[ImportNote, ...]:
        """All of them, in the order in which they were met."""
        return tuple(
            ImportNote(kind, what, f"{why} ({len(owners)}: {listing(dict.fromkeys(owners), _SHOWN)})")  # type: ignore[arg-type]
            for (kind, what, why), owners in self._found.items()
        )

"""Entries of the folder of runs: recorded runs, and folders with pages such as reports and comparisons."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from anysim.record.names import MANIFEST_FILE, RUN_FILE, trajectories

DEEPEST = 4
"""Folders below the folder of runs that are looked into."""
MOST = 200
"""Entries that are listed, the newest first."""
SHOWN = {".html": "text/html; charset=utf-8", ".mp4": "video/mp4", ".png": "image/png", ".jpg": "image/jpeg"}
"""Files that the page gives away, by their endings."""


@dataclass(frozen=True)
class Entry:
    """A folder that has something to show.

    Attributes:
        key: of it in addresses.
        folder: where it is.
        name: relative to the folder of runs.
        changed: when something in it was last written [s since 1970]; for the order alone.
        run: of a recorded run what `run.json` says, else empty.
        files: what may be looked at, by the path relative to the folder.
    """

    key: str
    folder: Path
    name: str
    changed: float
    run: Mapping[str, Any] = field(default_factory=dict)
    files: Mapping[str, Path] = field(default_factory=dict)

    @property
    def pages(self) -> list[str]:
        """Its HTML pages."""
        return [name for name in self.files if name.endswith(".html")]

    @property
    def videos(self) -> list[str]:
        """Its videos."""
        return [name for name in self.files if name.endswith(".mp4")]

    def told(self) -> dict[str, Any]:
        """Of a run how many episodes it has, and how they ended, as far as its report says so."""
        report = _json(self.folder / "report.json")
        kept = len(trajectories(self.folder)) if self.run else 0
        return {"kept": kept, "attempts": report.get("attempts"), "successes": report.get("successes")}

    def episodes(self) -> list[dict[str, Any]]:
        """The committed episodes of a run, each with its videos."""
        rows = []
        for path in trajectories(self.folder) if self.run else ():
            manifest = _json(path / MANIFEST_FILE)
            own = f"{path.relative_to(self.folder).as_posix()}/"
            videos = [name for name in self.videos if name.startswith(own)]
            told = {key: manifest.get(key) for key in ("env", "episode", "status", "steps", "instruction")}
            rows.append({"name": path.name, "videos": videos, **told})
        return rows


def entries(root: Path) -> list[Entry]:
    """The entries below a folder, the newest first; none where there is no such folder."""
    found: list[Entry] = []
    _look(root, root, 0, found)
    return sorted(found, key=lambda entry: (-entry.changed, entry.name))[:MOST]


def _look(folder: Path, root: Path, depth: int, found: list[Entry]) -> None:
    try:
        inside = sorted(folder.iterdir())
    except OSError:
        return
    run = _json(folder / RUN_FILE) if (folder / RUN_FILE) in inside else {}
    files = {path.name: path for path in inside if path.suffix in SHOWN and _plain(path)}
    if run:
        files |= {
            path.relative_to(folder).as_posix(): path
            for trajectory in trajectories(folder)
            for path in sorted(trajectory.iterdir())
            if path.suffix in SHOWN and _plain(path)
        }
    if run or any(name.endswith((".html", ".mp4")) for name in files):
        name = folder.relative_to(root).as_posix()
        key = hashlib.sha256(name.encode()).hexdigest()[:12]
        found.append(Entry(key, folder, name, folder.stat().st_mtime, run, files))
    if not run and depth < DEEPEST:
        for path in inside:
            if path.is_dir() and not path.is_symlink() and not path.name.startswith("."):
                _look(path, root, depth + 1, found)


def _plain(path: Path) -> bool:
    """A file that is one, and no link to another."""
    return path.is_file() and not path.is_symlink()


def _json(path: Path) -> dict[str, Any]:
    """What a file says; nothing where it is not there, or is none."""
    try:
        found = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}

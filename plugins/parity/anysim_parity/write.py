"""A comparison on the disk: a directory with `compare.json` and `compare.html`, whole or not at all."""

import json
import shutil
import tempfile
from pathlib import Path
from typing import NamedTuple

from anysim.errors import AnysimError
from anysim_parity.drawing import require_matplotlib
from anysim_parity.html import page
from anysim_parity.report import Comparison, as_data

JSON_FILE, HTML_FILE = "compare.json", "compare.html"


class ReportFiles(NamedTuple):
    """Where it is. `html` is None where the page could not be drawn; `trouble` says why."""

    json: Path
    html: Path | None
    trouble: str = ""


def check_out(out: Path) -> None:
    """Refuse a directory that holds anything but an earlier comparison, before anything is measured.

    Raises:
        AnysimError: it does.
    """
    if out.exists() and (not out.is_dir() or {p.name for p in out.iterdir()} - {JSON_FILE, HTML_FILE}):
        raise AnysimError(f"{out} is there already and is no comparison; name another directory with --out")


def write(comparison: Comparison, out: Path) -> ReportFiles:
    """Write both files aside and show them by one rename; an earlier comparison gives way.

    Raises:
        AnysimError: the directory holds something else.
    """
    check_out(out)
    out.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{out.name}-", dir=out.parent) as folder:
        made = Path(folder) / out.name
        made.mkdir()
        text = json.dumps(as_data(comparison), indent=1, allow_nan=False)
        (made / JSON_FILE).write_text(text + "\n", encoding="utf-8")
        trouble = ""
        try:
            require_matplotlib()
            (made / HTML_FILE).write_text(page(comparison), encoding="utf-8")
        except AnysimError as error:
            trouble = str(error)
        if out.exists():
            out.rename(Path(folder) / "before")
        made.rename(out)
        shutil.rmtree(Path(folder) / "before", ignore_errors=True)
    return ReportFiles(out / JSON_FILE, None if trouble else out / HTML_FILE, trouble)

"""Qualify in a process of its own, with a time limit: whatever happens there is a row here."""

import json
import tempfile
from pathlib import Path
from typing import NamedTuple

from anysim.assets.catalogue import load_robot, missing_source
from anysim.engine.factory import availability
from anysim.errors import AnysimError
from anysim_processes.own_process import run_module
from anysim_robots.qualify.result import CHECKS, Check, Qualification, from_data
from anysim_robots.qualify.run import FULL, Durations

LIMIT = 180.0
"""[s] of wall-clock time for one robot on one engine."""


class Apart(NamedTuple):
    """What came of it. `found` is None where no checks were asked for; `undrawn` says why there is no picture."""

    found: Qualification | None
    picture: Path | None = None
    undrawn: str = ""


def qualify_apart(
    robot: str,
    engine: str,
    durations: Durations | None = FULL,
    *,
    picture: Path | None = None,
    size: tuple[int, int] = (320, 320),
    limit: float = LIMIT,
) -> Apart:
    """As `qualify`, and draw a picture; a crash or a run that takes too long is a failed check with that cause.

    Args:
        robot: a name of the catalogue or a YAML file.
        engine: an installed engine.
        durations: None for no checks at all.
        picture: the PNG file to draw.
        size: width and height of the picture [px].
        limit: wall-clock time for all of it [s].

    Raises:
        AnysimError: there is no such robot or engine, the entry is not valid, or a developers' tool is missing.
    """
    entry = load_robot(robot)
    version = availability(engine).version
    absent = missing_source(entry)
    if absent:
        return Apart(Qualification(entry.spec.name, engine, version, "absent", (), absent), None, absent)
    with tempfile.TemporaryDirectory() as folder:
        out, job = Path(folder) / "out.json", Path(folder) / "job.json"
        asked = None if durations is None else list(durations)
        job.write_text(
            json.dumps(
                {
                    "robot": robot,
                    "engine": engine,
                    "durations": asked,
                    "size": size,
                    "out": str(out),
                    "picture": None if picture is None else str(picture.resolve()),
                }
            ),
            encoding="utf-8",
        )
        cause, told = _run("anysim_robots.qualify.worker", str(job), limit)
        answer = json.loads(out.read_text(encoding="utf-8")) if out.is_file() else {}
    drawn = picture if picture is not None and picture.is_file() and not answer.get("undrawn") else None
    undrawn = "" if picture is None or drawn is not None else answer.get("undrawn") or cause
    if "error" in answer:
        raise AnysimError(answer["error"])
    if durations is None:
        return Apart(None, drawn, undrawn)
    if "found" in answer:
        return Apart(from_data(answer["found"]), drawn, undrawn)
    at = next((word for word in reversed(told) if word in CHECKS), "build")
    failed = Check(at, False, words=cause)
    return Apart(Qualification(entry.spec.name, engine, version, "failed", (failed,)), drawn, undrawn)


def _run(module: str, job: str, limit: float) -> tuple[str, list[str]]:
    """What became of the process of a job, and what it said on its way."""
    ended = run_module(module, job, limit=limit)
    if not ended.trouble:
        return "", ended.out.split()
    last = next((f": {line}" for line in reversed(ended.err.splitlines()) if line.strip()), "")
    return f"its process {ended.trouble}{last}", ended.out.split()

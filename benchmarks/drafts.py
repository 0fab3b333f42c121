"""Drafts of all robots of some packages: imported, built, held still and read back on each engine.

    python benchmarks/drafts.py [NAME=FOLDER...] [--json docs/drafts.json] [--only WORD]

Without folders: the URDF files of pybullet_data and example-robot-data, and the robots of mani_skill and robosuite
where those are installed. Each file goes the way of `anysim robot import FILE`: a draft, which is then qualified on
each engine in a process of its own, with 2 s of holding. It goes on where it was stopped: what the JSON has is kept,
unless `--again` is given. `--engines none` imports and drafts alone, which takes minutes where engines take an hour.
`NAME=FOLDER` gives a package that is not installed. `scripts/importing_table.py` writes the table from the JSON.
"""

import argparse
import json
import multiprocessing
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from importlib import import_module, metadata
from importlib.util import find_spec
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from anysim.assets.uri import example_robot_data
from anysim.errors import AnysimError
from anysim_processes.own_process import how_it_ended
from anysim_robots.drafting.draft import draft
from anysim_robots.qualify.result import Qualification
from anysim_robots.qualify.run import Durations, qualify

ENGINES = ("mujoco", "pybullet", "sapien")
DURATIONS = Durations(2.0, 0.0)
LIMIT = 240.0
"""[s] of wall-clock time for one file on all engines."""
PACKAGES = {"pybullet": "pybullet_data", "mani_skill": "mani_skill", "robosuite": "robosuite"}
"""Distributions, and the Python packages that hold their files."""
LOADED = ("pinocchio", "lxml.etree", "trimesh", "scipy.spatial", "yourdfpy", "mujoco", "anysim_mujoco.mjcf")
"""What readers and engines import when they need it, which each process would do anew; and the engines themselves."""
PATTERNS = {
    "pybullet": ("**/*.urdf",),
    "example-robot-data": ("**/*.urdf",),
    "mani_skill": ("assets/robots/**/*.urdf",),
    "robosuite": ("models/assets/**/*.urdf", "models/assets/robots/*/robot.xml", "models/assets/grippers/*.xml"),
}


def folders(given: list[str]) -> dict[str, tuple[Path, str]]:
    """By distribution the folder of its files, and the version; of those that are here."""
    found: dict[str, tuple[Path, str]] = {}
    for words in given:
        name, _, folder = words.partition("=")
        found[name] = (Path(folder).resolve(), "")
    if found:
        return found
    found["example-robot-data"] = (example_robot_data(), metadata.version("example-robot-data"))
    for name, package in PACKAGES.items():
        spec = find_spec(package)
        if spec is not None and spec.submodule_search_locations:
            found[name] = (Path(spec.submodule_search_locations[0]), metadata.version(name))
    return found


def files(name: str, folder: Path) -> Iterator[Path]:
    """Model files of a package, sorted; the thousand random objects of pybullet_data are in none of them."""
    for pattern in PATTERNS[name]:
        yield from (file for file in sorted(folder.glob(pattern)) if "random_urdfs" not in file.parts)


def uri(name: str, folder: Path, file: Path) -> str:
    """What names a file of a package."""
    inside = file.relative_to(folder)
    return f"example-robot-data:{inside}" if name == "example-robot-data" else f"package:{PACKAGES[name]}/{inside}"


def work(source: str, target: Path, engines: Sequence[str], report: Connection) -> None:
    """In a process of its own: the draft, and what each engine makes of it, told as it comes."""
    begun = time.process_time()
    try:
        made = draft(source)
    except AnysimError as error:
        report.send({"refused": str(error)})
        return
    except Exception as error:  # noqa: BLE001  a fault of the importer is what this looks for
        report.send({"refused": f"{type(error).__name__}: {error}", "fault": True})
        return
    target.write_text(made.text(target.parent), encoding="utf-8")
    guess, model = made.guess, made.model
    report.send(
        {
            "category": guess.category,
            "base": "floating" if guess.floating else "fixed",
            "joints": len(model.joints),
            "notes": len(model.report),
            "seconds": round(time.process_time() - begun, 1),
        }
    )
    for engine in engines:
        report.send({"at": engine})
        try:
            report.send({"engine": engine, **told(qualify(str(target), engine, DURATIONS))})
        except Exception as error:  # noqa: BLE001  whatever breaks is the answer to the question
            report.send({"engine": engine, "status": "failed", "why": {"build": f"{type(error).__name__}: {error}"}})


def told(found: Qualification) -> dict[str, Any]:
    """A row of one engine: what passed, how far it moved, and why what failed did."""
    checks = {check.name: check for check in found.checks}
    why = {check.name: check.words for check in found.failed}
    row: dict[str, Any] = {
        "status": found.status,
        "passed": [name for name, c in checks.items() if c.passed],
        "why": why,
    }
    if found.why:
        row["why"]["source"] = found.why
    for name, key in (("hold", "moved"), ("kinematics", "frames")):
        if name in checks and checks[name].figure is not None:
            row[key] = float(f"{checks[name].figure:.2g}")
    return row


def tried(source: str, folder: Path, engines: Sequence[str]) -> dict[str, Any]:
    """What became of one file; a process that crashes or hangs is the answer for the engine that it was at."""
    row: dict[str, Any] = {"engines": {}}
    ours, theirs = multiprocessing.Pipe(duplex=False)
    process = multiprocessing.get_context("fork").Process(
        target=work, args=(source, folder / "draft.yaml", engines, theirs)
    )
    process.start()
    theirs.close()
    end, at = time.monotonic() + LIMIT, ""
    while ours.poll(max(0.0, end - time.monotonic())):
        try:
            message = ours.recv()
        except EOFError:
            break
        if "at" in message:
            at = message["at"]
        elif "engine" in message:
            row["engines"][message.pop("engine")] = message
        else:
            row |= message
    else:
        process.kill()
    process.join()
    if "refused" in row or len(row["engines"]) == len(engines):
        return row
    trouble = "took too long" if time.monotonic() >= end else how_it_ended(process.exitcode or 0)
    if not at:
        return {"refused": f"the importer's process {trouble}", "fault": True}
    row["engines"][at] = {"status": "failed", "passed": [], "why": {"build": f"its process {trouble}"}}
    for engine in engines[engines.index(at) + 1 :]:
        row["engines"][engine] = {"status": "failed", "passed": [], "why": {"build": f"not reached, after {at}"}}
    return row


def main() -> int:
    """Try all files, and write the JSON after each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="*", metavar="NAME=FOLDER")
    parser.add_argument("--json", type=Path, default=Path(__file__).parents[1] / "docs" / "drafts.json")
    parser.add_argument("--only", default="", help="files whose URI has this in it")
    parser.add_argument("--again", action="store_true", help="measure what is there already, too")
    parser.add_argument("--engines", default=",".join(ENGINES), help="separated by commas, or none: imports alone")
    options = parser.parse_args()
    stored = json.loads(options.json.read_text("utf-8")) if options.json.is_file() else {"versions": {}, "files": {}}
    wanted = [] if options.engines == "none" else options.engines.split(",")
    for module in (*LOADED, *wanted):  # once, before the processes begin
        if find_spec(module) is not None:
            import_module(module)
    for name, (folder, version) in folders(options.folders).items():
        stored["versions"][name] = version or stored["versions"].get(name, "")
        for file in files(name, folder):
            source = uri(name, folder, file)
            known = stored["files"].get(source, {"engines": {}})
            done = "refused" in known or all(engine in known["engines"] for engine in wanted)
            if options.only not in source or (done and source in stored["files"] and not options.again):
                continue
            with tempfile.TemporaryDirectory() as made:
                row = tried(source, Path(made), wanted)
            text = json.dumps(row).replace(str(folder), f"<{name}>")
            stored["files"][source] = row = json.loads(text)
            ordered = {"versions": stored["versions"], "files": dict(sorted(stored["files"].items()))}
            options.json.write_text(json.dumps(ordered, indent=1) + "\n", "utf-8")
            engines = row.get("engines", {})
            verdicts = " ".join(f"{engine}:{one['status']}{list(one['why']) or ''}" for engine, one in engines.items())
            print(source, row.get("refused", verdicts)[:200], flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())

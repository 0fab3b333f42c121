"""Faults of whole runs: what only several trajectories, their run.json, and what lies beside them show."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from anysim.errors import AnysimError, RecordError, listing
from anysim.record.header import RunHeader, package_versions
from anysim.record.incoming import FileLock
from anysim.record.manifest import Manifest, read_manifest, read_run
from anysim.record.names import EPISODES, INCOMING, RUN_FILE, owner_of, parse_trajectory
from anysim_inspect.verify import verify

SHOWN = 3
"""Names that a sentence lists of what was left."""


@dataclass
class RunCheck:
    """What was found in one run, or in single trajectories of it that were named.

    Attributes:
        run: its directory.
        trajectories: the faults of each that was looked at, by its path.
        faults: what is wrong with the run as a whole.
        left: what processes that died have left half written, and what to do about it.
        notes: what could not be found out, and why.
        steps: control steps of the trajectories that are whole.
    """

    run: Path
    trajectories: dict[Path, list[str]] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)
    left: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    steps: int = 0

    @property
    def damaged(self) -> int:
        """Trajectories with a fault."""
        return sum(map(bool, self.trajectories.values()))

    @property
    def whole(self) -> bool:
        """Whether nothing is at fault."""
        return not self.faults and not self.damaged


def verify_all(
    paths: Iterable[Path],
    *,
    base: Path | None = None,
    again: Callable[[Path], list[str]] | None = None,
    done: Callable[[Path, list[str]], object] = lambda path, faults: None,
) -> list[RunCheck]:
    """Verify trajectories, and the runs that they are of.

    Args:
        paths: of committed trajectories.
        base: the folder of the recorded file, where its world refers to assets by relative paths.
        again: a further look at a trajectory that is whole, as a replay of it: its faults.
        done: called with each trajectory that was looked at, and its faults.

    Raises:
        PluginError: the reader of a trajectory is not installed.
    """
    checks: dict[Path, RunCheck] = {}
    manifests: dict[Path, dict[Path, Manifest]] = {}
    for path in paths:
        run = _run_of(path)
        check = checks.setdefault(run, RunCheck(run))
        faults = verify(path)
        if not faults:
            manifest = manifests.setdefault(run, {})[path] = read_manifest(path)
            faults = _strangers(run, path, manifest) or ([] if again is None else again(path))
            check.steps += 0 if faults else manifest.steps
        check.trajectories[path] = faults
        done(path, faults)
    for run, check in checks.items():
        known = manifests.get(run, {})
        check.faults += twice(known)
        for manifest in _different_worlds(known.values()):
            fault, note = world_fault(manifest, base)
            check.faults += [fault] if fault else []
            check.notes += [note] if note else []
        check.left += leftovers(run)
    return list(checks.values())


def _run_of(path: Path) -> Path:
    """The directory of the run that a trajectory is in; that of the trajectory where it is in none."""
    parent = path.resolve().parent
    return path.parent.parent if parent.name == EPISODES and parse_trajectory(path.name) is not None else path


def _strangers(run: Path, path: Path, manifest: Manifest) -> list[str]:
    """What a trajectory says of its run otherwise than run.json does."""
    if not (run / EPISODES).is_dir() and not (run / RUN_FILE).exists():
        return []  # a trajectory that was copied out of its run
    try:
        record = read_run(run)
    except RecordError as error:
        return [str(error)]
    differing = [name for name in RunHeader.model_fields if getattr(record, name) != getattr(manifest, name)]
    return [f"{path} is of another run: {listing(differing)} is not that of {run / RUN_FILE}"] if differing else []


def twice(manifests: Mapping[Path, Manifest]) -> list[str]:
    """Episodes that two trajectories of a run claim to hold."""
    seen: dict[tuple[int, int], Path] = {}
    found: list[str] = []
    for path, manifest in manifests.items():
        first = seen.setdefault((manifest.env, manifest.episode), path)
        if first != path:
            found.append(f"{path} and {first} both hold env {manifest.env}, episode {manifest.episode}; remove one")
    return found


def _different_worlds(manifests: Iterable[Manifest]) -> list[Manifest]:
    """One manifest for each recorded spec and world."""
    found: list[Manifest] = []
    for manifest in manifests:
        if not any(one.world_hash == manifest.world_hash and one.spec == manifest.spec for one in found):
            found.append(manifest)
    return found


def world_fault(manifest: Manifest, base: Path | None = None) -> tuple[str, str]:
    """Whether the recorded spec gives the world of the recorded hash: a fault and a note, each empty if there is none.

    Another hash is a fault where the same versions are installed that recorded it; else the world may have been built
    otherwise then, which is no damage.
    """
    from anysim.api import compile_world

    where = f"the world of '{manifest.task}'"
    if not manifest.spec:
        return "", f"{where} was not built again: no spec was recorded"
    try:
        found = compile_world(manifest.spec, base=base).hash
    except AnysimError as error:
        return "", f"{where} was not built again, so its hash was not compared: {error}"
    if found == manifest.world_hash:
        return "", ""
    others = _others(manifest.packages)
    text = f"{where} that its spec gives has the hash {found[:12]}…; {manifest.world_hash[:12]}… was recorded"
    if others:
        return "", f"{text}, with other versions of {listing(others, SHOWN)}"
    return f"{text} with the same versions: the spec or the hash was changed", ""


def _others(recorded: Mapping[str, str]) -> list[str]:
    """The distributions whose versions are not those of the recording."""
    here = package_versions()
    return sorted(name for name, version in recorded.items() if here.get(name) != version)


def leftovers(run: Path) -> list[str]:
    """What processes that are gone have left half written beside the trajectories of a run, with the remedy.

    What a live process is writing is none: its lock is held.
    """
    found: list[str] = []
    incoming = run / INCOMING
    attempts = _dead(incoming, lambda name: owner_of(name) or "") if incoming.is_dir() else []
    if attempts:
        found.append(
            f"{incoming} holds what an interrupted run has left of {_counted(attempts, 'trajectory', 'trajectories')}: "
            f"the same `anysim run` removes it and goes on, or remove {incoming}"
        )
    episodes = run / EPISODES
    films = _dead(episodes, lambda name: name if name.endswith(".film") else "") if episodes.is_dir() else []
    if films:
        found.append(
            f"{episodes} holds what an interrupted `anysim render` has left of {_counted(films, 'film', 'films')}: "
            "the same command removes it and goes on, or remove the directory"
        )
    strangers = _strange(episodes) if episodes.is_dir() else []
    if strangers:
        found.append(f"{episodes} holds what is no trajectory: {listing(strangers, SHOWN)}; remove it")
    return found


def _dead(directory: Path, owner: Callable[[str], str]) -> list[str]:
    """The directories there whose owners hold no lock."""
    found: list[str] = []
    for entry in sorted(directory.iterdir()):
        name = owner(entry.name)
        if not name or not entry.is_dir():
            continue
        lock = directory / f"{name}.lock"
        if not lock.exists():
            found.append(entry.name)
            continue
        taken = FileLock.take(lock)
        if taken is not None:
            taken.release()
            found.append(entry.name)
    return found


def _strange(episodes: Path) -> list[str]:
    """Entries that neither a recorder nor `anysim render` makes."""
    ours = (".film", ".film.lock")
    return sorted(
        entry.name
        for entry in episodes.iterdir()
        if parse_trajectory(entry.name.removesuffix(".annotations")) is None
        and not (entry.name.startswith(".") and entry.name.endswith(ours))
    )


def _counted(names: list[str], one: str, many: str) -> str:
    return f"{len(names)} {one if len(names) == 1 else many} ({listing(names, SHOWN)})"


def as_data(check: RunCheck) -> dict[str, Any]:
    """What was found as plain data."""
    return {
        "run": str(check.run),
        "trajectories": len(check.trajectories),
        "damaged": check.damaged,
        "steps": check.steps,
        "faults": check.faults,
        "left": check.left,
        "notes": check.notes,
    }

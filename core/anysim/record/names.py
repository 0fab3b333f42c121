"""Names inside a run directory, and which names a manifest may mention."""

import hashlib
import json
import os
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from anysim.errors import RecordError

RUN_FILE = "run.json"
MANIFEST_FILE = "manifest.json"
EPISODES = "episodes"
INCOMING = ".incoming"
STARTUP_LOCK = "startup.lock"
COLLECTING = ".collecting.lock"

_TRAJECTORY = re.compile(r"env_(\d{4,9})_episode_(\d{4,9})")
_ATTEMPT = re.compile(rf"{_TRAJECTORY.pattern}\.(\d+-\d+)")
_OWNER_LOCK = re.compile(r"(\d+-\d+)\.lock")
_FILE = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,127}")


def run_name(task: str, engine: str, spec: Mapping[str, Any], seed: int) -> str:
    """A directory for what is run: the same spec and seed give the same name, any other spec another one."""
    digest = hashlib.sha256(json.dumps([spec, seed]).encode()).hexdigest()
    return f"{task}-{engine}-seed{seed}-{digest[:8]}"


def trajectory_name(env: int, episode: int) -> str:
    """`env_0003_episode_0002`."""
    return f"env_{env:04d}_episode_{episode:04d}"


def parse_trajectory(name: str) -> tuple[int, int] | None:
    """(env, episode) of a directory's name, or None if it is not the name of a trajectory."""
    found = _TRAJECTORY.fullmatch(name)
    return None if found is None else (int(found[1]), int(found[2]))


def attempt_name(env: int, episode: int, owner: str) -> str:
    """The name of a trajectory while the recorder `owner` writes it."""
    return f"{trajectory_name(env, episode)}.{owner}"


def owner_of(name: str) -> str | None:
    """The recorder that an entry of the incoming directory belongs to, or None if it is not a recorder's."""
    found = _ATTEMPT.fullmatch(name)
    if found is not None:
        return found[3]
    found = _OWNER_LOCK.fullmatch(name)
    return None if found is None else found[1]


def checked_file_name(name: str) -> str:
    """The name of a file directly in a trajectory: it names no other directory and hides nothing.

    Raises:
        RecordError: the name could leave the directory, or is reserved.
    """
    if _FILE.fullmatch(name) is None or name == MANIFEST_FILE:
        raise RecordError(
            f"{name!r} cannot be a file of a trajectory; letters, digits, '_', '.' and '-' are allowed, the first one "
            f"a letter or digit, and {MANIFEST_FILE} is taken"
        )
    return name


def find_trajectories(directories: Iterable[Path]) -> list[Path]:
    """The committed trajectories that are meant by directories of trajectories and of runs, in order.

    Raises:
        RecordError: a directory is neither.
    """
    found: list[Path] = []
    for directory in directories:
        inside = [directory] if (directory / MANIFEST_FILE).exists() else trajectories(directory)
        if not inside:
            raise RecordError(f"{directory} holds no trajectory; expected a directory with a {MANIFEST_FILE}, or a run")
        found.extend(inside)
    return found


def trajectories(run: Path) -> list[Path]:
    """The committed trajectories of a run, sorted by name; empty where there are none."""
    episodes = run / EPISODES
    if not episodes.is_dir():
        return []
    with os.scandir(episodes) as entries:
        names = [entry.name for entry in entries if parse_trajectory(entry.name) is not None and entry.is_dir()]
    return [episodes / name for name in sorted(names)]

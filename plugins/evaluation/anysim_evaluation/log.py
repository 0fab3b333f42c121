"""Logs of episodes: one line each, on the disk before the next is looked at, so that an evaluation can go on."""

import json
import os
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import NamedTuple, Self

from anysim.errors import RecordError
from anysim.record.incoming import claim
from anysim.task.env import TaskEnv
from anysim.task.snapshot import spec_hash
from anysim_evaluation.driver import Episode
from anysim_evaluation.policy import Policy

FORMAT = "anysim-evaluation-1"
FILE = "episodes.jsonl"


def identity(env: TaskEnv, policy: str, driven: Policy, privileged: bool) -> dict[str, str]:
    """What an episode's outcome depends on, besides its seed; `policy` is what `driven` was made of."""
    return {
        "task": env.name,
        "spec": spec_hash(env.spec),
        "world": env.engine.world.hash,
        "engine": f"{env.engine.name} {env.engine.version}",
        "policy": " ".join([policy, *(["(privileged)"] if privileged else []), getattr(driven, "version", "")]).strip(),
    }


class Logged(NamedTuple):
    """What a log holds: what was evaluated, the episodes by seed, and how many bytes of it are whole lines."""

    what: Mapping[str, str]
    episodes: dict[int, Episode]
    length: int


def read_log(path: Path) -> Logged:
    """The whole lines of a log; nothing where there is none.

    Raises:
        RecordError: it is no log of episodes.
    """
    lines = (path.read_bytes() if path.exists() else b"").split(b"\n")[:-1]
    try:
        data = [json.loads(line) for line in lines]
        what: dict[str, str] = data[0] if data else {}
        episodes = {row["seed"]: Episode(**row) for row in data[1:]}
    except (ValueError, TypeError, KeyError) as error:
        raise RecordError(f"{path} is no log of episodes: {error}; evaluate into another directory") from None
    return Logged(what, episodes, sum(len(line) + 1 for line in lines))


class EpisodeLog:
    """The episodes of one policy on one engine, by seed. Use it as a context manager: one process writes at a time."""

    def __init__(self, directory: Path, what: Mapping[str, str]) -> None:
        """`what` was evaluated, in words: episodes of anything else are not mixed with these.

        Raises:
            RecordError: the directory has episodes of something else, or another process writes there.
        """
        self._path = directory / FILE
        self._lock = claim(directory)
        try:
            self.episodes = self._read({"format": FORMAT, **what})
        except BaseException:
            self._lock.release()
            raise
        self._file = self._path.open("ab")

    def _read(self, what: Mapping[str, str]) -> dict[int, Episode]:
        """The episodes that are there; a line that a killed process left unfinished is cut off."""
        theirs, episodes, length = read_log(self._path)
        if not theirs:
            self._path.write_bytes((json.dumps(what) + "\n").encode())
            return {}
        if theirs != what:
            differing = sorted(key for key in {*theirs, *what} if theirs.get(key) != what.get(key))
            words = ", ".join(f"{key} {theirs.get(key)!r} and now {what.get(key)!r}" for key in differing)
            raise RecordError(f"{self._path} has episodes of something else: {words}; evaluate into another directory")
        with self._path.open("r+b") as file:
            file.truncate(length)
        return episodes

    def add(self, episode: Episode) -> None:
        """Keep an episode; it is on the disk when this returns."""
        self._file.write((json.dumps(asdict(episode)) + "\n").encode())
        self._file.flush()
        os.fsync(self._file.fileno())
        self.episodes[episode.seed] = episode

    def __enter__(self) -> Self:
        """The log itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file, and let others write."""
        self._file.close()
        self._lock.release()

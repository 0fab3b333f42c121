"""Logs of episodes: one line each, on the disk before the next is looked at, so that an evaluation can go on."""

import json
import os
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Self

from anysim.errors import RecordError
from anysim.record.incoming import claim
from anysim_evaluation.driver import Episode

FORMAT = "anysim-evaluation-1"
FILE = "episodes.jsonl"


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
        whole = self._path.read_bytes() if self._path.exists() else b""
        lines = whole.split(b"\n")
        try:
            data = [json.loads(line) for line in lines[:-1]]
            theirs: dict[str, Any] = data[0] if data else {}
            episodes = {row["seed"]: Episode(**row) for row in data[1:]}
        except (ValueError, TypeError, KeyError) as error:
            raise RecordError(f"{self._path} is no log of episodes: {error}; evaluate into another directory") from None
        if not data:
            self._path.write_bytes((json.dumps(what) + "\n").encode())
            return {}
        if theirs != what:
            differing = sorted(key for key in {*theirs, *what} if theirs.get(key) != what.get(key))
            words = ", ".join(f"{key} {theirs.get(key)!r} and now {what.get(key)!r}" for key in differing)
            raise RecordError(f"{self._path} has episodes of something else: {words}; evaluate into another directory")
        if lines[-1]:
            with self._path.open("r+b") as file:
                file.truncate(len(whole) - len(lines[-1]))
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

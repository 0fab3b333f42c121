"""Tallies: what became of the episodes of a collection; the live table, the report and its page show them."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from anysim.math.statistics import wilson
from anysim_recording.collector import EpisodeResult


@dataclass
class CommandTally:
    """One command of the episodes, or the expert that did all: how often it was begun, and how often it succeeded."""

    name: str
    skill: str
    begun: int = 0
    succeeded: int = 0
    failures: Counter[str] = field(default_factory=Counter)


@dataclass
class Tally:
    """Counts of episodes.

    Attributes:
        attempts: episodes that were run to their ends; those that lost every worker are in `lost` alone.
        kept: trajectories on the disk; `resumed` of them were there before.
        segments: in those that are kept; an expert's episode is one.
        failures: by type.
        ladder: rungs that were climbed, by what had failed: `no_ik -> candidate`.
        commands: by number and name, in order.
    """

    attempts: int = 0
    successes: int = 0
    kept: int = 0
    segments: int = 0
    kept_bytes: int = 0
    resumed: int = 0
    lost: int = 0
    faults: int = 0
    steps: int = 0
    failures: Counter[str] = field(default_factory=Counter)
    ladder: Counter[str] = field(default_factory=Counter)
    commands: dict[str, CommandTally] = field(default_factory=dict)

    def add(self, result: EpisodeResult, size: int = 0) -> None:
        """Count an episode that has ended; `size` [bytes] of its trajectory, if one was kept."""
        if result.lost:
            self.lost += 1
            return
        self.attempts += 1
        self.successes += result.success
        if result.path is not None:
            self.kept += 1
            self.segments += len(result.outcome.get("segments", ())) if "command" in result.outcome else 1
        self.kept_bytes += size
        self.resumed += result.resumed
        self.faults += bool(result.fault)
        self.steps += result.steps
        self.ladder.update(result.outcome.get("ladder", ()))
        if not result.success:
            self.failures[failure_of(result)] += 1
        self._add_commands(result)

    def _add_commands(self, result: EpisodeResult) -> None:
        outcome = result.outcome
        name, _, _ = str(outcome.get("phase", "")).partition(":")
        if "command" not in outcome:
            skill = str(outcome.get("skill", ""))
            if skill:
                self._count(skill, skill, result.success, failure_of(result))
            return
        verified = {segment["command"]: segment["skill"] for segment in outcome.get("segments", ())}
        for number, skill in verified.items():
            self._count(f"{number} {skill}", skill, True, "")
        if not result.success and outcome["command"] not in verified:
            self._count(name, name.partition(" ")[2], False, failure_of(result))

    def _count(self, name: str, skill: str, success: bool, failure: str) -> None:
        command = self.commands.setdefault(name, CommandTally(name, skill))
        command.begun += 1
        command.succeeded += success
        if not success:
            command.failures[failure] += 1

    def to_dict(self) -> dict[str, Any]:
        """Plain data: counts, shares and their 95 % intervals."""
        return {
            "attempts": self.attempts,
            "successes": self.successes,
            "interval": list(wilson(self.successes, self.attempts)),
            "kept": self.kept,
            "segments": self.segments,
            "kept_bytes": self.kept_bytes,
            "resumed": self.resumed,
            "lost": self.lost,
            "faults": self.faults,
            "steps": self.steps,
            "failures": ordered(self.failures),
            "ladder": ordered(self.ladder),
            "commands": [
                {
                    "command": one.name,
                    "skill": one.skill,
                    "begun": one.begun,
                    "succeeded": one.succeeded,
                    "interval": list(wilson(one.succeeded, one.begun)),
                    "failures": ordered(one.failures),
                }
                for one in sorted(self.commands.values(), key=_place)
            ],
        }


def failure_of(result: EpisodeResult) -> str:
    """The type of a failure: that of its skill where it has one, else how the episode ended."""
    if result.fault:
        return "fault"
    outcome = str(result.outcome.get("outcome", ""))
    return outcome if outcome not in ("", "running", "ok") else result.status


def ordered(counts: Mapping[str, int]) -> dict[str, int]:
    """The largest first, then by name."""
    return dict(sorted(counts.items(), key=lambda item: (-item[1], item[0])))


def _place(command: CommandTally) -> tuple[int, str]:
    number = command.name.partition(" ")[0]
    return (int(number) if number.isdigit() else 0, command.name)

"""Segments of episodes: stretches in which a skill did one thing, from what it says step by step."""

from collections.abc import Hashable, Iterator, Mapping, Sequence
from typing import Any, Literal

import numpy as np

from anysim.task.bindings import Variants
from anysim.task.env import TaskEnv
from anysim_annotation.api import Record, SegmentAnnotator
from anysim_annotation.view import NOTHING, Segment, View
from anysim_schemas.collect import written_out

Kind = Literal["skill", "phase"]
SEGMENT_KEYS = ("skill", "phase", "command", "attempt", "first_step", "last_step")
"""The first keys of every record of a segment."""


class Intentions:
    """Parameters of the commands of an env, or of its task's expert: what each of its skills is for."""

    def __init__(self, env: TaskEnv) -> None:
        task, collect = env.spec.task, env.spec.collect
        self._env = env
        self._variants: list[Variants] = []
        if collect is not None:
            found = written_out(collect.commands, "collect.commands")
            self._variants = [env.bindings.variants(spec.params, path) for spec, path in found]
        self._expert: Mapping[str, Any] = task.expert.params if task is not None and task.expert is not None else {}
        self._commands = collect is not None

    def params(self, said: Mapping[str, Any], env: int) -> Mapping[str, Any]:
        """The parameters of what an env is doing, with the values of its episode; empty where none are known."""
        if not self._commands:
            return self._expert
        number = int(said.get("command", 0)) - 1
        if not 0 <= number < len(self._variants):
            return NOTHING
        names, params = self._variants[number]
        return params[int(self._env.bindings.which(names, np.array([env]))[0])]


def skill_of(said: Mapping[str, Any]) -> str:
    """The skill that acts: of a sequence the member, with its number where it is a command."""
    member = str(said.get("phase", "")).rpartition(": ")[0]
    return member or str(said.get("skill", ""))


class SegmentLog:
    """Open segments of the envs of a camera. A segment ends where its env says something else, or its episode ends."""

    def __init__(self, annotators: Mapping[str, SegmentAnnotator], intentions: Intentions | None) -> None:
        self.annotators, self._intentions = annotators, intentions
        self._kinds: tuple[Kind, ...] = tuple(dict.fromkeys(annotator.by for annotator in annotators.values()))
        self._open: dict[tuple[int, str], tuple[Hashable, View, View]] = {}

    def follow(self, view: View) -> list[tuple[int, str, Sequence[Record]]]:
        """Look at a step; labels of the segments that ended before it: (env, annotator, records)."""
        ended = list[tuple[int, str, Sequence[Record]]]()
        for row, env in enumerate(view.env_ids.tolist()):
            one = view.row(row)
            said = one.said[0] if one.said else NOTHING
            for by in self._kinds:
                key, found = _key(said, by), self._open.get((env, by))
                if found is not None and found[0] == key:
                    self._open[env, by] = (key, found[1], one)
                    continue
                ended += self._close(env, by)
                if key is not None:
                    self._open[env, by] = (key, one, one)
        return ended

    def finish(self, envs: Sequence[int]) -> list[tuple[int, str, Sequence[Record]]]:
        """End the segments of envs whose episodes have ended."""
        return [found for env in envs for by in self._kinds for found in self._close(env, by)]

    def forget(self, envs: Sequence[int]) -> None:
        """Drop what is open in envs whose episodes begin."""
        self._open = {key: value for key, value in self._open.items() if key[0] not in envs}

    def _close(self, env: int, by: Kind) -> Iterator[tuple[int, str, Sequence[Record]]]:
        found = self._open.pop((env, by), None)
        if found is None:
            return
        _, first, last = found
        said = last.said[0]
        params = NOTHING if self._intentions is None else self._intentions.params(said, env)
        phase, command = str(said.get("phase", "")), int(said.get("command", 0))
        segment = Segment(skill_of(said), phase, command, int(said.get("attempt", 0)), params, first, last)
        head = dict(zip(SEGMENT_KEYS, (*segment[:4], int(first.steps[0]), int(last.steps[0])), strict=True))
        for name, annotator in self.annotators.items():
            if annotator.by == by and (records := annotator.label(segment)):
                yield env, name, [head | dict(record) for record in records]


def _key(said: Mapping[str, Any], by: Kind) -> Hashable:
    if not said:
        return None
    what = said.get("phase") if by == "phase" else skill_of(said)
    return said.get("skill"), what, said.get("command"), said.get("attempt")

"""CurriculumManager: how much of their spread values are drawn from, by an env's own success rate."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.engine.snapshots.row_checks import refuse_range
from anysim.errors import SpecError, listing, suggest
from anysim.managers.base import WORLD, Manager, Overridable
from anysim.model.world import World
from anysim.randomization.draw import is_random
from anysim.randomization.streams import Narrowing, Origin
from anysim_schemas.errors import SpecIssue
from anysim_schemas.task import CurriculumSpec


class CurriculumManager(Manager):
    """Moves the level of each `task.curriculum` entry in steps, after as many finished episodes as it says.

    An env counts its own episodes alone, so what it draws does not depend on the other envs.
    """

    name = "curriculum"

    def build(self, world: World) -> None:
        task = self.spec.task
        self._specs: dict[str, CurriculumSpec] = {} if task is None or task.curriculum is None else task.curriculum
        n = self.streams.num_envs
        self.level = {name: np.full(n, spec.start) for name, spec in self._specs.items()}
        """(N,) the share of the spread that each env draws from, by the name of the entry."""
        self._tried = {name: np.zeros(n, dtype=np.int64) for name in self._specs}
        self._won = {name: np.zeros(n, dtype=np.int64) for name in self._specs}
        self._recalled: dict[int, dict[str, float]] = {}

    def narrow(self, values: Mapping[str, Overridable]) -> None:
        """Have the streams draw from as much of the values as the levels say.

        Args:
            values: all that may be set for an episode, by path.

        Raises:
            SpecError: an entry names what is not drawn at resets, or what another one has.
        """
        drawn = {path: value for path, value in values.items() if is_random(getattr(value.holder, value.key))}
        issues: list[SpecIssue] = []
        for name, spec in self._specs.items():
            for place, path in enumerate(spec.widens):
                found = drawn.get(path.removeprefix(WORLD))
                where = f"task.curriculum.{name}.widens.{place}"
                if found is None and self.spec.level is not None and self._fixed(path):
                    continue
                if found is None:
                    words = f"'{path}' is not drawn in each episode{suggest(path, list(drawn)) or '.'} What is: "
                    issues.append(SpecIssue("", where, words + (listing(drawn, 40) or "nothing in this task")))
                elif found.source in self.streams.narrowed:
                    issues.append(SpecIssue("", where, f"'{path}' is widened twice; leave one of the two out"))
                else:
                    self.streams.narrowed[found.source] = Narrowing(self.level[name], spec.around)
        if issues:
            raise SpecError(issues)

    def _fixed(self, path: str) -> bool:
        """Whether a path leads to a constant, which the chosen level may have made of what is drawn in others."""
        said = self.spec.to_dict()
        part: Any = {**said["world"], **said}
        for key in path.split("."):
            if not isinstance(part, Mapping) or key not in part:
                return False
            part = part[key]
        return True

    def recall(self, env: int, drawn: Mapping[str, Any]) -> None:
        """A level follows from earlier episodes; the record of this one says it."""
        self._recalled[env] = {n: float(drawn[f"curriculum/{n}"]) for n in self._specs if f"curriculum/{n}" in drawn}

    def reset(self, env_ids: Array) -> None:
        """Count the episodes that have ended here, and move the levels that are due."""
        ended = env_ids[self.episodes.code[env_ids] > 0]
        recalled = {env: self._recalled.pop(env, {}) for env in env_ids.tolist()}
        for name, spec in self._specs.items():
            level, tried, won = self.level[name], self._tried[name], self._won[name]
            tried[ended] += 1
            won[ended] += self.episodes.succeeded[ended]
            due = ended[tried[ended] >= spec.episodes]
            rate = won[due] / spec.episodes
            moved = level[due] + spec.step * ((rate >= spec.promote).astype(float) - (rate < spec.demote))
            level[due], tried[due], won[due] = np.clip(moved, 0.0, 1.0), 0, 0
            for env in env_ids.tolist():
                level[env] = recalled[env].get(name, level[env])
                self.streams.note(env, f"curriculum/{name}", float(level[env]), Origin("", f"task.curriculum.{name}"))

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        kept = {"level": self.level, "tried": self._tried, "won": self._won}
        return {f"{what}.{name}": rows[env_ids] for what, of in kept.items() for name, rows in of.items()}

    def refuse_rows(self, data: Mapping[str, Array]) -> None:
        for name, spec in self._specs.items():
            refuse_range(f"level.{name}", data[f"level.{name}"], 0.0, 1.0)
            for what in ("tried", "won"):
                refuse_range(f"{what}.{name}", data[f"{what}.{name}"], 0, spec.episodes)

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        for name in self._specs:
            self.level[name][env_ids] = data[f"level.{name}"]
            self._tried[name][env_ids], self._won[name][env_ids] = data[f"tried.{name}"], data[f"won.{name}"]

"""History of an env's episode since its reset: what was done at each control step, and where things were."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from anysim.conventions import Array
from anysim.task.env import TaskEnv


@dataclass(frozen=True)
class History:
    """The episode so far. Step 0 is the reset.

    Attributes:
        episode_seed: of the episode.
        drawn, overridden: what was drawn in it, and set in place of draws.
        actions: (A,) of each control step.
        poses, joints: (B, 7) and (J,) at the reset and after each step.
        doings: what the commands said in each step, numbered through the episode.
        commands: those that were given so far, each a skill and its parameters.
    """

    episode_seed: int
    drawn: Mapping[str, Any]
    overridden: Mapping[str, Any]
    actions: list[Array] = field(default_factory=list)
    poses: list[Array] = field(default_factory=list)
    joints: list[Array] = field(default_factory=list)
    doings: list[Mapping[str, Any]] = field(default_factory=list)
    commands: list[tuple[str, Mapping[str, Any]]] = field(default_factory=list)

    @classmethod
    def begun(cls, env: TaskEnv, number: int) -> "History":
        """That of an episode which has just begun in an env."""
        streams = env.streams
        drawn, overridden = dict(streams.draws[number]), dict(streams.overridden[number])
        history = cls(int(streams.episode_seed[number]), drawn, overridden)
        history._see(env, number)
        return history

    def add(self, env: TaskEnv, number: int, action: Array, doing: Mapping[str, Any]) -> None:
        """A control step was made."""
        self.actions.append(action.copy())
        self.doings.append(doing)
        self._see(env, number)

    def _see(self, env: TaskEnv, number: int) -> None:
        state = env.engine.get_state()
        self.poses.append(state.body_pose[number].copy())
        self.joints.append(state.joint_pos[number].copy())

    def copy(self, **others: Any) -> "History":
        """One that goes on by itself."""
        lists = {name: list(getattr(self, name)) for name in ("actions", "poses", "joints", "doings", "commands")}
        return replace(self, **(lists | others))

    def __len__(self) -> int:
        return len(self.actions)

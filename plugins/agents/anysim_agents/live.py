"""Commands that come from outside while an episode runs: the same skills, given one list after the other."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from anysim.controllers.base import Controller
from anysim.conventions import Array
from anysim.errors import SpecError, SpecIssue
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.commands import CommandSequence
from anysim.skills.phases import GO_ON, STAY, Mover, MovingSkill
from anysim.skills.runner import bind_skill
from anysim.task.env import TaskEnv
from anysim_schemas.collect import CollectSpec

PATH = "commands"
"""Where the errors of commands point to: `commands.0.object`."""


class LiveCommands(MovingSkill):
    """What an env does is the list of commands that it was given last.

    What a command of this episode has moved is held by the later ones, as between the commands of a file.

    Attributes:
        movers: all that commands have moved so far.
    """

    def __init__(self, env: TaskEnv) -> None:
        super().__init__(env)
        self.phases = (PATH,)
        self.movers: tuple[Mover, ...] = ()
        self.given: list[CommandSequence | None] = [None] * env.num_envs
        self.outcome[:] = GO_ON
        low, high = env.action_bounds
        self._still = np.clip(np.zeros((env.num_envs, env.action_dim)), low, high)
        """The action (N, A) that lets every channel hold what it had when the env was reset."""

    def bound(self, commands: CollectSpec) -> CommandSequence:
        """Commands with their names looked up in this world.

        Raises:
            SpecError: at `commands.0.object`, a parameter that is wrong or names nothing here.
        """
        try:
            sequence = CommandSequence(commands, self.env, bind_skill, PATH)
        except SpecError as error:
            raise SpecError([SpecIssue("", issue.path, issue.message) for issue in error.issues]) from None
        fresh = [mover for mover in sequence.movers if mover not in self.movers]
        for mover in fresh:
            mover.renew(np.arange(self.env.num_envs))
        self.movers = (*self.movers, *fresh)
        return sequence

    def give(self, ids: Array, sequence: CommandSequence) -> None:
        """Begin with commands in these envs, in which none is under way."""
        self._prepare(ids)
        for env in ids.tolist():
            self.given[env] = sequence
        self.outcome[ids] = STAY
        sequence.start(ids)
        self._tell(ids, sequence)

    def start(self, env_ids: Array) -> None:
        """These envs are elsewhere than commands have left them: reset, or put into a snapshot's state."""
        for env in env_ids.tolist():
            self.given[env] = None
        self.outcome[env_ids] = GO_ON
        self.env.scene.look(env_ids)
        joints = self.env.scene.state.joint_pos[env_ids]
        world = self.env.engine.world
        for part in self.env.actions.slices:
            if type(part.controller).action_for is not Controller.action_for:
                own = [world.actuators[a].joint for a in part.controller.channel.actuators]
                held = part.controller.action_for(joints[:, own], env_ids)
                self._still[env_ids, part.start : part.stop] = held

    def decide(self, ids: Array, at: Array) -> None:
        for sequence in dict.fromkeys(self.given[env] for env in ids.tolist()):
            here = np.array([self.given[env] is sequence for env in ids.tolist()])
            if sequence is not None:
                sequence.decide(ids[here], at[here])
                self._tell(ids[here], sequence)

    def _tell(self, ids: Array, sequence: CommandSequence) -> None:
        self.phase[ids] = 0
        self.outcome[ids], self.attempts[ids] = sequence.outcome[ids], sequence.attempts[ids]

    def act(self, env_ids: Array, action: Array) -> None:
        """As of every skill; where commands end nothing moves, so that the next ones go on in the same control step."""
        ids = env_ids[self.outcome[env_ids] == STAY]
        self._prepare(ids)
        self.decide(ids, np.arange(len(ids)))
        self._move(ids[self.outcome[ids] == STAY], action)

    def action(self, ids: Array) -> Array:
        """The action (N, A) of the next control step of envs that have something to do.

        Only the rows of those mean anything that are under way after it.
        """
        action = self._still.copy()
        self.act(ids, action)
        return action

    def rest(self, ids: Array) -> Array:
        """The action (N, A) of envs that have nothing to do: what was moved stays where it is told to be."""
        action = self._still.copy()
        self._prepare(ids)
        self._move(ids, action)
        return action

    def _prepare(self, ids: Array) -> None:
        self.env.scene.look(ids)
        for mover in self.movers if len(ids) else ():
            mover.prepare(ids)

    def _move(self, ids: Array, action: Array) -> None:
        self.env.scene.look(ids)
        for mover in self.movers if len(ids) else ():
            mover.act(ids, action)
        for service in dict.fromkeys(service for mover in self.movers for service in mover.planners):
            service.flush()

    def under_way(self, env: int) -> bool:
        """Whether an env has something to do."""
        return bool(self.outcome[env] == STAY)

    def drop(self, ids: Array) -> None:
        """Give up what these envs are at: what moves stays where it is told to be until the next command."""
        late = ids[self.outcome[ids] == STAY]
        self.outcome[late] = OUTCOMES.index(Outcome.LOST)

    def describe(self, env: int) -> dict[str, object]:
        sequence = self.given[env]
        return {} if sequence is None else {"skill": "commands", **sequence.describe(env)}

    # ------------------------------------------------------------------ what movers remember

    def kept(self, env: int) -> list[dict[str, Any]]:
        """What movers have in their arrays for an env: how an arm holds what it holds."""
        return [{name: rows[env].copy() for name, rows in _rows(mover, len(self.given))} for mover in self.movers]

    def put(self, env: int, kept: Sequence[dict[str, Any]]) -> None:
        """What `kept` gave; movers that came later forget the env."""
        ids = np.array([env])
        self.start(ids)
        for number, mover in enumerate(self.movers):
            mover.renew(ids)
            for name, rows in _rows(mover, len(self.given)) if number < len(kept) else ():
                if name in kept[number]:
                    rows[env] = kept[number][name]


def _rows(mover: Mover, count: int) -> list[tuple[str, Array]]:
    """The arrays of a mover that have a row for each env."""
    return [(k, v) for k, v in vars(mover).items() if isinstance(v, np.ndarray) and v.ndim and len(v) == count]

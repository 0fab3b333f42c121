"""The expert of tasks in which there is nothing to command."""

from anysim.conventions import Array
from anysim.skills.base import Skill


class Coast(Skill):
    """Let things fly."""

    phases = ("coast",)

    def act(self, env_ids: Array, action: Array) -> None:
        """Every action is as good as any other."""

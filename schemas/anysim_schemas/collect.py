"""Episodes of several commands, as `anysim run` collects them."""

from typing import Any, ClassVar

from pydantic import ConfigDict, Field

from anysim_schemas.base import Flag, Positive, Spec


class CommandSpec(Spec):
    """One command of an episode: a skill with its parameters beside it, `{do: open, part: cabinet.drawer}`.

    A bare string is a command without parameters.
    """

    model_config = ConfigDict(extra="allow", frozen=True)
    plugin_kind: ClassVar[str] = "skill"
    plugin_name_field: ClassVar[str] = "do"

    do: str = Field(description="an installed skill, as in `anysim list skills`")
    timeout: Positive | None = Field(
        default=None, description="[s] that the command may take, its retries included; no bound where not given"
    )
    required: Flag = Field(default=True, description="false: the episode goes on without it where it fails")

    @classmethod
    def from_text(cls, text: str) -> dict[str, Any]:
        """The name of a skill without parameters."""
        return {"do": text}

    @property
    def params(self) -> dict[str, Any]:
        """The parameters of the skill, as written."""
        return dict(self.model_extra or {})


class CollectSpec(Spec):
    """What `anysim run` does in each episode, in place of the task's expert."""

    commands: tuple[CommandSpec, ...] = Field(
        min_length=1, description="commands in order, in one world: nothing is reset between them"
    )

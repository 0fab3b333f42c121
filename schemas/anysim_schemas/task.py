"""Tasks: what is observed, rewarded, and counted as success."""

from typing import Any, ClassVar, Literal

from pydantic import ConfigDict, Field, field_validator, model_validator

from anysim_schemas.base import Name, Spec


class TermSpec(Spec):
    """A term by name, with its parameters beside it: `{term: distance, a: panda.tool, b: cube}`.

    A bare string is a term without parameters. In a mapping the key names the term unless `term` does.
    """

    model_config = ConfigDict(extra="allow", frozen=True)
    plugin_kind: ClassVar[str] = "term"

    term: str

    @model_validator(mode="before")
    @classmethod
    def _name_shorthand(cls, data: object) -> object:
        return {"term": data} if isinstance(data, str) else data

    @property
    def params(self) -> dict[str, Any]:
        """The parameters of the term, as written."""
        return dict(self.model_extra or {})


class ObservationTermSpec(TermSpec):
    plugin_kind: ClassVar[str] = "observation"


class RewardTermSpec(TermSpec):
    plugin_kind: ClassVar[str] = "reward"
    weight: float = 1.0


class PredicateTermSpec(TermSpec):
    plugin_kind: ClassVar[str] = "predicate"


class CommandTermSpec(TermSpec):
    plugin_kind: ClassVar[str] = "command"


class EventTermSpec(TermSpec):
    plugin_kind: ClassVar[str] = "event"
    when: Literal["reset", "step"] = "reset"


class ExpertSpec(Spec):
    """A scripted solution: a skill with its parameters, run by `anysim run` where no policy is given."""

    model_config = ConfigDict(extra="allow", frozen=True)
    plugin_kind: ClassVar[str] = "skill"
    plugin_name_field: ClassVar[str] = "skill"
    skill: str

    @property
    def params(self) -> dict[str, Any]:
        """The parameters of the skill, as written."""
        return dict(self.model_extra or {})


def _named_terms(data: object) -> object:
    """In a mapping of terms the key is the term's name unless the entry says otherwise."""
    if not isinstance(data, dict):
        return data
    return {k: {"term": k, **v} if isinstance(v, dict) else ({"term": k} if v is None else v) for k, v in data.items()}  # pyright: ignore[reportUnknownVariableType, reportUnknownArgumentType]


class TaskSpec(Spec):
    """The Markov decision process over a world."""

    description: str = ""
    horizon: int = Field(default=500, gt=0, description="control steps before an episode is truncated")
    command: dict[Name, CommandTermSpec] = Field(default_factory=dict)
    observations: dict[Name, tuple[ObservationTermSpec, ...]] = Field(
        description="groups of terms; `policy` is required, `privileged` may hold simulator-only truth"
    )
    rewards: dict[Name, RewardTermSpec] = Field(default_factory=dict)
    success: dict[Name, PredicateTermSpec] = Field(default_factory=dict, description="all must hold")
    hold: int = Field(default=1, gt=0, description="consecutive control steps that success must hold")
    failure: dict[Name, PredicateTermSpec] = Field(default_factory=dict, description="any is enough")
    events: dict[Name, EventTermSpec] = Field(default_factory=dict)
    on_success: Literal["end", "continue"] = "end"
    ended: Literal["error", "hold"] = Field(
        default="error", description="stepping an ended env is an error, or holds it still until it is reset"
    )
    expert: ExpertSpec | None = None

    _named = field_validator("command", "rewards", "success", "failure", "events", mode="before")(_named_terms)

    @field_validator("observations")
    @classmethod
    def _policy_group(cls, groups: dict[str, Any]) -> dict[str, Any]:
        if not groups.get("policy"):
            raise ValueError("the group `policy` is required and needs at least one term")
        return groups

"""Tasks: what is observed, rewarded, and counted as success."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import ConfigDict, Field, field_validator, model_validator

from anysim_schemas.base import Flag, Fraction, Integer, Name, NamedByKey, Number, Positive, Spec
from anysim_schemas.cameras import Channel
from anysim_schemas.errors import KeyFault
from anysim_schemas.values import DelayValue, FloatValue, unshared


class TermSpec(Spec):
    """A term by name, with its parameters beside it: `{term: distance, a: panda.tool, b: cube}`.

    A bare string is a term without parameters. In a mapping the key names the term unless `term` does.
    """

    model_config = ConfigDict(extra="allow", frozen=True)
    plugin_kind: ClassVar[str] = "term"

    term: str = Field(description="an installed term; in a mapping of terms the key is its name where this is left out")

    @classmethod
    def from_text(cls, text: str) -> dict[str, Any]:
        """The name of a term without parameters."""
        return {"term": text}

    @property
    def params(self) -> dict[str, Any]:
        """The parameters of the term, as written."""
        return dict(self.model_extra or {})


class ObservationTermSpec(TermSpec):
    """A term that is observed: it yields a row of numbers for each environment, the truth unless told otherwise."""

    plugin_kind: ClassVar[str] = "observation"

    noise: FloatValue | None = Field(
        default=None, description="drawn anew at each control step and added to each number of the term"
    )
    bias: FloatValue | None = Field(
        default=None, description="drawn once an episode for each number of the term, and added to it"
    )
    delay: DelayValue = Field(
        default=0, description="control steps by which the term is late; the first observation stands in until then"
    )

    @field_validator("noise", "bias")
    @classmethod
    def _alone(cls, noise: Any) -> Any:
        return unshared(noise)


class RewardTermSpec(TermSpec):
    """A term that is rewarded: it yields one number for each environment, times its weight."""

    plugin_kind: ClassVar[str] = "reward"

    weight: Number = Field(default=1.0, description="factor of the term in the sum; negative for a cost")


class PredicateTermSpec(TermSpec):
    """A term that holds or does not, for each environment."""

    plugin_kind: ClassVar[str] = "predicate"


class EndingTermSpec(PredicateTermSpec):
    """A predicate that counts as success or failure, and what that is worth."""

    reward: Number = Field(
        default=0.0,
        description="added to the reward of each control step in which the success, or this failure, counts; once "
        "where it ends the episode",
    )


class CommandTermSpec(TermSpec):
    """A goal that is drawn at each reset, and that other terms refer to by its key."""

    plugin_kind: ClassVar[str] = "command"


class EventTermSpec(TermSpec):
    """Something that happens to the world."""

    plugin_kind: ClassVar[str] = "event"

    when: Literal["reset", "step"] = Field(default="reset", description="at each reset, or at each control step")


class CurriculumSpec(Spec):
    """Values whose spread grows with an env's success rate, and shrinks where it fails."""

    widens: tuple[str, ...] = Field(
        min_length=1, description="dotted paths of values that are drawn in each episode, as in `overrides`"
    )
    around: Fraction = Field(
        default=0.5, description="the quantile that all is drawn at on level 0: 0 the low end, 1 the high end"
    )
    start: Fraction = Field(default=0.0, description="the level at first: the share of the spread that is drawn from")
    step: Positive = Field(default=0.1, le=1.0, description="by how much the level moves")
    episodes: Integer = Field(
        default=10, gt=0, description="finished episodes of an env after which its level may move"
    )
    promote: Fraction = Field(default=0.8, description="success rate over these episodes from which on the level rises")
    demote: Fraction = Field(default=0.4, description="success rate below which it falls")

    @model_validator(mode="after")
    def _ordered(self) -> "CurriculumSpec":
        if self.demote > self.promote:
            raise KeyFault(
                f"{self.demote:g} is above `promote`, {self.promote:g}; a level would rise and fall", "demote"
            )
        return self


class ExpertSpec(Spec):
    """A scripted solution: a skill with its parameters, run by `anysim run` where no policy is given."""

    model_config = ConfigDict(extra="allow", frozen=True)
    plugin_kind: ClassVar[str] = "skill"
    plugin_name_field: ClassVar[str] = "skill"

    skill: str = Field(description="an installed skill, as in `anysim list skills`")

    @property
    def params(self) -> dict[str, Any]:
        """The parameters of the skill, as written."""
        return dict(self.model_extra or {})


class ImageSpec(Spec):
    """How the images of a camera are observed."""

    fps: Positive | None = Field(
        default=None, description="images per second, the latest one holds meanwhile; each control step if not given"
    )
    channels: tuple[Channel, ...] = Field(
        default=("rgb",),
        min_length=1,
        description="rgb is `images/CAMERA`; depth [m], cut off at `far`, and segmentation: `images/CAMERA/CHANNEL`",
    )
    markers: Flag = Field(
        default=False, description="goals are marked in the observed images, and in the camera's videos"
    )


ByTerm = NamedByKey("term")


class TaskSpec(Spec):
    """The Markov decision process over a world."""

    description: str = Field(default="", description="one line for people, and the instruction for language policies")
    horizon: Integer = Field(default=500, gt=0, description="control steps before an episode is truncated")
    command: Annotated[dict[Name, CommandTermSpec], ByTerm] = Field(
        default_factory=dict, description="goals drawn at each reset, by the name that other terms use"
    )
    observations: dict[Name, tuple[ObservationTermSpec, ...]] = Field(
        description="groups of terms; `policy` is required, `privileged` may hold simulator-only truth"
    )
    images: dict[Name, ImageSpec] = Field(
        default_factory=dict, description="cameras whose images are observed, as `images/CAMERA`"
    )
    rewards: Annotated[dict[Name, RewardTermSpec], ByTerm] = Field(
        default_factory=dict, description="terms whose weighted sum is the reward"
    )
    success: Annotated[dict[Name, EndingTermSpec], ByTerm] = Field(default_factory=dict, description="all must hold")
    hold: Integer = Field(default=1, gt=0, description="consecutive control steps that success must hold")
    failure: Annotated[dict[Name, EndingTermSpec], ByTerm] = Field(default_factory=dict, description="any is enough")
    events: Annotated[dict[Name, EventTermSpec], ByTerm] = Field(
        default_factory=dict, description="what happens to the world at resets and steps"
    )
    on_success: Literal["end", "continue"] = Field(default="end", description="whether success ends the episode")
    ended: Literal["error", "hold"] = Field(
        default="error", description="stepping an ended env is an error, or holds it still until it is reset"
    )
    curriculum: dict[Name, CurriculumSpec] | None = Field(
        default=None, description="values whose spread follows the success rate of each env, where learners ask for it"
    )
    expert: ExpertSpec | None = Field(default=None, description="a scripted solution")
    shipped: str | None = Field(
        default=None,
        min_length=1,
        description="a trained solution, run by `--policy shipped`: its file, as `package:my_tasks/walk/policy.onnx`",
    )

    @field_validator("observations")
    @classmethod
    def _policy_group(
        cls, groups: dict[str, tuple[ObservationTermSpec, ...]]
    ) -> dict[str, tuple[ObservationTermSpec, ...]]:
        if not groups.get("policy"):
            raise KeyFault("the group `policy` is required and needs at least one term", "policy")
        if empty := next((name for name, terms in groups.items() if not terms), None):
            raise KeyFault(f"the group `{empty}` has no term; give it one, or leave it out", empty)
        return groups

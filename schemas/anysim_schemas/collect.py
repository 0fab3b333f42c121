"""Episodes of several commands, as `anysim run` collects them."""

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import ConfigDict, Discriminator, Field, Tag, model_validator

from anysim_schemas.base import Flag, Integer, Name, NonNegative, Number, Positive, Spec
from anysim_schemas.errors import KeyFault
from anysim_schemas.task import PredicateTermSpec
from anysim_schemas.values import TAG_PREFIX, Choice, Word, kind_of

MOST_VALUES = 256
"""How many values a range that is bound may have."""
MOST_COMMANDS = 200
"""Of an episode, its repetitions and all branches of its choices counted."""


class CommandSpec(Spec):
    """One command of an episode: a skill with its parameters beside it, `{do: open, part: cabinet.drawer}`.

    A bare string is a command without parameters. `$name` in a parameter is what `bind` has drawn for the episode.
    """

    model_config = ConfigDict(extra="allow", frozen=True)
    plugin_kind: ClassVar[str] = "skill"
    plugin_name_field: ClassVar[str] = "do"

    do: str = Field(description="an installed skill, as in `anysim list skills`")
    timeout: Positive | None = Field(
        default=None, description="[s] that the command may take, its retries included; no bound where not given"
    )
    required: Flag = Field(default=True, description="false: the episode goes on without it where it fails")
    if_: PredicateTermSpec | None = Field(
        default=None, alias="if", description="passed over where this does not hold when its turn comes"
    )
    success: PredicateTermSpec | None = Field(
        default=None, description="must hold when the skill says that it is done, else the command has failed"
    )
    save: Flag = Field(default=True, description="whether what it did is a segment of the recording where it succeeds")

    @classmethod
    def from_text(cls, text: str) -> dict[str, Any]:
        """The name of a skill without parameters."""
        return {"do": text}

    @property
    def params(self) -> dict[str, Any]:
        """The parameters of the skill, as written."""
        return dict(self.model_extra or {})


class ChooseSpec(Spec):
    """One of several commands, or lists of commands, drawn in each episode."""

    choose: tuple["Commands", ...] = Field(min_length=1, description="what is drawn from")
    weights: tuple[NonNegative, ...] | None = Field(
        default=None, description="how likely each is, in any unit; equal where not given"
    )

    @model_validator(mode="after")
    def _weights_match(self) -> "ChooseSpec":
        if self.weights is not None and (len(self.weights) != len(self.choose) or sum(self.weights) <= 0):
            raise KeyFault(f"{len(self.choose)} branches need as many weights, with a positive sum", "weights")
        return self


class RepeatSpec(Spec):
    """The same commands several times over."""

    repeat: Integer = Field(gt=0, le=MOST_COMMANDS, description="how often, at most")
    body: "Commands" = Field(description="what is repeated")
    until: PredicateTermSpec | None = Field(
        default=None, description="looked at before each time: where it holds, the episode goes on after them"
    )


def _form(value: object) -> str:
    if isinstance(value, list | tuple):
        return TAG_PREFIX + "list"
    for form, model in (("choose", ChooseSpec), ("repeat", RepeatSpec)):
        if isinstance(value, model) or (isinstance(value, dict) and form in value):
            return TAG_PREFIX + form
    return TAG_PREFIX + "do"


if TYPE_CHECKING:
    Entry = CommandSpec | ChooseSpec | RepeatSpec
    Commands = Entry | tuple[Entry, ...]
else:
    _ENTRY = (
        Annotated[CommandSpec, Tag(TAG_PREFIX + "do")]
        | Annotated[ChooseSpec, Tag(TAG_PREFIX + "choose")]
        | Annotated[RepeatSpec, Tag(TAG_PREFIX + "repeat")]
    )
    Entry = Annotated[_ENTRY, Discriminator(_form)]
    Commands = Annotated[_ENTRY | Annotated[tuple[Entry, ...], Tag(TAG_PREFIX + "list")], Discriminator(_form)]

ChooseSpec.model_rebuild()
RepeatSpec.model_rebuild()


def written_out(
    entries: "Commands", path: str, *, drawn: Callable[[str], int] | None = None, repeated: bool = True
) -> Iterator[tuple[CommandSpec, str]]:
    """Commands in a row, each with its path in the file.

    Args:
        path: of the entries.
        drawn: which branch a choice takes, by its path; all of them, one after the other, where not given.
        repeated: whether what is repeated comes as often, or once.
    """
    if isinstance(entries, tuple):
        for number, entry in enumerate(entries):
            yield from written_out(entry, f"{path}.{number}", drawn=drawn, repeated=repeated)
    elif isinstance(entries, ChooseSpec):
        for number in range(len(entries.choose)) if drawn is None else (drawn(path),):
            branch = entries.choose[number]
            yield from written_out(branch, f"{path}.choose.{number}", drawn=drawn, repeated=repeated)
    elif isinstance(entries, RepeatSpec):
        for _ in range(entries.repeat if repeated else 1):
            yield from written_out(entries.body, f"{path}.body", drawn=drawn, repeated=repeated)
    else:
        yield entries, path


class BoundRange(Spec):
    """A number between two bounds: whole ones where both are whole, else evenly spaced ones. Each is equally likely.

    What refers to it is made and checked for each of its values when the file is read, both bounds among them.
    """

    range: tuple[Integer | Number, Integer | Number] = Field(description="lower and upper bound, both of them drawn")
    steps: Integer | None = Field(
        default=None, ge=2, le=MOST_VALUES, description="how many values; 11, or all where they are whole"
    )

    @model_validator(mode="after")
    def _counted(self) -> "BoundRange":
        low, high = self.range
        if low > high:
            raise KeyFault(f"the lower bound {low:g} is above the upper bound {high:g}", "range")
        if not self.whole:
            return self
        if self.steps is not None:
            raise KeyFault("whole numbers are drawn one by one; write the bounds with a point to have steps", "steps")
        if high - low >= MOST_VALUES:
            raise KeyFault(f"{high - low + 1} whole numbers, at most {MOST_VALUES} are possible", "range")
        return self

    @property
    def whole(self) -> bool:
        """Whether whole numbers are drawn."""
        return all(isinstance(bound, int) for bound in self.range)

    @property
    def choice(self) -> Choice[Any]:
        """The choice among its values."""
        low, high = self.range
        if self.whole:
            return Choice[Any](choice=tuple(range(int(low), int(high) + 1)))
        last = (self.steps or 11) - 1
        shares = (k / last for k in range(last + 1))
        return Choice[Any](choice=tuple(float(f"{low * (1.0 - t) + high * t:.12g}") for t in shares))


def _bound_form(value: object) -> str:
    return TAG_PREFIX + "range" if isinstance(value, BoundRange) else kind_of(value)


if TYPE_CHECKING:
    BoundValue = bool | int | float | str | Choice[Any] | BoundRange
else:
    BoundValue = Annotated[
        Annotated[Word, Tag(TAG_PREFIX + "constant")]
        | Annotated[Choice[Word], Tag(TAG_PREFIX + "choice")]
        | Annotated[BoundRange, Tag(TAG_PREFIX + "range")],
        Discriminator(_bound_form),
    ]


class CollectSpec(Spec):
    """What `anysim run` does in each episode, in place of the task's expert."""

    bind: dict[Name, BoundValue] = Field(
        default_factory=dict,
        description="values by name, drawn anew in each episode: parameters of commands and terms refer to `$name`",
    )
    commands: tuple[Entry, ...] = Field(
        min_length=1, description="commands in order, in one world: nothing is reset between them"
    )
    on_fail: Literal["stop", "skip", "continue"] = Field(
        default="stop",
        description="where a required command fails: stop: the episode has failed; skip: it goes on without it; "
        "continue: it goes on, and has failed at its end",
    )

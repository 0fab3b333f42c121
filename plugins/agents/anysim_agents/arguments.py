"""Arguments of the tools: closed models, from which both the JSON schemas and the checks come."""

import json
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from anysim_schemas.proposals import ProposedPose

KINDS = ("tasks", "robots", "engines", "commands", "predicates", "assets", "planners", "sensors")
"""What `list_catalog` lists."""


class Arguments(BaseModel):
    """Arguments of a tool; an unknown one is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, arbitrary_types_allowed=False)


def _from_text(value: object) -> object:
    """Data that was sent as JSON text, as some models do."""
    if isinstance(value, str) and value.lstrip()[:1] in ("{", "["):
        try:
            return json.loads(value)
        except ValueError:
            return value
    return value


_JSON = BeforeValidator(_from_text)
Text = Annotated[str, Field(max_length=200)]
Session = Annotated[str, Field(max_length=80, description="the word that `create_session` or `create_world` gave")]
Env = Annotated[int, Field(ge=0, description="which env of the session, from 0")]
Envs = Annotated[
    tuple[Annotated[int, Field(ge=0)], ...] | None,
    _JSON,
    Field(max_length=256, description="envs by number; all of the session where not given"),
]
Point = Annotated[tuple[float, float, float], _JSON]
Data = Annotated[dict[str, Any], _JSON]
Side = Annotated[int, Field(ge=16, le=2048)]
Seed = Annotated[
    int | None, Field(ge=0, lt=2**63, description="of what is drawn; the same seed gives the same episode")
]


class ListCatalog(Arguments):
    """What to list."""

    kind: Literal[KINDS] = Field(default="tasks", description="what to list")  # type: ignore[valid-type]
    contains: Annotated[str, Field(max_length=60)] = Field(default="", description="only names or words with this text")
    start: Annotated[int, Field(ge=0)] = Field(default=0, description="how many to pass over, to see the next page")


class Describe(Arguments):
    """What to describe."""

    kind: Literal["task", "robot", "engine", "command", "predicate", "asset", "yaml"] = Field(
        description="yaml: the keys that a world of your own may have at `name`, a dotted path such as "
        "`world.objects.NAME.source`; empty: at its top"
    )
    name: Text = Field(default="", description="its name, as `list_catalog` has it")


class CreateSession(Arguments):
    """What a session is of."""

    task: Text | None = Field(default=None, description="as in `list_catalog`; the server's first where not given")
    num_envs: Annotated[int, Field(ge=1)] = Field(default=1, description="parallel envs, each with its own episode")
    engine: Text | None = Field(default=None, description="the task's own where not given")
    robot: Text | None = Field(default=None, description="a robot of the catalogue in the place of the task's own")
    seed: Seed = None
    horizon: Annotated[int, Field(ge=1)] | None = Field(default=None, description="control steps of an episode")
    on_success: Literal["end", "continue"] | None = Field(
        default=None, description="whether the episode ends once the task is solved; as the task says where not given"
    )


class OfSession(Arguments):
    """A session."""

    session: Session


class OptionalSession(Arguments):
    """A session, or all."""

    session: Session | None = Field(default=None, description="the session; all of them where not given")


class OfEnv(Arguments):
    """One env of a session."""

    session: Session
    env: Env = 0


class Render(OfEnv):
    """What to draw."""

    camera: Text | None = Field(default=None, description="one of the session's cameras; the first where not given")
    width: Side | None = Field(default=None, description="[px]; as the camera's where not given")
    height: Side | None = Field(default=None, description="[px]; as the camera's where not given")
    markers: bool = Field(default=False, description="whether goals are marked")


class LookAt(OfEnv):
    """What to look at, and from where."""

    target: Text | Point = Field(description="a thing, frame or goal by name, as `observe` has it; or a point [m]")
    distance: Annotated[float, Field(gt=0.02, le=50)] = Field(default=0.6, description="of the eye [m]")
    azimuth: Annotated[float, Field(ge=-360, le=360)] = Field(
        default=-45.0, description="[degrees] of the eye about the vertical; 0 is along x, 90 along y"
    )
    elevation: Annotated[float, Field(ge=-89, le=89)] = Field(default=35.0, description="[degrees] of the eye")
    width: Side = Field(default=320, description="[px]")
    height: Side = Field(default=240, description="[px]")


class RunSkill(Arguments):
    """One command."""

    session: Session
    skill: Text = Field(description="a command, as `list_catalog` kind: commands has it; such as pick or open")
    parameters: Data = Field(default_factory=dict, description="as `describe` kind: command says: {object: cube}")
    timeout: Annotated[float, Field(gt=0)] | None = Field(default=None, description="[s] of simulated time")
    envs: Envs = None
    wait: Annotated[float, Field(ge=0)] = Field(
        default=120.0, description="[s] until this call answers though it is not done; `status` tells how it goes on"
    )


class RunCommand(Arguments):
    """Commands in order."""

    session: Session
    commands: Annotated[tuple[Any, ...], _JSON] = Field(
        min_length=1,
        description="one after the other: {do: pick, object: cube}, with the parameters beside `do`; each may have "
        "`timeout` [s], `if` and `success` (predicates such as {term: near, a: cube, b: goal, distance: 0.05}), and "
        "`required: false`",
    )
    on_fail: Literal["stop", "skip", "continue"] = Field(default="stop", description="where a required one fails")
    envs: Envs = None
    wait: Annotated[float, Field(ge=0)] = Field(
        default=120.0, description="[s] until this call answers though they are not done; `status` tells how they go on"
    )


class Wait(Arguments):
    """How long to let time pass."""

    session: Session
    seconds: Annotated[float, Field(gt=0, le=60)] = Field(default=1.0, description="[s] of simulated time")
    envs: Envs = None


class ProposeLayout(OfEnv):
    """Where things are to be."""

    poses: Annotated[dict[str, ProposedPose], _JSON] = Field(
        default_factory=dict,
        description="by the names of things: {mug: {position: [0.5, 0.1, 0.42], yaw: 0.3}}; others go where the layout "
        "says. None: you are told what can be placed, how large it is and where there is room; nothing changes then",
    )
    reason: Annotated[str, Field(max_length=1000)] = Field(default="", description="why; it is kept with the episode")
    seed: Seed = None


class CheckWorld(Arguments):
    """A world as text."""

    yaml: str = Field(description="the text of a world, as `describe` kind: yaml tells it; `extends: task:NAME` helps")
    all_engines: bool = Field(default=False, description="ask every installed engine whether it can run it")


class CreateWorld(Arguments):
    """A world as text, and what its session is like."""

    yaml: str = Field(description="the text of a world, as `check_world` takes it")
    num_envs: Annotated[int, Field(ge=1)] = Field(default=1, description="parallel envs, each with its own episode")
    seed: Seed = None


class Snapshot(Arguments):
    """Which envs to keep."""

    session: Session
    envs: Envs = None


Changes = Annotated[
    dict[Text, Any], _JSON, Field(description="values by dotted path: {objects.cube.mass: 0.3}; `status` lists them")
]


class Reset(Arguments):
    """Which episodes to begin."""

    session: Session
    envs: Envs = None
    seed: Seed = None
    changes: Changes = Field(default_factory=dict)


class ResetTo(Arguments):
    """Which moment to go back to."""

    session: Session
    snapshot: Text = Field(description="what `snapshot` gave")
    changes: Changes = Field(default_factory=dict)


class Counterfactual(OfEnv):
    """What is otherwise."""

    changes: Changes
    snapshot: Text | None = Field(
        default=None, description="from which moment on; from the beginning of the episode where not given"
    )


class Ask(OfEnv):
    """What to ask."""

    about: Literal["scene", "task", "story", "questions"] = Field(
        default="scene",
        description="scene: what there is and where, in words; task: what is to be done; story: what has happened; "
        "questions: verified questions and answers about this moment",
    )
    family: Text | None = Field(default=None, description="of questions: count, support, spatial, reachability, …")
    thing: Text | None = Field(default=None, description="of questions: only those about this thing, by its name")
    most: Annotated[int, Field(ge=1, le=50)] = Field(default=12, description="of questions, at most")

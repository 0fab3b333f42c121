"""Catalogue of a service: the tasks and worlds that its owner serves, and what a client may choose about them."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import ConfigDict, Field

from anysim import registry
from anysim.api import load, make, watched
from anysim.errors import TaskError, listing, suggest
from anysim_client.errors import ForbiddenSource, LimitExceeded
from anysim_schemas.base import Spec
from anysim_schemas.load import LoadedRun, LoadedSpec
from anysim_serving.settings import Limits

if TYPE_CHECKING:
    from anysim.task.env import TaskEnv

OPEN = ("task.horizon", "task.ended", "task.on_success", "task.hold", "physics.dt", "physics.substeps", "seed")
"""What a client may override when it creates a session: numbers and words that name no file."""
_PLAIN = re.compile(r"-?[a-z0-9_.+]{1,40}", re.IGNORECASE)
_NAME = re.compile(r"[A-Za-z0-9_]{1,64}")
Word = Annotated[str, Field(max_length=200)]


class SessionRequest(Spec):
    """What a client asks for: a session of its own, with one simulator of some envs."""

    model_config = ConfigDict(defer_build=False)  # what FastAPI builds schemas from

    task: Word | None = None
    num_envs: Annotated[int, Field(ge=1)] | None = None
    engine: Word | None = None
    robot: Word | None = None
    seed: Annotated[int, Field(ge=0)] | None = None
    curriculum: bool = False
    overrides: Annotated[tuple[Word, ...], Field(max_length=32)] = ()


@dataclass(frozen=True)
class Catalogue:
    """What is served: installed tasks by name, and files by the name of what they hold; the first is the default.

    Attributes:
        sources: by the name that clients use, what `anysim.make` takes.
        all_tasks: whether every installed task may be asked for as well.
        num_envs, engine: of a session that does not say.
        overrides: the owner's, for all sessions.
    """

    sources: Mapping[str, Any]
    all_tasks: bool = False
    num_envs: int | None = None
    engine: str | None = None
    overrides: Sequence[str] = ()
    limits: Limits = field(default=Limits())

    @classmethod
    def of(cls, sources: Sequence[str | Path | Mapping[str, Any]], **options: Any) -> "Catalogue":
        """The catalogue of tasks, files and mappings; all of them are read, so faults are told now.

        Raises:
            SpecError, TaskError: one cannot be read, or two have one name.
        """
        named: dict[str, Any] = {}
        for source in sources:
            installed = isinstance(source, str) and source in registry.names("tasks")
            loaded = load(source, overrides=options.get("overrides", ()))
            name = str(source) if installed else loaded.spec.world.name
            if not installed and isinstance(source, str | Path):
                name = Path(source).stem
            if name in named:
                raise TaskError(f"two of what is served are called '{name}'; rename one of the files")
            named[name] = source if loaded.spec.task is not None else watched(loaded)
        return cls(named, **options)

    @property
    def default(self) -> str:
        """The name of what a session has that does not say."""
        return next(iter(self.sources))

    def names(self) -> list[str]:
        """All that may be asked for."""
        more = [name for name in registry.names("tasks") if name not in self.sources] if self.all_tasks else []
        return [*self.sources, *more]

    def about(self) -> dict[str, Any]:
        """What a client can choose from."""
        return {
            "tasks": self.names(),
            "default": self.default,
            "num_envs": self.num_envs,
            "engines": registry.names("engines"),
            "engine": self.engine,
            "overrides": list(OPEN),
        }

    def envs(self, request: SessionRequest) -> int:
        """How many envs a session would have."""
        if request.num_envs is not None:
            return request.num_envs
        return self.num_envs or self.loaded(request).spec.num_envs

    def checked(self, request: SessionRequest) -> None:
        """Refuse what is not served, before anything is built.

        Raises:
            ForbiddenSource: it is not in the catalogue, or an override that a client may not set.
            LimitExceeded: more envs than one session may have.
        """
        self.source(request)
        for name, installed in ((request.engine, "engines"), (request.robot, "robots")):
            if name is not None and (not _NAME.fullmatch(name) or name not in registry.names(installed)):
                raise ForbiddenSource(
                    f"{installed} are chosen by their name, and there is no '{name[:60]}' (installed: "
                    f"{listing(registry.names(installed))})"
                )
        for override in request.overrides:
            key, equals, value = override.partition("=")
            if not equals or key.strip() not in OPEN or not _PLAIN.fullmatch(value.strip()):
                raise ForbiddenSource(
                    f"a client cannot set '{override[:80]}'; it can set {listing(OPEN)}, each to one number or word. "
                    f"The rest is the owner's: anysim serve -o KEY=VALUE"
                )
        if (count := self.envs(request)) > self.limits.envs:
            raise LimitExceeded(f"a session has at most {self.limits.envs} envs, asked for {count}")

    def build(self, request: SessionRequest, overrides: Sequence[str] = (), proposals: Any = None) -> "TaskEnv":
        """The env of a session; `overrides` are the service's own, and `proposals` as `anysim.make` takes them."""
        return make(
            self.source(request),
            engine=request.engine or self.engine,
            num_envs=request.num_envs or self.num_envs,
            robot=request.robot,
            seed=request.seed,
            overrides=[*self.overrides, *request.overrides, *overrides],
            curriculum=request.curriculum,
            proposals=proposals,
        )

    def loaded(self, request: SessionRequest) -> LoadedRun:
        """The file of what a request asks for, with the owner's overrides."""
        source = self.source(request)
        return source if isinstance(source, LoadedSpec) else load(source, overrides=self.overrides)

    def name(self, request: SessionRequest) -> str:
        """What a request asks for."""
        return self.default if request.task is None else request.task

    def source(self, request: SessionRequest) -> Any:
        """What a request asks for, as `anysim.make` takes it.

        Raises:
            ForbiddenSource: it is not served.
        """
        name = self.name(request)
        if name in self.sources:
            return self.sources[name]
        if self.all_tasks and _NAME.fullmatch(name) and name in registry.names("tasks"):
            return name
        raise ForbiddenSource(
            f"'{name[:60]}' is not served{suggest(name[:60], self.names())} (served: {listing(self.names())})"
        )

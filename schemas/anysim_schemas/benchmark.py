"""Benchmark protocols: which policies are compared on which tasks and engines, and by which episodes."""

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from anysim_schemas.base import Flag, Integer, Name, NamedByKey, Positive, Spec, Whole
from anysim_schemas.errors import KeyFault
from anysim_schemas.plugin import PluginSlot


class BenchmarkTaskSpec(Spec):
    """A task of a benchmark. A bare string is the task."""

    task: str = Field(description="an installed task, or a YAML file beside this one; the key where not given")
    level: Name | None = Field(default=None, description="which of its levels; the file as it is where not given")
    horizon: Annotated[Integer, Field(gt=0)] | None = Field(
        default=None, description="control steps of an episode; the task's own where not given"
    )
    overrides: tuple[str, ...] = Field(
        default=(), description="further changes to the task, as `-o` of the command line: robots, ranges"
    )

    @classmethod
    def from_text(cls, text: str) -> dict[str, Any]:
        """The task."""
        return {"task": text}


class BenchmarkEngineSpec(Spec):
    """An engine of a benchmark. A bare string is the engine."""

    engine: str = Field(description="an installed engine; the key where not given")
    version: str | None = Field(default=None, description="the version that it must have; any where not given")
    options: Annotated[dict[str, Any], PluginSlot("engine", "engine")] = Field(
        default_factory=dict, description="options owned by the engine"
    )

    @classmethod
    def from_text(cls, text: str) -> dict[str, Any]:
        """The engine."""
        return {"engine": text}


class BenchmarkPolicySpec(Spec):
    """A policy of a benchmark. A bare string is the policy."""

    policy: str = Field(description="as `anysim evaluate --policy` takes it: expert:sigma=0.1, MODULE:FUNCTION, …")
    trained_on: Name | None = Field(default=None, description="the engine whose data it was trained with, by its key")
    privileged: Flag = Field(
        default=False, description="whether it is shown the observations that only a simulator knows, too"
    )

    @classmethod
    def from_text(cls, text: str) -> dict[str, Any]:
        """The policy."""
        return {"policy": text}


class BenchmarkSeedsSpec(Spec):
    """The episodes, which are the same for each policy and engine."""

    split: Literal["train", "validation", "test"] = Field(default="test", description="the split of the seeds")
    first: Whole = Field(default=0, description="the place in the split to begin at")
    episodes: Annotated[Integer, Field(gt=0)] = Field(
        default=100, description="episodes of each task, engine and policy"
    )


class BenchmarkReferenceSpec(Spec):
    """What the others are held against."""

    engine: Name = Field(description="the engine, by its key")
    policy: Name = Field(
        description="the policy, by its key; its median steps on that engine are the length 1 of a task"
    )


class BenchmarkSpec(Spec):
    """A protocol: everything that the figures of a benchmark depend on."""

    name: Name = Field(description="what the benchmark is called")
    description: str = Field(default="", description="what it is for, in a sentence")
    tasks: Annotated[dict[Name, BenchmarkTaskSpec], NamedByKey("task")] = Field(
        min_length=1, description="the tasks; an entry takes its key for the task"
    )
    engines: Annotated[dict[Name, BenchmarkEngineSpec], NamedByKey("engine")] = Field(
        min_length=1, description="the engines; an entry takes its key for the engine"
    )
    policies: dict[Name, BenchmarkPolicySpec] = Field(min_length=1, description="the policies")
    reference: BenchmarkReferenceSpec = Field(description="the engine and the policy that others are held against")
    seeds: BenchmarkSeedsSpec = Field(default=BenchmarkSeedsSpec(), description="the episodes")
    control_rate: Positive | None = Field(
        default=None, description="actions in a second [Hz], which every task must have; each its own where not given"
    )
    modality: tuple[Name, ...] = Field(
        default=("policy",), description="groups of observations that policies are shown"
    )
    privileged: Flag = Field(default=False, description="whether policies with `privileged: true` are let in")
    num_envs: Annotated[Integer, Field(gt=0)] = Field(
        default=16, description="parallel environments; results do not depend on it"
    )

    @model_validator(mode="after")
    def _names_exist(self) -> "BenchmarkSpec":
        for kind in ("engine", "policy"):
            name, known = getattr(self.reference, kind), self.engines if kind == "engine" else self.policies
            if name not in known:
                raise KeyFault(f"there is no {kind} '{name}' here; there are {', '.join(known)}", "reference", kind)
        for name, policy in self.policies.items():
            if policy.trained_on is not None and policy.trained_on not in self.engines:
                words = f"there is no engine '{policy.trained_on}' here; there are {', '.join(self.engines)}"
                raise KeyFault(words, "policies", name, "trained_on")
            if policy.privileged and not self.privileged:
                words = "this benchmark lets no policy see privileged observations; say `privileged: true` at its root"
                raise KeyFault(words, "policies", name, "privileged")
        if "privileged" in self.modality:
            raise KeyFault("`privileged` is no modality; mark single policies with `privileged: true`", "modality")
        return self

"""Steps from a name or a file to a running env: load, compile, create, bind."""

import json
import os
import warnings
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from pydantic import BaseModel, ConfigDict

from anysim import registry
from anysim.assets.scene import read_scene
from anysim.controllers.base import DEFAULT_CONTROLLER
from anysim.conventions import GROUND
from anysim.engine.factory import ENGINE_VARIABLE, create_simulation, engine_class
from anysim.errors import AnysimError, AssetError, PluginError, SpecError, SpecIssue, TaskError, listing
from anysim.math.arrays import shown, whole
from anysim.plugin_parameters import options_model
from anysim_schemas.load import LoadedRun, LoadedSpec, load_run
from anysim_schemas.object_source import Source, SourceChoice, SourceFolder, most
from anysim_schemas.plugin import UnknownPlugin

if TYPE_CHECKING:
    from anysim.engine.base import SimEngine
    from anysim.engine.capability import Need
    from anysim.model.world import World
    from anysim.task.env import TaskEnv
    from anysim_schemas.run import RunSpec

TASK_FILE = "task.yaml"


def task_path(name: str) -> Path:
    """The file of an installed task.

    Raises:
        PluginError: no such task; lists those installed.
    """
    package = registry.entry("tasks", name).value
    with registry.using("tasks", name):  # imports the package
        return Path(str(files(package).joinpath(TASK_FILE)))


def source_path(source: str | Path) -> Path:
    """A file as it is, or the file of an installed task by name."""
    if not isinstance(cast("object", source), str | Path):
        raise TaskError(
            f"a task is given by the name of an installed one, a YAML file or a mapping, got a {type(source).__name__}"
        )
    text = str(source)
    looks_like_file = isinstance(source, Path) or text.endswith((".yaml", ".yml")) or "/" in text
    return Path(text) if looks_like_file else task_path(text)


def _extends(uri: str) -> Path:
    """`extends: task:pick_cube` names an installed task."""
    scheme, _, name = uri.partition(":")
    if scheme != "task":
        raise TaskError(f"'{uri}' cannot be extended; a path or task:NAME expected")
    return task_path(name)


def load(
    *sources: str | Path | Mapping[str, Any], overrides: Sequence[str] = (), past: list[SpecIssue] | None = None
) -> LoadedRun:
    """Load files (or installed tasks by name), merged in order, with dotted overrides such as `physics.dt=0.004`.

    Where `past` is given, faults that leave the rest whole are added to it, and what is loaded is the rest.

    Raises:
        SpecError: every fault with file, line and column.
    """
    _check_texts(overrides)
    resolved = [s if isinstance(s, Mapping) else source_path(s) for s in sources]
    chosen = os.environ.get(ENGINE_VARIABLE)
    beneath = {"engine": chosen} if chosen else None
    return load_run(
        resolved,
        overrides=overrides,
        resolver=resolve_options,
        extends=_extends,
        base_data=beneath,
        past=past,
        scene=read_scene,
    )


def _as_text(engine: str | Mapping[str, Any]) -> str:
    try:
        return json.dumps(engine if isinstance(engine, str) else dict(engine))
    except (TypeError, ValueError) as error:
        raise TaskError(f"engine holds what no file can hold: {error}") from None


def _check_texts(overrides: Sequence[str]) -> None:
    """A text alone is a sequence of texts too: of its letters."""
    given = cast("object", overrides)
    if isinstance(given, str) or not isinstance(given, Sequence) or not all(isinstance(one, str) for one in given):
        found = repr(given) if isinstance(given, str | int | float) else f"a {type(given).__name__}"
        raise TaskError(f"overrides are a list of texts such as ['physics.dt=0.004'], got {found[:80]}")


def compile_world(
    source: "str | Path | LoadedRun | RunSpec | Mapping[str, Any]",
    overrides: Sequence[str] = (),
    base: Path | None = None,
) -> "World":
    """The neutral World of a file, an installed task, or a spec.

    Raises:
        SpecError, AssetError: with the file, line and column of the key at fault where they are known.
    """
    from anysim.compile.world import compile_world as compile_spec
    from anysim_schemas.run import RunSpec

    if isinstance(source, RunSpec):
        return compile_spec(source, base=base)
    loaded = source if isinstance(source, LoadedSpec) else load(source, overrides=overrides)
    try:
        return compile_spec(loaded.spec, base=base or _asset_folders(loaded))
    except (SpecError, AssetError) as error:
        raise located(error, loaded) from None


def _asset_folders(loaded: LoadedRun) -> dict[str, Path]:
    """The folder of the file that says where an object's or the ground's asset is; overrides: of the last file."""
    files = {path.resolve(): path.parent for path in loaded.files}
    folders: dict[str, Path] = {}
    keys = {GROUND: "world.terrain.file"}
    for name, thing in loaded.spec.world.objects.items():
        keys[name] = f"world.objects.{name}.source.{_written(thing.source)}"
    last = loaded.files[-1].parent if loaded.files else None
    scene = files.get(_file_of(loaded, "world.source"), last)  # what it says is relative to the file that names it
    for name, key in keys.items():
        folder = files.get(_file_of(loaded, key), scene)
        if folder is not None:
            folders[name] = folder
    return folders


def _file_of(loaded: LoadedRun, key: str) -> Path:
    return Path(place_of(loaded, key).rsplit(":", 2)[0]).resolve()


def _written(source: "Source") -> str:
    """The key of a source that says where its files are."""
    if isinstance(source, SourceFolder):
        return "folder"
    if isinstance(source, SourceChoice):
        return "choice"
    return "mesh" if source.mesh is not None else "asset"


def located(error: SpecError | AssetError, loaded: LoadedRun) -> SpecError | AssetError:
    """The same issues with the file, line and column of the key at fault."""
    issues = [SpecIssue(i.where or place_of(loaded, i.path), i.path, i.message) for i in error.issues]
    if isinstance(error, SpecError):
        return SpecError(issues)
    return AssetError(issues=issues) if issues else error


def place_of(loaded: LoadedRun, path: str) -> str:
    """Where the key at `path` was written, or the nearest one above it."""
    while path:
        if path in loaded.provenance:
            return loaded.provenance[path]
        path = path.rpartition(".")[0]
    return ""


def _located_path(loaded: LoadedRun, path: str) -> str:
    """`pick.yaml:14:7: task.rewards.reach`; the path alone for data without a file."""
    place = place_of(loaded, path)
    return path if place in ("", "data") else f"{place}: {path}"


WATCHING: Mapping[str, Any] = {"task": {"observations": {"policy": ["last_action"]}}}
"""The task of a file that has none: nothing is rewarded or required."""


def watched(loaded: LoadedRun) -> LoadedRun:
    """A run as it is, or a world without a task with one that only watches; places stay those of the files."""
    if loaded.spec.task is not None:
        return loaded
    return replace(load(WATCHING, loaded.data), files=loaded.files, provenance=loaded.provenance)


def dry_run(loaded: LoadedRun, world: "World") -> None:
    """Resolve every name the task refers to, without the engine it is for.

    Raises:
        SpecError: with file, line and column.
    """
    from anysim.skills.runner import bind_expert

    try:
        with blind_env(loaded, world, "check") as env:
            if env.spec.collect is not None or (env.spec.task is not None and env.spec.task.expert is not None):
                bind_expert(env)
    except SpecError as error:
        raise located(error, loaded) from None


def check_engine(loaded: LoadedRun, world: "World", engine: "type[SimEngine]", source: str) -> "list[Need]":
    """Whether an engine can run a world and change what the spec draws anew in each episode; nothing is built.

    Returns the needs that the engine meets approximately.

    Raises:
        SpecError: with file, line and column.
        CapabilityError: lists every need that the engine does not meet.
    """
    from anysim.engine.arguments import validated_options
    from anysim.managers.standard import check_run, standard_managers

    try:
        managers = standard_managers(loaded.spec, world, 1)
    except SpecError as error:
        raise located(error, loaded) from None
    given = loaded.spec.engine.options if loaded.spec.engine.name == engine.name else {}
    options = validated_options(engine.name, engine.options_model(), given)
    return check_run(engine, world, managers, source, lambda path: place_of(loaded, path), options)


def blind_env(loaded: LoadedRun, world: "World", name: str) -> "TaskEnv":
    """One env on the kinematic engine, which draws no images and can run any world."""
    from anysim.engine.factory import engine_class

    blind = replace(world, cameras=tuple(replace(camera, channels=()) for camera in world.cameras))
    try:
        return _env(loaded, blind, engine_class("null")(), 1, name, _proposals(loaded, None), unchecked=True)
    except SpecError as error:
        raise located(error, loaded) from None


def _proposals(loaded: LoadedRun, given: Any) -> Any:
    """The source of poses: what was given, else the file that the spec names, relative to the file that names it."""
    source = loaded.spec.world.layout_source
    if given is not None or source is None or not source.proposal.endswith(".json"):
        return Path(given) if isinstance(given, str) and given.endswith(".json") else given
    path = Path(source.proposal)
    place = place_of(loaded, "world.layout_source.proposal").rsplit(":", 2)[0]
    folder = Path(place).parent if place and Path(place).is_file() else Path()
    return path if path.is_absolute() else folder / path


def _env(
    loaded: LoadedRun,
    world: "World",
    simulation: "SimEngine",
    num_envs: int,
    name: str,
    proposals: Any = None,
    *,
    strict_observers: bool = False,
    unchecked: bool = False,
) -> "TaskEnv":
    """An env on a fresh engine, which is asked for what it needs or not; it is destroyed if anything fails."""
    from anysim.managers.standard import check_run, standard_managers
    from anysim.task.env import TaskEnv

    try:
        spec = loaded.spec
        managers = standard_managers(spec, world, num_envs, proposals)
        place, options = (lambda path: place_of(loaded, path)), simulation.options
        if not unchecked:
            check_run(simulation, world, managers, f"'{world.name}'", place, options)
        simulation.create_world(world, num_envs)
        located = partial(_located_path, loaded)
        return TaskEnv(spec, simulation, managers, name, strict_observers=strict_observers, located=located)
    except BaseException:
        simulation.destroy()
        raise


def simulation(spec: "RunSpec") -> "SimEngine":
    """The engine that a spec asks for, without a world."""
    from anysim.engine.executor import shard_count

    chosen = spec.engine
    shards = shard_count(chosen.shards, engine_class(chosen.name), spec.num_envs)
    return create_simulation(chosen.name, shards=shards, shard_timeout=chosen.shard_timeout, **chosen.options)


def _loaded(source: str | Path | LoadedRun | Mapping[str, Any], overrides: Sequence[str]) -> LoadedRun:
    if not isinstance(source, LoadedSpec):
        return load(source, overrides=overrides)
    return replace(load(source.data, overrides=overrides), files=source.files) if overrides else source


def make(
    source: str | Path | LoadedRun | Mapping[str, Any],
    *,
    engine: str | Mapping[str, Any] | None = None,
    num_envs: int | None = None,
    robot: str | None = None,
    seed: int | None = None,
    overrides: Sequence[str] = (),
    base: Path | None = None,
    proposals: Any = None,
    curriculum: bool = False,
    strict_observers: bool = False,
) -> "TaskEnv":
    """An env of a task: `env = anysim.make("pick_cube", engine="mujoco", num_envs=16)`.

    Args:
        source: an installed task by name, a YAML file, or what `load` returned.
        engine: an installed engine by name; wins over the file, whose options are kept for the engine it names. Or what
            the key `engine` of a file holds, in its place: `{"name": "pybullet", "shards": 2}`.
        num_envs: parallel environments; wins over the file.
        robot: another robot in the place of the task's own, by its name in the catalogue: one of the task's
            `alternates`, or another that has the channels and tools which the task uses. A task with several robots
            that does not list it takes `overrides` that say which.
        seed: seeds the envs now; otherwise the first `reset(seed=...)` does.
        overrides: dotted overrides, as `-o` on the command line.
        base: the folder that relative asset paths are relative to; that of the file where there is one.
        proposals: poses of objects that come from outside: a mapping, a JSON file, or a callable that takes a
            `anysim.placement.proposals.Request` and gives one; wins over `world.layout_source` of the file.
        curriculum: whether `task.curriculum` and that of tiles are followed, as learners do; otherwise all spreads are
            whole, and each episode draws its tile.
        strict_observers: an observer that raises ends the run; otherwise it is told once and counted.

    Raises:
        SpecError: the file, with line and column.
        TaskError: the file has no task, or an argument is none; nothing was built.
        CapabilityError: the engine cannot run this world; nothing was built.
    """
    from anysim.task.cost import MANY, announce, measured, told
    from anysim.task.env import NO_TASK

    _check_texts(overrides)
    if base is not None and not isinstance(cast("object", base), str | Path):
        raise TaskError(f"base is the folder that relative asset paths are relative to, got a {type(base).__name__}")
    base = None if base is None else Path(base)
    if engine is not None and not (isinstance(cast("object", engine), str | Mapping) and engine):
        raise TaskError(
            f"engine is the name of an installed engine, or what a file's `engine` holds, got {shown(engine)}"
        )
    if robot is not None and not isinstance(cast("object", robot), str):
        raise TaskError(f"robot is the name of a robot of the catalogue, got {shown(robot)}")
    if num_envs is not None:
        num_envs = whole("num_envs", num_envs, TaskError, least=1)
    if seed is not None:  # before the env is built
        seed = whole("seed", seed, TaskError)
    more = [*overrides, *([] if num_envs is None else [f"num_envs={num_envs}"])]
    loaded = _loaded(source, more)
    others = [] if robot is None else [f"robot={json.dumps(robot)}"]
    if engine is not None and loaded.spec.engine.name != engine:  # the options of a file are those of its own engine
        others.append(f"engine={_as_text(engine)}")
    if others:
        loaded = _loaded(source, [*more, *others])
    if not curriculum:
        loaded = replace(loaded, spec=loaded.spec.without_curricula())
    spec = loaded.spec
    if spec.task is None:  # before the world is built
        raise TaskError(f"{loaded.files[-1]}: {NO_TASK}" if loaded.files else NO_TASK)
    crowd = _announce_instances(loaded, base)
    world = compile_world(loaded, base=base)
    name = str(source) if isinstance(source, str) and "/" not in str(source) else world.name
    if spec.num_envs >= MANY:
        alone = replace(loaded, spec=spec.model_copy(update={"engine": spec.engine.model_copy(update={"shards": 1})}))
        each = measured(lambda count: _env(alone, world, simulation(alone.spec), count, name, _proposals(loaded, None)))
        announce(f"envs of '{name}' on {spec.engine.name}", spec.num_envs, each, "lower num_envs")
    try:
        given = _proposals(loaded, proposals)
        with told(f"building '{name}' on {spec.engine.name}") if crowd or spec.num_envs >= MANY else nullcontext():
            env = _env(loaded, world, simulation(spec), spec.num_envs, name, given, strict_observers=strict_observers)
    except SpecError as error:
        raise located(error, loaded) from None
    if seed is not None:
        env.streams.seed(seed, np.arange(spec.num_envs))
    return env


def connect(address: str | Sequence[str], **options: object) -> "TaskEnv":
    """The env of a service: `env = anysim.connect("http://127.0.0.1:8470", task="pick_cube", num_envs=16)`.

    It has the methods of what `make` gives, and its results are the same, bit for bit.

    Args:
        address: where `anysim serve` listens; or several of them, whose envs are one batch that outlives their loss.
        options: what the client of the address's scheme takes, such as `task`, `num_envs`, `engine` and `seed`.

    Raises:
        PluginError: no client of that scheme is installed.
        AnysimError: nothing answers there, or the service refuses.
    """
    first = address if isinstance(address, str) else next(iter(address), "")
    scheme, separator, _ = first.partition("://")
    if not separator:
        raise TaskError(f"a service has an address such as http://127.0.0.1:8470, got {shown(address)}")
    return registry.load("clients", scheme)(address, **options)


def _announce_instances(loaded: LoadedRun, base: Path | None) -> bool:
    """Say what the instances of objects cost where they are very many, from what fewer of them do: whether they are."""
    from anysim.task.cost import CROWD, announce, grown

    counts = {name: most(thing.count) for name, thing in loaded.spec.world.objects.items() if thing.count is not None}
    total = sum(counts.values())
    if total < CROWD:
        return False

    def build(number: int) -> "SimEngine":
        fewer = [f"world.objects.{name}.count={max(1, count * number // total)}" for name, count in counts.items()]
        smaller = _loaded(loaded, fewer)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of what the whole world will be warned of
            return simulation(smaller.spec).create_world(compile_world(smaller, base=base))

    try:
        cost = grown(build, total)
    except AnysimError:  # what is wrong with fewer of them is no fault of the file
        return True
    announce(f"instances of {listing(counts)} on {loaded.spec.engine.name}", total, cost, "lower `count`")
    return True


TERM_KINDS = ("observation", "reward", "predicate", "command", "event")


class _Anything(BaseModel):
    """Options that are checked elsewhere."""

    model_config = ConfigDict(extra="allow")


def resolve_options(kind: str, name: str) -> type[BaseModel] | None:
    """The options model of a plugin by slot kind and name; see `anysim_schemas.plugin`.

    Raises:
        UnknownPlugin: with a sentence that lists what exists.
    """
    from anysim.task.term_registry import find

    try:
        if (kind, name) == ("controller", DEFAULT_CONTROLLER):
            return _Anything
        if kind in TERM_KINDS:
            term = find(kind, name)
            with registry.Blame(f"the signature of the {kind} term '{name}'", registry.origin(term)):
                return options_model(term)
        if kind == "family":
            return registry.load("families", name).spec
        made = registry.load(f"{kind}s", name)
        with registry.using(f"{kind}s", name):
            return made.options_model() if kind in ("engine", "writer") else options_model(made)
    except PluginError as error:
        raise UnknownPlugin(str(error)) from error

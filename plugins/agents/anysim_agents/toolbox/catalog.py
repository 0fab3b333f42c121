"""Catalogue: what is installed and served, a page at a time, and each entry in words."""

import sys
from collections.abc import Iterator
from types import UnionType
from typing import Any, Union, get_args, get_origin

from pydantic import BaseModel

from anysim import registry
from anysim.api import task_path
from anysim.assets.catalogue import load_robot, missing_source
from anysim.engine.factory import availability, engine_class
from anysim.errors import AnysimError, PluginError, TaskError, listing, suggest
from anysim.plugin_parameters import given, parameters, reference_kind
from anysim.skills.phases import MovingSkill
from anysim.task import term_registry
from anysim_agents.answers import Answer
from anysim_agents.arguments import Describe, ListCatalog
from anysim_agents.workspace import Workspace
from anysim_agents.worlds import paths_of
from anysim_schemas.run import RunSpec
from anysim_serving.catalogue import SessionRequest


async def list_catalog(workspace: Workspace, args: ListCatalog) -> Answer:
    """List what there is, a page at a time; `describe` tells more of each.

    There are tasks that sessions can be of, robots, engines, commands that robots can be given, predicates for
    `if` and `success`, builders of assets, planners and sensors.
    """
    rows = await workspace.apart(lambda: list(_rows(workspace, args.kind)))
    wanted = args.contains.lower()
    found = [row for row in rows if wanted in row["name"].lower() or wanted in row.get("what", "").lower()]
    page = found[args.start : args.start + workspace.limits.page]
    data: dict[str, Any] = {"kind": args.kind, "found": len(found), "entries": page}
    if args.start + len(page) < len(found):
        data["next"] = f"call again with start: {args.start + len(page)}, or narrow it down with `contains`"
    elif not found and wanted:
        data["next"] = f"nothing has '{args.contains}' in it; leave `contains` out to see all {len(rows)}"
    return Answer(data)


async def describe(workspace: Workspace, args: Describe) -> Answer:
    """Describe one entry of the catalogue, or the keys of a world.

    Of a command its parameters, of a robot its channels and tools, of a task its world and commands; with kind
    yaml, the keys that a world of your own may have.
    """
    return Answer(await workspace.apart(lambda: _about(workspace, args)))


TOOLS = ((list_catalog, ListCatalog, True), (describe, Describe, True))


# --------------------------------------------------------------------------------------------------------- one a line


def commands() -> dict[str, type[MovingSkill]]:
    """The installed skills that can be commands, by name; one that does not load is left out."""
    found: dict[str, type[MovingSkill]] = {}
    for name in registry.names("skills"):
        try:
            made = registry.load("skills", name)
        except PluginError:
            continue
        if isinstance(made, type) and issubclass(made, MovingSkill):
            found[name] = made
    return found


def predicates() -> dict[str, Any]:
    """The installed predicates by name, those of libraries as `library.name`."""
    found: dict[str, Any] = {}
    for library in registry.names("terms"):
        for entry in term_registry.term_names(library):
            kind, _, name = entry.partition(" ")
            if kind == "predicate":
                full = name if library == term_registry.BUILTIN else f"{library}.{name}"
                found[full] = term_registry.find("predicate", full)
    return found


def first_line(thing: Any) -> str:
    """The first paragraph of a docstring, or of its module's where it refers to that."""
    words = thing.__doc__ or ""
    if words.startswith("See the module"):
        words = sys.modules[thing.__module__].__doc__ or ""
    return " ".join(words.split("\n\n")[0].split())


def _rows(workspace: Workspace, kind: str) -> Iterator[dict[str, Any]]:
    if kind == "tasks":
        for name in workspace.catalogue.names():
            yield {"name": name, "what": _task_words(workspace, name)}
    elif kind == "robots":
        for name in registry.names("robots"):
            entry = load_robot(name)
            if not missing_source(entry):
                yield {"name": name, "what": f"{entry.spec.category}: {entry.spec.description}"}
    elif kind == "engines":
        for name in registry.names("engines"):
            here = availability(name)
            yield {"name": name, "what": first_line(engine_class(name)) if here.available else "cannot run here"}
    elif kind in ("commands", "predicates"):
        for name, made in sorted((commands() if kind == "commands" else predicates()).items()):
            yield {"name": name, "what": first_line(made)}
    else:
        for name in registry.names(kind):
            yield {"name": name, "what": first_line(registry.load(kind, name))}


def _task_words(workspace: Workspace, name: str) -> str:
    try:
        task = workspace.catalogue.loaded(SessionRequest(task=name)).spec.task
    except AnysimError as error:
        return f"does not load: {error}"
    return "" if task is None else task.description


# --------------------------------------------------------------------------------------------------------- in full


def _about(workspace: Workspace, args: Describe) -> dict[str, Any]:
    return _task(workspace, args.name) if args.kind == "task" else _ABOUT[args.kind](args.name)


def _known(kind: str, name: str, names: list[str]) -> None:
    if name not in names:
        raise TaskError(
            f"describe.name: there is no {kind} '{name[:60]}'{suggest(name[:60], names)} ({kind}s: {listing(names)}; "
            f"list_catalog has all)"
        )


def _task(workspace: Workspace, name: str) -> dict[str, Any]:
    _known("task", name, workspace.catalogue.names())
    spec = workspace.catalogue.loaded(SessionRequest(task=name)).spec
    world, task = spec.world, spec.task
    data: dict[str, Any] = {"name": name, "description": "" if task is None else task.description}
    data |= {"robots": {key: robot.robot for key, robot in world.robots.items()}, "objects": list(world.objects)}
    data |= {"cameras": list(world.cameras), "engine": spec.engine.name, "control_dt_s": spec.physics.control_dt}
    data |= {"other_robots": list(spec.alternates), "levels": list(spec.levels)}
    if task is not None:
        data |= {"horizon": task.horizon, "on_success": task.on_success, "hold": task.hold}
        data |= {"success": {key: {"term": t.term, **t.params} for key, t in task.success.items()}}
        data |= {"failure": {key: {"term": t.term, **t.params} for key, t in task.failure.items()}}
        data |= {"goals": list(task.command)}
        if task.expert is not None:
            data["solved_by"] = [{"do": task.expert.skill, **task.expert.params}]
    if spec.collect is not None:
        data["solved_by"] = spec.collect.model_dump(mode="json", by_alias=True, exclude_none=True)["commands"]
    if name in registry.names("tasks"):
        data["yaml"] = task_path(name).read_text(encoding="utf-8")
    return data


def _robot(name: str) -> dict[str, Any]:
    _known("robot", name, registry.names("robots"))
    spec = load_robot(name).spec
    channels = {key: list(channel.joints) for key, channel in spec.channels.items()}
    return {
        "name": name,
        "category": spec.category,
        "description": spec.description,
        "channels": channels,
        "tools": list(spec.tools),
        "missing": missing_source(load_robot(name)) or None,
    }


def _engine(name: str) -> dict[str, Any]:
    _known("engine", name, registry.names("engines"))
    here, made = availability(name), engine_class(name)
    data: dict[str, Any] = {"name": name, "what": first_line(made), "available": here.available}
    if not here.available:
        return data | {"missing": list(here.missing), "remedy": here.remedy}
    return data | {"version": here.version, "capabilities": sorted(str(c) for c in made.capabilities.supported)}


def _command(name: str) -> dict[str, Any]:
    known = commands()
    _known("command", name, list(known))
    return _callable(name, known[name], set(paths_of(name)))


def _predicate(name: str) -> dict[str, Any]:
    known = predicates()
    _known("predicate", name, list(known))
    return _callable(name, known[name], set())


def _asset(name: str) -> dict[str, Any]:
    _known("asset", name, registry.names("assets"))
    said = _callable(name, registry.load("assets", name), set())
    return said | {"use": f"world.objects.NAME.source: {{procedural: {name}, params: {{…}}}}"}


def _callable(name: str, made: Any, hidden: set[str]) -> dict[str, Any]:
    rows = {key: parameter(value) for key, value in parameters(made).items() if key not in hidden}
    return {"name": name, "what": first_line(made), "parameters": rows}


def parameter(found: Any) -> dict[str, Any]:
    """A parameter of a plugin: what it takes, in words, and its default."""
    annotation, said = found.annotation, ""
    for extra in getattr(annotation, "__metadata__", ()):
        bounds = [f"{_SIGNS[type(b).__name__]} {next(iter(_slots(b)))}" for b in getattr(extra, "metadata", ())]
        said = ", ".join([*bounds, *filter(None, [getattr(extra, "description", None)])])
    bare = get_args(annotation)[0] if getattr(annotation, "__metadata__", ()) else annotation
    kind = reference_kind(given(bare))
    row: dict[str, Any] = {"type": f"name of: {kind}" if kind else _spelled(bare)}
    row |= {"what": said} if said else {}
    if found.default is found.empty and kind != "robot":
        row["required"] = True
    elif found.default is not found.empty and found.default is not None:
        row["default"] = _as_data(found.default)
    return row


_SIGNS = {
    "Gt": ">",
    "Ge": "at least",
    "Lt": "<",
    "Le": "at most",
    "MinLen": "length at least",
    "MaxLen": "length at most",
}


def _as_data(default: Any) -> Any:
    if isinstance(default, tuple):
        return [_as_data(item) for item in default]
    return default if isinstance(default, str | int | float) else repr(default)


def _slots(bound: Any) -> list[Any]:
    return [getattr(bound, name) for name in bound.__slots__]


def _spelled(annotation: Any) -> str:
    words = {"float": "number", "int": "whole number", "str": "word", "bool": "true or false", "NoneType": "nothing"}
    if isinstance(annotation, type) and get_origin(annotation) is None:
        return words.get(annotation.__name__, annotation.__name__)
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin in (Union, UnionType):
        return " or ".join(dict.fromkeys(_spelled(p) for p in parts if p is not type(None)))
    if getattr(annotation, "__metadata__", ()):
        return _spelled(parts[0])
    if origin is tuple:
        inner = [_spelled(p) for p in parts if p is not Ellipsis]
        return f"list of {inner[0]}" if Ellipsis in parts else f"[{', '.join(inner)}]"
    if "Literal" in str(origin):
        return " or ".join(map(repr, parts))
    return str(annotation).rpartition(".")[2] if origin is None else f"{_spelled(origin)} of {_spelled(parts[-1])}"


def _yaml(name: str) -> dict[str, Any]:
    """The keys of a world at a dotted path."""
    model: Any = RunSpec
    walked: list[str] = []
    for key in filter(None, name.split(".")):
        options = list(_models(model))
        fields = {alias: f for m in options for alias, f in _fields(m).items()}
        if key in fields:
            model = fields[key].annotation
        elif not (inner := _values(model)):
            words = f"the keys here are {listing(fields, 40)}" if fields else "nothing lies below"
            at = ".".join(walked) or "the top"
            raise TaskError(f"describe.name: there is no '{key}' at {at}{suggest(key, list(fields))}; {words}")
        else:
            model = inner[0]
        walked.append(key)
    entry = _values(model)
    data: dict[str, Any] = {"at": name or "the top", "type": _spelled(model)[:200]}
    if entry:
        data["keys"] = "names of your own; each holds what `NAME` in the path stands for"
        data["next"] = f"describe kind: yaml, name: {(name + '.') if name else ''}NAME"
        return data
    for option in _models(model):
        rows = {alias: _field(field) for alias, field in _fields(option).items()}
        data.setdefault("forms", []).append({"what": first_line(option), "keys": rows})
    return data


def _fields(model: type[BaseModel]) -> dict[str, Any]:
    return {field.alias or key: field for key, field in model.model_fields.items()}


def _field(field: Any) -> dict[str, Any]:
    row: dict[str, Any] = {"type": _spelled(field.annotation)[:160]}
    if field.description:
        row["what"] = field.description
    if field.is_required():
        row["required"] = True
    return row


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    """The models that a value may be."""
    if isinstance(annotation, type) and get_origin(annotation) is None:
        if issubclass(annotation, BaseModel):
            yield annotation
        return
    origin = get_origin(annotation)
    for part in get_args(annotation) if origin not in (dict,) else ():
        yield from _models(part)


def _values(annotation: Any) -> list[Any]:
    """What the entries of a mapping with free names are."""
    if get_origin(annotation) is dict:
        return [get_args(annotation)[1]]
    if get_origin(annotation) in (Union, UnionType) or getattr(annotation, "__metadata__", ()):
        return [value for part in get_args(annotation) for value in _values(part)]
    return []


_ABOUT = {
    "robot": _robot,
    "engine": _engine,
    "command": _command,
    "predicate": _predicate,
    "asset": _asset,
    "yaml": _yaml,
}

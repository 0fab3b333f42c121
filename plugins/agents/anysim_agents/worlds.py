"""Worlds that an agent writes itself: YAML as text, of which nothing may lead to a file, within stated limits."""

import re
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from anysim import registry
from anysim.api import load, watched
from anysim.assets.uri import SCHEMES
from anysim.errors import SpecError, SpecIssue, listing
from anysim.plugin_parameters import parameters
from anysim_agents.limits import AgentLimits
from anysim_schemas.collect import written_out
from anysim_schemas.load import LoadedRun
from anysim_schemas.nodes import Fault, Mark, Node, in_order
from anysim_schemas.object_source import PROCEDURAL, most
from anysim_schemas.run import RunSpec
from anysim_schemas.yaml import parse

NAME = "world.yaml"
"""What errors call the text."""
PROSE = frozenset({"description", "reason", "label"})
"""Keys whose text is for people."""
FILE_KEYS = frozenset(
    {
        *("mesh", "asset", "folder", "pattern", "packages", "file", "image", "proposal", "solution"),
        *("bank", "insertions", "living", "path", "root"),
    }
)
"""Keys that name files, or folders."""
_ENDING = re.compile(
    r"\.(ya?ml|json|xml|urdf|mjcf|xacro|stl|obj|dae|glb|gltf|ply|png|jpe?g|bmp|tga|npy|npz|onnx|pt|pth|mcap|csv|txt)"
    r"(#.*)?$",
    re.IGNORECASE,
)
_REFERENCE = re.compile(r"[A-Za-z]\w*(\.\w+)*/[A-Za-z]\w*(\.\w+)*")
"""An affordance such as `block/mouth`, or an observed image."""
_TASK = re.compile(r"task:[A-Za-z0-9_.:-]+")
REMEDY = (
    "a world that is sent as text has shapes (box, sphere, cylinder, capsule), `procedural:NAME` (list_catalog kind: "
    "assets), robots of the catalogue, and `extends: task:NAME`"
)


RUNS = "can run it"


def read(text: str, limits: AgentLimits) -> LoadedRun:
    """The run that a text describes, with a task that only watches where it has none.

    Raises:
        SpecError: every fault with line and column, as `world.yaml:7:13`; a name of a file; more than the limits.
    """
    return watched(_read(text, limits, None))


def _read(text: str, limits: AgentLimits, past: list[SpecIssue] | None) -> LoadedRun:
    """The run, or what is whole of it where `past` takes the faults; within the limits."""
    root = _parsed(text, limits)
    if found := list(_leading_out(root, ())):
        raise SpecError(in_order(found, [NAME]))
    with _file(text) as path:
        try:
            loaded = load(path, past=past)
        except SpecError as error:
            raise renamed(error, path) from None
        if past:
            past[:] = renamed(SpecError(past), path).issues
    named = {key: place.replace(str(path), NAME) for key, place in loaded.provenance.items()}
    loaded = LoadedRun(loaded.spec, named, tuple(file for file in loaded.files if file != path), loaded.data)
    if issues := [*_files_of_skills(loaded), *_beyond(loaded, limits)]:
        raise SpecError(issues)
    return loaded


@contextmanager
def _file(text: str) -> Iterator[Path]:
    """The text as a file, alone in a folder of its own, for as long as it is read."""
    with tempfile.TemporaryDirectory(prefix="anysim-") as folder:
        path = Path(folder).resolve() / NAME
        path.write_text(text, encoding="utf-8")
        yield path


def renamed(error: SpecError, path: Path) -> SpecError:
    """The error with the name that the agent knows in place of that of the file."""
    issues = [(_told(i.where, path), i.path, _told(i.message, path)) for i in error.issues]
    return SpecError([SpecIssue(*issue) for issue in issues])


def _told(words: str, path: Path) -> str:
    return words.replace(str(path), NAME).replace(str(path.parent), "the world")


def report(text: str, limits: AgentLimits, all_engines: bool) -> dict[str, Any]:
    """What `anysim check` says of a text: faults, warnings, and which engines can run it."""
    from anysim_inspect.cli.check import report_on

    past: list[SpecIssue] = []
    try:
        _read(text, limits, past)
    except SpecError as error:  # nothing of it can be looked at any further, or is to be
        faults = [*past, *error.issues]
        return {"ok": False, "faults": list(dict.fromkeys(str(issue) for issue in faults))}
    with _file(text) as path:
        found = report_on(str(path), None, all_engines, [])

    engines = {answer.engine: _told(answer.refusal, path) or RUNS for answer in found.answers}
    faults, warnings = ([_told(words, path) for words in several] for several in (found.faults, found.warnings))
    return {"ok": not faults, "faults": faults, "warnings": warnings, "engines": engines}


def _parsed(text: str, limits: AgentLimits) -> Node:
    size = len(text.encode("utf-8", "replace"))
    if size > limits.yaml_bytes:
        words = f"the text has {size:,} bytes; at most {limits.yaml_bytes:,} are taken: use `extends` and `count`"
        raise SpecError([SpecIssue(NAME, "", words)])
    faults: list[Fault] = []
    root = parse(text, NAME, faults)
    if root is None or not isinstance(root.value, dict):
        mark = Mark(NAME, 1, 1)
        words = "a world is a mapping of keys such as `world:` and `task:` at its top (describe kind: yaml)"
        raise SpecError(in_order(faults or [Fault(mark, "", words)], [NAME]))
    return root


# ---------------------------------------------------------------------------------------------- nothing leads to files


def _leading_out(node: Node, keys: tuple[str, ...]) -> Iterator[Fault]:
    """Every value that could be the name of a file, or start processes, with its place."""
    path = ".".join(keys)
    if isinstance(node.value, dict):
        if keys == ("engine",) and (more := [key for key in node.value if key != "name"]):
            words = f"an agent's world chooses an engine by its name alone, without {listing(more)}"
            yield Fault(node.place, path, words)
        for key, child in node.value.items():
            if why := _suspicious(key):
                yield Fault(child.key or child.mark, ".".join((*keys, key)), f"{why}; {REMEDY}")
            yield from _leading_out(child, (*keys, key))
    elif isinstance(node.value, list):
        for number, item in enumerate(node.value):
            yield from _leading_out(item, (*keys, str(number)))
    elif isinstance(node.value, str) and not PROSE & set(keys[-1:]):
        if why := _refusal(node.value, keys):
            yield Fault(node.mark, path, f"{why}; {REMEDY}")


def _refusal(value: str, keys: tuple[str, ...]) -> str:
    """Why a value is not taken; empty where it is."""
    shown = repr(value[:60])
    if keys[:1] == ("extends",):
        return "" if _TASK.fullmatch(value) else f"an agent's world extends installed tasks alone, not {shown}"
    if value.startswith(PROCEDURAL):
        return _suspicious(value.removeprefix(PROCEDURAL))
    if FILE_KEYS & set(keys):
        return f"a text cannot name a file or a folder, got {shown}"
    return _suspicious(value, references=keys[:1] in (("task",), ("collect",)))


def _suspicious(value: str, references: bool = False) -> str:
    """Why a text could lead to a file; empty where it cannot. `references` to affordances have a slash."""
    scheme = value.partition(":")[0]
    parts = re.split(r"[/\\]", value)
    leads = (
        "\0" in value
        or "\\" in value
        or value[:1] in ("/", "~", ".")
        or ".." in parts
        or (len(parts) > 1 and not (references and _REFERENCE.fullmatch(value)))
        or (":" in value and scheme.lower() in (*SCHEMES, "http", "https", "ftp", "data"))
        or bool(_ENDING.search(value))
    )
    return f"a text cannot name a file or a folder, got {value[:60]!r}" if leads else ""


def paths_of(skill: str) -> list[str]:
    """The parameters of an installed skill that name files or folders, which no agent may give."""
    found = parameters(registry.load("skills", skill))
    return [name for name, parameter in found.items() if "pathlib." in str(parameter.annotation)]


def refuse_files(skill: str, params: Mapping[str, Any], path: str) -> Iterator[SpecIssue]:
    """An issue for each parameter of a skill that names a file, or could."""
    for name in set(params) & set(paths_of(skill)):
        yield SpecIssue("", f"{path}.{name}", "it names a file, which an agent cannot; leave it out")
    for name, value in params.items():
        for words in _texts(value):
            if why := _suspicious(words, references=True):
                yield SpecIssue("", f"{path}.{name}", why)


def _texts(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        for key, item in value.items():
            yield from (*_texts(str(key)), *_texts(item))
    elif isinstance(value, list | tuple):
        for item in value:
            yield from _texts(item)


def _files_of_skills(loaded: LoadedRun) -> Iterator[SpecIssue]:
    """Skills that the text gives files; what an installed task gives its own is its own matter."""
    task, collect = loaded.spec.task, loaded.spec.collect
    skills = [("task.expert", task.expert.skill, task.expert.params)] if task and task.expert else []
    if collect is not None:
        every = written_out(collect.commands, "collect.commands")
        skills += [(path, spec.do, spec.params) for spec, path in every]
    for path, skill, params in skills:
        own = {k: v for k, v in params.items() if loaded.provenance.get(f"{path}.{k}", "").startswith(NAME)}
        yield from refuse_files(skill, own, path)


# ------------------------------------------------------------------------------------------------------------- limits


def _beyond(loaded: LoadedRun, limits: AgentLimits) -> Iterator[SpecIssue]:
    """What of a run is more than an agent may ask for."""
    spec: RunSpec = loaded.spec
    world, physics = spec.world, spec.physics

    def issue(path: str, words: str) -> SpecIssue:
        place = next((loaded.provenance[p] for p in _above(path) if p in loaded.provenance), NAME)
        return SpecIssue(place, path, words)

    count = len(world.robots) + sum(1 if o.count is None else most(o.count) for o in world.objects.values())
    if count > limits.things:
        yield issue(
            "world.objects", f"{count} robots and objects; at most {limits.things} are taken, instances counted"
        )
    if len(world.families or ()) > limits.families:
        yield issue("world.families", f"{len(world.families or ())} families; at most {limits.families} are taken")
    if len(world.cameras) > limits.cameras:
        yield issue("world.cameras", f"{len(world.cameras)} cameras; at most {limits.cameras} are taken")
    for name, camera in world.cameras.items():
        wide, high = camera.size
        if wide * high > limits.pixels:
            words = f"an image of {wide}x{high}; at most {limits.pixels} pixels are taken"
            yield issue(f"world.cameras.{name}.size", words)
    if physics.control_dt / physics.dt > limits.substeps:
        steps = physics.control_dt / physics.dt
        words = f"{steps:.0f} physics steps in a control step; at most {limits.substeps} are taken"
        yield issue("physics.dt", words)
    if spec.task is not None and spec.task.horizon > limits.horizon:
        yield issue("task.horizon", f"{spec.task.horizon} control steps; at most {limits.horizon} are taken")
    if spec.engine.shards != 1:
        yield issue("engine.shards", "an agent's world starts no processes")


def _above(path: str) -> Iterator[str]:
    while path:
        yield path
        path = path.rpartition(".")[0]

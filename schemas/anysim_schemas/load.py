"""Files, `extends:` and overrides to one validated spec, or to every fault with its place."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar, cast

from pydantic import BaseModel, ValidationError

from anysim_schemas.alternates import with_robot
from anysim_schemas.entries import places
from anysim_schemas.errors import SpecError, SpecIssue
from anysim_schemas.faults import locate
from anysim_schemas.levels import split, with_level
from anysim_schemas.merging import override, override_name
from anysim_schemas.messages import suggest
from anysim_schemas.nodes import Fault, Node, from_data, in_order
from anysim_schemas.plugin import OptionsResolver
from anysim_schemas.run import RunSpec
from anysim_schemas.salvage import without
from anysim_schemas.scene import SceneReader, with_scene
from anysim_schemas.shapes import Shape
from anysim_schemas.slots import check_slots
from anysim_schemas.sources import ExtendsResolver, Reader, Source

M = TypeVar("M", bound=BaseModel)

ROUNDS = 3
"""How often what is wrong is left out: a section under its right name may have faults of its own."""


@dataclass(frozen=True)
class LoadedSpec(Generic[M]):
    """A spec and where it came from.

    Attributes:
        spec: the validated spec.
        provenance: dotted path of every value that was written: `pick.yaml:14:7`, `-o physics.dt=0.004`, or `data`.
        files: the files that were read; what is extended comes before what extends it.
        data: the merged mapping as plain data, as it was validated.
    """

    spec: M
    provenance: Mapping[str, str]
    files: tuple[Path, ...]
    data: Mapping[str, Any]

    def where(self, path: str) -> str:
        """Where the value at a dotted path came from; `default` where no file gives it.

        Raises:
            KeyError: the spec has no such path.
        """
        if path in self.provenance:
            return self.provenance[path]
        place: object = self.spec.model_dump(by_alias=True)
        for part in path.split("."):
            children = _children(place)
            if part not in children:
                raise KeyError(f"the spec has no '{path}'{suggest(part, list(children))}")
            place = children[part]
        return "default"


def _children(value: object) -> dict[str, object]:
    """The entries of a mapping by key, the items of a list by index."""
    if isinstance(value, Mapping):
        return {str(key): child for key, child in cast("Mapping[object, object]", value).items()}
    return (
        {str(i): item for i, item in enumerate(cast("Sequence[object]", value))}
        if isinstance(value, tuple | list)
        else {}
    )


LoadedRun = LoadedSpec[RunSpec]


def load_run(
    sources: Source | Sequence[Source],
    *,
    overrides: Iterable[str] = (),
    resolver: OptionsResolver | None = None,
    extends: ExtendsResolver | None = None,
    base_data: Mapping[str, Any] | None = None,
    past: list[SpecIssue] | None = None,
    scene: SceneReader | None = None,
) -> LoadedRun:
    """`load` for the root of a run."""
    return load(
        RunSpec,
        sources,
        overrides=overrides,
        resolver=resolver,
        extends=extends,
        base_data=base_data,
        past=past,
        scene=scene,
    )


def load(
    model: type[M],
    sources: Source | Sequence[Source],
    *,
    overrides: Iterable[str] = (),
    resolver: OptionsResolver | None = None,
    extends: ExtendsResolver | None = None,
    base_data: Mapping[str, Any] | None = None,
    past: list[SpecIssue] | None = None,
    scene: SceneReader | None = None,
) -> LoadedSpec[M]:
    """Read, merge and validate a spec.

    Args:
        model: the spec at the root.
        sources: files or mappings; of several the later is merged on top.
        overrides: `physics.dt=0.004`, on top of the files, in order.
        resolver: the models of plugins' options; without it the slots of plugins are not checked.
        extends: turns `scheme:name` in `extends:` into the path of a file.
        base_data: data beneath all files, such as an engine chosen by the environment.
        past: where given, faults that leave the rest of the data whole, such as an unknown key, are added to it in
            place of being raised, and the spec is that of the rest: what else is wrong can still be looked for.

        scene: reads the file that `world.source` names; without it the file stays unread.

    Raises:
        SpecError: holds everything that is wrong, in the order of the files.
    """
    shapes = (Shape(model),)
    overrides = tuple(overrides)
    reader = Reader(shapes, extends)
    given = [sources] if isinstance(sources, str | Path | Mapping) else list(sources)
    nodes = [None if base_data is None else from_data(base_data), *(reader.read(source) for source in given)]
    order = [*reader.names, *map(override_name, overrides)]
    faults = reader.faults
    if reader.fatal:
        raise SpecError(in_order([*reader.fatal, *faults], order))
    about, others = split(overrides)
    root = with_level(override(reader.merged(nodes), about, shapes, faults), shapes, faults)
    root = override(with_robot(root, shapes, faults), others, shapes, faults)
    root = with_scene(root, scene, shapes, faults)
    refused = {fault.mark for fault in faults if fault.mark.line}  # what such a value is taken for says nothing new
    spec, invalid = _validated(model, root, resolver)
    if spec is None or faults or invalid:
        faults += [fault for fault in invalid if fault.mark not in refused]
        rest = None if past is None else _rest(model, root, resolver, faults)
        if rest is None or past is None:
            raise SpecError(in_order(faults, order))
        past += in_order(faults, order)
        root, spec = rest
    data = root.plain()
    provenance = {path: str(mark) or "data" for path, mark in places(root, shapes)}
    return LoadedSpec(spec, provenance, tuple(reader.files), data)


def _validated(model: type[M], root: Node, resolver: OptionsResolver | None) -> tuple[M | None, list[Fault]]:
    slots = [] if resolver is None else check_slots(model, root, resolver)
    try:
        return model.model_validate(root.plain()), slots
    except ValidationError as error:
        return None, [*locate(error, model, root), *slots]


def _rest(model: type[M], root: Node, resolver: OptionsResolver | None, faults: list[Fault]) -> tuple[Node, M] | None:
    """The data without what is wrong, and its spec; faults that only then are seen are added to the others.

    None where that is no spec, or where what was left out is missed: the new faults would be of our making.
    """
    found, told = faults, list(faults)
    for _ in range(ROUNDS):
        rest = without(root, found, (Shape(model),))
        if rest is None:
            return None
        spec, found = _validated(model, rest, resolver)
        if spec is not None and not found:
            faults[:] = told
            return rest, spec
        if any(f"{old.path}.".startswith(f"{new.path}.") for old in told for new in found):
            return None
        told += found
        root = rest
    return None

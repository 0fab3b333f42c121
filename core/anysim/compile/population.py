"""Compilation of the declared objects: how many of each there can be, and what each can be.

An object of one source is one entity of its own name. Where it can be several things, each is an entity `mug~0`,
`mug~1`, …, and a slot says that they are one object; where it has a count there are `cube_0`, `cube_1`, … of it.
"""

from collections.abc import Mapping
from itertools import product
from pathlib import Path

from anysim.assets.instancer import instanced
from anysim.assets.model import ImportedModel, ImportNote
from anysim.compile.builder import WorldBuilder
from anysim.compile.object import object_model, place_model
from anysim.compile.variants import INSTANCER, KeyedSource, Options, counts, instances, sizes, sources
from anysim.errors import AssetError, listing
from anysim.issues import Issues
from anysim.model.world import Slot
from anysim_schemas.objects import ObjectSpec

MAX_FORMS = 1024
"""An object that can be more things than this is refused: each of them is built."""


def check_names(objects: Mapping[str, ObjectSpec], robots: Mapping[str, object], issues: Issues) -> None:
    """Names that a count makes must be free; `issues` is at the path of the objects."""
    for name, spec in objects.items():
        made = instances(name, spec)
        taken = [one for one in made if one != name and (one in objects or one in robots)]
        if taken:
            issues.add(
                f"{name}.count",
                f"the {len(made)} instances of '{name}' are called {listing(made, 4)}, but {listing(taken)} "
                f"{'is' if len(taken) == 1 else 'are'} declared as well; rename one of them",
            )


def add_population(
    builder: WorldBuilder, name: str, spec: ObjectSpec, issues: Issues, *, base: Path | None
) -> tuple[list[ImportNote], list[Slot]]:
    """Add all that a declared object can be; what is wrong goes to `issues`, whose path is that of the object.

    Returns:
        Notes of the importers, and the slots of what is not the same in every env.
    """
    try:
        origins, nominal = sources(spec, base)
    except AssetError as error:
        issues.asset("source", error)
        return [], []
    scales = sizes(spec)
    if len(origins) * len(scales.values) > MAX_FORMS:
        issues.add(
            "source",
            f"{len(origins)} sources in {len(scales.values)} sizes are {len(origins) * len(scales.values)} "
            f"things to build, more than {MAX_FORMS}; narrow the folder's pattern, or give fewer `sizes`",
        )
        return [], []
    forms = list(product(origins, scales.values))
    models = [object_model(name, spec, origin, size, issues, base) for origin, size in forms]
    whole = [_whole(spec, model) for model in models if model is not None]
    if len(whole) < len(forms):
        return [], []
    first = nominal * len(scales.values) + scales.nominal
    slots = _add(builder, name, spec, [origin for origin, _ in forms], whole, first)
    return [note for model in whole for note in model.report], slots


def _whole(spec: ObjectSpec, model: ImportedModel) -> ImportedModel:
    if spec.family != INSTANCER:
        return model
    assert isinstance(spec.count, int)  # the spec sees to it
    return instanced(model, spec.count, fixed=spec.fixed, columns=spec.grid, gap=spec.gap)


def _add(
    builder: WorldBuilder,
    name: str,
    spec: ObjectSpec,
    origins: list[KeyedSource],
    models: list[ImportedModel],
    first: int,
) -> list[Slot]:
    """The entities of all instances. `first` is the model that is there nominally."""
    names = instances(name, spec)
    number = Options((1,)) if spec.count is None or spec.family == INSTANCER else counts(spec.count)
    there = number.values[number.nominal]
    slots: list[Slot] = []
    for i, one in enumerate(names):
        made: list[int] = []
        for k, (origin, model) in enumerate(zip(origins, models, strict=True)):
            made.append(len(builder.entities))
            place_model(
                builder,
                one if len(models) == 1 else f"{one}~{k}",
                spec,
                origin.source,
                model,
                category=name,
                instance=i,
                family=INSTANCER if spec.family == INSTANCER else "",
            )
        if len(made) > 1 or number.drawn is not None:
            rest = [entity for entity in made if entity != made[first]]
            slots.append(Slot(one, name, i, (made[first], *rest), i < there))
    return slots

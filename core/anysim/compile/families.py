"""Compilation of families: the entities that plugins of the kind `families` put into a World."""

from collections.abc import Mapping
from itertools import combinations
from typing import NamedTuple

from anysim import registry
from anysim.assets.model import ImportedModel
from anysim.compile.builder import WorldBuilder
from anysim.conventions import WORLD
from anysim.errors import AnysimError, Issues, PluginError, SpecError
from anysim.model.world import BodyKind, EntityKind
from anysim.plugin_parameters import checked
from anysim_schemas.families import FamilySpec


class FamilyPart(NamedTuple):
    """An entity of a family.

    Attributes:
        name: of the entity.
        model: its bodies are all roots, each at its place in the world; its links and joints, where it has any, follow.
            Matter that engines do not hold is one static body without geoms, which gives it a name and an id.
        label: what people call it.
        driven: the family says where its bodies go (`Family.drive`): they pass through the ground, what is fixed, and
            one another, which could not yield either.
    """

    name: str
    model: ImportedModel
    label: str = ""
    driven: bool = False


def add_families(builder: WorldBuilder, families: Mapping[str, FamilySpec], issues: Issues) -> None:
    """Add what families are made of; faults go to `issues`, which is at the families' path."""
    driven: list[int] = []
    for name, spec in families.items():
        try:
            made, who = registry.load("families", spec.kind), f"the family '{spec.kind}'"
            if not hasattr(made, "parts"):  # the class itself stands to the right of here; its manager checks it
                raise PluginError(
                    f"{who} of {registry.origin(made)} is no Family; derive it from anysim.families.base.Family"
                )
            values = checked(made.spec, spec.params, "")
            with registry.Blame(who, registry.origin(made)):
                parts: tuple[FamilyPart, ...] = tuple(made.parts(name, values))
        except SpecError as error:
            for issue in error.issues:
                issues.add(f"{name}{issue.path if issue.path.startswith('.') else f'.{issue.path}'}", issue.message)
            continue
        except AnysimError as error:
            issues.add(name, str(error))
            continue
        taken, own = {entity.name for entity in builder.entities}, set[str]()
        for number, part in enumerate(parts):
            if part.name in own:
                issues.add(name, f"{who} of {registry.origin(made)} makes two parts called '{part.name}'")
                continue
            if part.name in taken:
                issues.add(name, f"there is already an entity '{part.name}'; give the family another name")
                continue
            own.add(part.name)
            root = part.model.bodies[0]
            entity = builder.add(
                part.name,
                EntityKind.OBJECT,
                part.model,
                root=root.kind,
                position=root.position,
                quaternion=root.quaternion,
                label=part.label or name,
                category=name,
                instance=number,
                family=spec.kind,
            )
            driven += range(entity.body_start, entity.body_stop) if part.driven else ()
    still = [i for i, body in enumerate(builder.bodies) if body.kind is BodyKind.STATIC]
    if driven:
        builder.excluded |= {(min(a, b), max(a, b)) for a in (WORLD, *still) for b in driven}
        builder.excluded |= set(combinations(driven, 2))

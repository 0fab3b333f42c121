"""Anchors: regions of an asset that a person or a vision-language model proposes to take hold of, as a JSON document.

They are proposals alone, which no skill reads: a bank made of them holds what was sampled there, and held in physics.
Functional priors come after that, as a factor on the margins by which a skill ranks its candidates.
"""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from anysim.errors import AssetError, NameLookupError, SpecError, SpecIssue
from anysim.model.affordances import Affordance, AffordanceKind
from anysim.model.world import World
from anysim_banks.subject import Subject, subject_of
from anysim_schemas.base import Name, Number, Positive, Spec
from anysim_schemas.load import LoadedSpec, load

Vector = tuple[Number, Number, Number]


class Anchor(Spec):
    """One region: parts of a link, or a ball about a keypoint of it."""

    name: Name = Field(description="what the region is called, such as `spout_side`")
    kind: AffordanceKind = Field(default=AffordanceKind.BODY, description="what a hand does with it")
    link: str = Field(default="", description="the link that it is on, by its asset's name; empty: the root")
    pieces: tuple[str, ...] = Field(default=(), description="geoms of that link; empty: all that collide")
    point: Vector | None = Field(default=None, description="a keypoint in the link's frame [m]")
    radius: Positive = Field(default=0.03, description="how far around the keypoint grasps may be [m]")
    approach: tuple[Vector, ...] = Field(default=(), description="directions to come from, in the link's frame")
    use: tuple[str, ...] = Field(default=(), description="what it is for, such as `pour`")
    prior: Annotated[Number, Field(gt=0, le=1)] = Field(default=1.0, description="how fit for that use it is thought")


class Anchors(Spec):
    """The document: the format, where it comes from, and the anchors."""

    format: Literal["anysim-anchors-1"]
    source: str = Field(default="", description="who or what proposed them, for the bank's provenance")
    anchors: tuple[Anchor, ...] = Field(description="the regions")


def read_anchors(path: Path) -> LoadedSpec[Anchors]:
    """A document of anchors, with the places of its keys.

    Raises:
        AssetError: there is no such file.
        SpecError: it is no such document; every fault with line and column.
    """
    if not path.is_file():
        raise AssetError(f"there are no anchors at {path}; it is a JSON document as in docs/banks.md")
    return load(Anchors, path)


def anchored(world: World, entity: str, loaded: LoadedSpec[Anchors]) -> list[tuple[Subject, Anchor]]:
    """What banks are made of by anchors on an entity.

    Raises:
        SpecError: with its line, an anchor on a link or a piece that the entity does not have, or without mass or
            convex piece, or of a kind that fingers do not close on.
    """
    found: list[tuple[Subject, Anchor]] = []
    issues: list[SpecIssue] = []
    for number, anchor in enumerate(loaded.spec.anchors):
        spec = Affordance(anchor.name, anchor.kind, anchor.link, anchor.pieces, anchor.use, anchor.approach)
        region = None if anchor.point is None else (anchor.point, anchor.radius)
        try:
            found.append((subject_of(world, entity, spec, region), anchor))
        except (NameLookupError, AssetError) as error:
            path = f"anchors.{number}"
            issues.append(SpecIssue(loaded.where(path), path, f"the anchor '{anchor.name}': {error}"))
    if issues:
        raise SpecError(issues)
    return found

"""Anchors: regions of an asset that a person or a vision-language model proposes to take hold of, as a JSON document.

They are proposals alone: what a bank holds of them was sampled there, filtered and held in physics like all the rest.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, ValidationError

from anysim.errors import AssetError, NameLookupError
from anysim.model.affordances import Affordance, AffordanceKind
from anysim.model.world import World
from anysim_banks.subject import Subject, subject_of
from anysim_schemas.base import Name, Number, Positive, Spec

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


def read_anchors(path: Path) -> Anchors:
    """A document of anchors.

    Raises:
        AssetError: there is no such file, or it is no such document; says what is wrong where.
    """
    try:
        return Anchors.model_validate(json.loads(path.read_text()))
    except OSError as error:
        raise AssetError(f"there are no anchors at {path}: {error.strerror}") from None
    except ValidationError as error:
        first = error.errors()[0]
        raise AssetError(f"{path}: {'.'.join(map(str, first['loc']))}: {first['msg']}") from None
    except ValueError as error:
        raise AssetError(f"{path} is no JSON document: {error}") from None


def anchored(world: World, entity: str, anchors: Sequence[Anchor]) -> list[tuple[Subject, Anchor]]:
    """What banks are made of by anchors on an entity.

    Raises:
        AssetError: an anchor names a link or a piece that the entity does not have, or has no mass or convex piece.
    """
    found: list[tuple[Subject, Anchor]] = []
    for anchor in anchors:
        spec = Affordance(anchor.name, anchor.kind, anchor.link, anchor.pieces, anchor.use, anchor.approach)
        try:
            region = None if anchor.point is None else (anchor.point, anchor.radius)
            found.append((subject_of(world, entity, spec, region), anchor))
        except NameLookupError as error:
            raise AssetError(f"the anchor '{anchor.name}': {error}") from None
    return found

"""Collision geometry that a catalogue entry gives to links, where the source has none or one that is too coarse."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from anysim.assets.model import ImportedModel
from anysim.errors import AssetError, listing, suggest
from anysim.math import pose as P
from anysim.model.rounding import split
from anysim.model.world import Box, Capsule, Cylinder, Geom, Shape, Sphere
from anysim_schemas.robot_model import SolidSpec


def with_solids(model: ImportedModel, solids: Mapping[str, Sequence[SolidSpec]]) -> ImportedModel:
    """The model with the collision geometry of some links replaced; what is seen of them stays.

    Args:
        model: whose masses and visual geometry do not change.
        solids: for each link what it collides with, in the link's frame; nothing lets it touch nothing, and takes it
            from pictures where it had no other shape.

    Raises:
        AssetError: there is no such link.
    """
    if not solids:
        return model
    frames = {link: (body, P.pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))) for link, body in model.links.items()}
    frames |= {s.name: (s.body, P.pose(s.position, s.quaternion)) for s in model.sites if s.name in frames}
    for link in solids:
        if link not in frames:
            known = f"{suggest(link, list(frames))} (links: {listing(frames, 20)})"
            raise AssetError(f"collision: '{model.name}' has no link '{link}'{known}")
    geoms: list[Geom] = []
    links: list[str] = []
    for geom, link in zip(model.geoms, model.geom_links, strict=True):
        if link not in solids or not geom.collides:
            geoms.append(geom)
        elif geom.visible and solids[link]:
            geoms.append(replace(geom, collides=False))
        else:
            continue
        links.append(link)
    for link, several in solids.items():
        body, frame = frames[link]
        for number, solid in enumerate(several):
            local = P.pose(solid.position, P.from_roll_pitch_yaw(np.array(solid.roll_pitch_yaw)))
            position, quaternion = split(P.compose(frame, local))
            name = f"{link}.solid{number}"
            geoms.append(Geom(name, body, _shape(solid), position, quaternion, collides=True, visible=False))
            links.append(link)
    return replace(model, geoms=tuple(geoms), geom_links=tuple(links))


def _shape(solid: SolidSpec) -> Shape:
    """The shape with half sizes, as the World has them."""
    if solid.box is not None:
        x, y, z = solid.box
        return Box((x / 2, y / 2, z / 2))
    if solid.cylinder is not None:
        return Cylinder(solid.cylinder[0], solid.cylinder[1] / 2)
    if solid.capsule is not None:
        return Capsule(solid.capsule[0], solid.capsule[1] / 2)
    if solid.sphere is None:
        raise ValueError("a solid has exactly one shape")
    return Sphere(solid.sphere)

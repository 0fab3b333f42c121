"""Procedural assets: builders by name, their parameters, and their models in another size.

A model's lengths go by the factor, its masses by its cube, its inertias by its fifth power.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from pydantic import ValidationError

from anysim import registry
from anysim.assets.model import ImportedModel
from anysim.errors import AssetError, PluginError, SpecError, SpecIssue
from anysim.model.world import Body, Box, Capsule, Cylinder, Geom, Inertial, Joint, JointType, Shape, Site, Sphere, Vec3
from anysim.plugin_parameters import options_model, parameters
from anysim_schemas.errors import KeyFault
from anysim_schemas.object_source import PROCEDURAL


def build(name: str, params: Mapping[str, Any], *, scale: float = 1.0) -> ImportedModel:
    """What a builder of the group `anysim.assets` makes; `scale` multiplies all lengths, as an importer's does.

    Raises:
        PluginError: there is no such builder; lists those installed.
        SpecError: parameters that are unknown, of the wrong type, or that do not fit together, with paths below
            `params`.
    """
    builder = registry.load("assets", name)
    try:
        with registry.using("assets", name, (ValidationError,)):
            options = options_model(builder).model_validate(dict(params))
    except ValidationError as error:
        issues = [SpecIssue("", ".".join(map(str, ("params", *e["loc"]))), e["msg"]) for e in error.errors()]
        raise SpecError(issues) from None
    try:
        with registry.using("assets", name, (ValueError,)):
            model = builder(**{key: getattr(options, key) for key in parameters(builder)})
        if isinstance(model, ImportedModel):
            return _scaled(model, scale)
    except ValueError as error:
        path = ".".join(("params", *error.path)) if isinstance(error, KeyFault) else "params"
        raise SpecError([SpecIssue("", path, str(error))]) from None
    raise PluginError(
        f"the builder '{name}' of {registry.distribution('assets', name)} returned a {type(model).__name__}; "
        "a builder returns an anysim.assets.model.ImportedModel"
    )


def from_uri(uri: str, *, scale: float = 1.0) -> ImportedModel:
    """The model behind `procedural:NAME`, with the builder's defaults.

    Raises:
        AssetError, PluginError: there is no such builder, or it needs parameters.
    """
    name = uri.removeprefix(PROCEDURAL)
    try:
        return build(name, {}, scale=scale)
    except SpecError as error:
        raise AssetError(
            f"asset '{uri}' needs parameters ({'; '.join(map(str, error.issues))}); "
            f"write it as `procedural: {name}` with `params`"
        ) from None


def _scaled(model: ImportedModel, factor: float) -> ImportedModel:
    """All lengths times `factor`; friction and damping of joints stay, as they do where a file is scaled.

    Raises:
        ValueError: a geom is a mesh or a height field, whose maker has to scale it.
    """
    if factor == 1.0:
        return model
    curved = any(joint.mimic is not None and joint.mimic.curve for joint in model.joints)
    if model.tendons or model.spatial_tendons or model.constraints or curved:
        raise ValueError("tendons, constraints and curves of mimic joints cannot be scaled; leave `scale` at 1")
    return replace(
        model,
        bodies=tuple(_body(body, factor) for body in model.bodies),
        joints=tuple(_joint(joint, model.joints, factor) for joint in model.joints),
        geoms=tuple(_geom(geom, factor) for geom in model.geoms),
        sites=tuple(_site(site, factor) for site in model.sites),
        affordances=tuple(
            replace(a, depth=a.depth * factor, clearance=a.clearance * factor) for a in model.affordances
        ),
    )


def _vector(v: Vec3, s: float) -> Vec3:
    return (v[0] * s, v[1] * s, v[2] * s)


def _body(body: Body, s: float) -> Body:
    mass, com, (xx, yy, zz, xy, xz, yz) = body.inertial
    f = s**5
    inertial = Inertial(mass * s**3, _vector(com, s), (xx * f, yy * f, zz * f, xy * f, xz * f, yz * f))
    return replace(body, position=_vector(body.position, s), inertial=inertial)


def _unit(joint: Joint, s: float) -> float:
    return s if joint.type is JointType.PRISMATIC else 1.0


def _joint(joint: Joint, joints: Sequence[Joint], s: float) -> Joint:
    unit, mimic = _unit(joint, s), joint.mimic
    if mimic is not None:
        ratio = unit / _unit(joints[mimic.joint], s)
        mimic = mimic._replace(multiplier=mimic.multiplier * ratio, offset=mimic.offset * unit)
    return replace(
        joint,
        anchor=_vector(joint.anchor, s),
        lower=joint.lower * unit,
        upper=joint.upper * unit,
        initial=joint.initial * unit,
        mimic=mimic,
    )


def _geom(geom: Geom, s: float) -> Geom:
    return replace(geom, position=_vector(geom.position, s), shape=_shape(geom.shape, s))


def _site(site: Site, s: float) -> Site:
    return replace(site, position=_vector(site.position, s))


def _shape(shape: Shape, s: float) -> Shape:
    match shape:
        case Box(half):
            return Box(_vector(half, s))
        case Sphere(radius):
            return Sphere(radius * s)
        case Capsule(radius, half_length):
            return Capsule(radius * s, half_length * s)
        case Cylinder(radius, half_length):
            return Cylinder(radius * s, half_length * s)
        case _:
            raise ValueError(f"a {type(shape).__name__} of a procedural asset cannot be scaled; leave `scale` at 1")

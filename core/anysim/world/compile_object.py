"""An object of a spec into a World under construction."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from anysim.conventions import IDENTITY_QUATERNION
from anysim.errors import AssetError, PluginError
from anysim.world import inertia
from anysim.world.assets import locate
from anysim.world.builder import WorldBuilder
from anysim.world.colors import Rgb, rgb
from anysim.world.compile_matter import with_matter
from anysim.world.imported import ImportedModel, ImportNote
from anysim.world.importers import import_asset
from anysim.world.issues import Issues
from anysim.world.meshes import collision_mesh, visual_parts
from anysim.world.model import (
    ORIGIN,
    Body,
    BodyKind,
    Box,
    Capsule,
    Cylinder,
    EntityKind,
    Geom,
    Mesh,
    MeshShape,
    Quat,
    Shape,
    Sphere,
    Surface,
    Vec3,
)  # fmt: skip
from anysim.world.nominal import nominal
from anysim.world.presets import surface
from anysim_schemas.objects import ContactSpec, ObjectSpec, SourceSpec
from anysim_schemas.values import Choice, Range

DEFAULT_DENSITY = 1000.0  # [kg/m^3], water
DEFAULT_FRICTION = 0.8
DEFAULT_COLOR: Rgb = (0.7, 0.7, 0.7)


def add_object(
    builder: WorldBuilder, name: str, spec: ObjectSpec, issues: Issues, *, base: Path | None, position: Vec3 = ORIGIN,
    quaternion: Quat = IDENTITY_QUATERNION,
) -> list[ImportNote]:  # fmt: skip
    """Add an object; what is wrong goes to `issues`, whose path is that of the object. Returns an import's notes."""
    try:
        model = _model(name, spec, issues, base)
    except (AssetError, PluginError) as error:
        issues.asset("source", AssetError(str(error)))
        return []
    if model is None:
        return []
    model = with_matter(model, spec, issues, base)
    try:
        builder.add(
            name, EntityKind.OBJECT, model, root=BodyKind.STATIC if spec.fixed else BodyKind.FREE, position=position,
            quaternion=quaternion, label=spec.label or name, source=spec.source.mesh or spec.source.asset or "",
        )  # fmt: skip
    except AssetError as error:
        issues.asset("texture", error)
    return list(model.report)


def _model(name: str, spec: ObjectSpec, issues: Issues, base: Path | None) -> ImportedModel | None:
    color = _color(spec, issues)
    friction = DEFAULT_FRICTION if spec.friction is None else float(nominal(spec.friction))
    touch = surface(spec.contact or ContactSpec(), friction, float(nominal(spec.restitution or 0.0)))
    if spec.source.asset is not None:
        return _asset(spec, spec.source.asset, touch, color, issues, base)
    meshes: dict[str, Mesh] = {}
    if spec.source.mesh is None:
        solid = _primitive(spec.source)
        geoms = [Geom("shape", 0, solid, color=(*color, 1.0), surface=touch, collides=spec.collides)]
    else:
        geoms, solid = _mesh_geoms(spec, spec.source.mesh, touch, color, meshes, base)
    if inertia.volume(solid, meshes) <= 0:
        issues.add("source", "the mesh encloses no volume, so it cannot have a mass")
        return None
    body = Body("", BodyKind.FREE, inertial=_inertial(spec, solid, meshes))
    links = {"": 0}
    return ImportedModel(
        name, (body,), geoms=tuple(geoms), geom_links=("",) * len(geoms), meshes=tuple(meshes.values()), links=links
    )


def _primitive(source: SourceSpec) -> Shape:
    if source.box is not None:
        x, y, z = source.box
        return Box((x / 2, y / 2, z / 2))
    if source.sphere is not None:
        return Sphere(source.sphere)
    if source.cylinder is not None:
        return Cylinder(source.cylinder[0], source.cylinder[1] / 2)
    assert source.capsule is not None  # the spec has exactly one of them
    return Capsule(source.capsule[0], source.capsule[1] / 2)


def _inertial(spec: ObjectSpec, solid: Shape, meshes: Mapping[str, Mesh]) -> inertia.Inertial:
    density = DEFAULT_DENSITY if spec.density is None else float(nominal(spec.density))
    mass = float(nominal(spec.mass)) if spec.mass is not None else density * inertia.volume(solid, meshes)
    return inertia.moving(inertia.of_shape(solid, mass, meshes))


def _mesh_geoms(
    spec: ObjectSpec, uri: str, touch: Surface, color: Rgb, meshes: dict[str, Mesh], base: Path | None
) -> tuple[list[Geom], Shape]:  # fmt: skip
    """The hull to collide (also the solid that has the mass), and the coloured parts to look at; z up."""
    path = locate(uri, base=base).path
    scale = (spec.source.scale, spec.source.scale, spec.source.scale)
    hull = collision_mesh(path, scale, upright=True)
    hull = replace(hull, name=f"{hull.name}_hull")
    meshes[hull.name] = hull
    geoms = [Geom("hull", 0, MeshShape(hull.name), surface=touch, collides=spec.collides, visible=False)]
    for i, part in enumerate(visual_parts(path, scale, upright=True)):
        meshes[part.mesh.name] = part.mesh
        shown = part.color if part.color is not None and spec.color is None else (*color, 1.0)
        geoms.append(Geom(f"visual{i}", 0, MeshShape(part.mesh.name), color=shown, collides=False))
    return geoms, MeshShape(hull.name)


def _asset(
    spec: ObjectSpec, uri: str, touch: Surface, color: Rgb, issues: Issues, base: Path | None
) -> ImportedModel | None:  # fmt: skip
    """A URDF or MJCF file. What the spec gives explicitly wins over the file; its mass is that of the whole object."""
    model = import_asset(uri, base=base, scale=spec.source.scale)
    if spec.density is not None:
        issues.add("density", "an asset file has its own masses; give `mass` to scale them, or leave it out")
    geoms: list[Geom] = []
    for geom in model.geoms:
        if not (spec.friction is None and spec.contact is None and spec.restitution is None):
            geom = replace(geom, surface=touch)
        if spec.color is not None:
            geom = replace(geom, color=(*color, geom.color[3]))
        geoms.append(geom if spec.collides else replace(geom, collides=False))
    bodies = model.bodies
    total = sum(body.inertial.mass for body in bodies)
    if not spec.fixed and bodies[0].inertial.mass <= 0:
        issues.add(
            "source", f"the root link '{bodies[0].name}' of a free object has no mass; add one, or set `fixed: true`"
        )
        return None
    if spec.mass is not None and total > 0:
        factor = float(nominal(spec.mass)) / total
        bodies = tuple(replace(body, inertial=inertia.scaled(body.inertial, factor)) for body in bodies)
    if not spec.fixed:
        root, text = inertia.repaired(bodies[0].inertial)
        bodies = (replace(bodies[0], inertial=inertia.moving(root)), *bodies[1:])
        if text is not None:
            model = replace(model, report=(*model.report, ImportNote("repaired", f"link '{bodies[0].name}'", text)))
    return replace(model, geoms=tuple(geoms), bodies=bodies)


def _color(spec: ObjectSpec, issues: Issues) -> Rgb:
    """The nominal colour; all colours that may be drawn are checked."""
    try:
        if isinstance(spec.color, Choice):
            first, *_ = [rgb(color) for color in spec.color.choice]
            return first
        if isinstance(spec.color, Range):
            low, high = (rgb(color) for color in spec.color.range)
            return (0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2]))
        return DEFAULT_COLOR if spec.color is None else rgb(nominal(spec.color))
    except ValueError as error:
        issues.add("color", str(error))
        return DEFAULT_COLOR

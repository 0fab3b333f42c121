"""Compilation of an object."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from anysim.assets.collision_shapes import with_collision
from anysim.assets.load import import_asset
from anysim.assets.meshes import WholeMesh, collision_mesh, visual_parts, whole_of
from anysim.assets.model import ImportedModel, ImportNote, noted
from anysim.assets.procedural import build
from anysim.assets.uri import locate
from anysim.compile.builder import WorldBuilder
from anysim.compile.joints import with_joints
from anysim.compile.physical import surface, with_matter
from anysim.compile.plausibility import inertial_problem, size_problem
from anysim.compile.variants import INSTANCER, KeyedSource, source_text
from anysim.conventions import IDENTITY_QUATERNION
from anysim.errors import AssetError, Issues, PluginError, SpecError, listing
from anysim.kinematics import inertia
from anysim.model.appearance import Rgb, nominal_rgb
from anysim.model.world import (
    ORIGIN,
    Body,
    BodyKind,
    Box,
    Capsule,
    Cylinder,
    Entity,
    EntityKind,
    Geom,
    Mesh,
    MeshShape,
    Quat,
    Shape,
    Sphere,
    Surface,
    Vec3,
)
from anysim.randomization.distributions import nominal
from anysim_schemas.object_source import PROCEDURAL, SourceSpec
from anysim_schemas.objects import ContactSpec, ObjectSpec
from anysim_schemas.values import Distribution

DEFAULT_DENSITY = 1000.0  # [kg/m^3], water
DEFAULT_FRICTION = 0.8
DEFAULT_COLOR: Rgb = (0.7, 0.7, 0.7)


def add_object(
    builder: WorldBuilder,
    name: str,
    spec: ObjectSpec,
    issues: Issues,
    *,
    base: Path | None,
    position: Vec3 = ORIGIN,
    quaternion: Quat = IDENTITY_QUATERNION,
) -> list[ImportNote]:
    """Add an object of one source; what is wrong goes to `issues`, at the path of the object. Returns import notes."""
    if not isinstance(spec.source, SourceSpec) or isinstance(spec.scale, Distribution) or spec.count is not None:
        issues.add("", "an object that is added to a world has one source, one scale and no count; add each by its own")
        return []
    model = object_model(name, spec, KeyedSource(spec.source, "source"), spec.scale, issues, base, builder.visual_error)
    if model is None:
        return []
    try:
        place_model(builder, name, spec, spec.source, model, position=position, quaternion=quaternion)
    except AssetError as error:
        issues.asset("texture", error)
    return list(model.report)


def place_model(
    builder: WorldBuilder,
    name: str,
    spec: ObjectSpec,
    source: SourceSpec,
    model: ImportedModel,
    *,
    category: str = "",
    instance: int = 0,
    family: str = "",
    position: Vec3 = ORIGIN,
    quaternion: Quat = IDENTITY_QUATERNION,
) -> Entity:
    """Put what `object_model` made into a World, as an entity."""
    return builder.add(
        name,
        EntityKind.OBJECT,
        model,
        root=BodyKind.STATIC if spec.fixed else BodyKind.FREE,
        position=position,
        quaternion=quaternion,
        label=spec.label or category or name,
        source=source_name(source),
        category=category,
        instance=instance,
        family=family,
    )


def source_name(source: SourceSpec) -> str:
    """The URI that a source stands for; empty for a primitive."""
    return f"{PROCEDURAL}{source.procedural}" if source.procedural else source.mesh or source.asset or ""


def object_model(
    name: str,
    spec: ObjectSpec,
    origin: KeyedSource,
    size: float,
    issues: Issues,
    base: Path | None,
    visual_error: float,
) -> ImportedModel | None:
    """An object as one of its sources makes it, `size` times as large; None where that fails, which `issues` says."""
    source = origin.source.model_copy(update={"scale": origin.source.scale * size})
    try:
        model = _model(name, spec, source, issues, origin.key, base, visual_error)
    except (AssetError, PluginError) as error:
        issues.asset(origin.key, AssetError(str(error)))
        return None
    except SpecError as error:
        for issue in error.issues:
            issues.add(f"{origin.key}.{issue.path}", issue.message)
        return None
    if model is not None:
        model = with_matter(with_joints(model, spec.joints, issues.at("joints")), spec, issues, base)
    if model is not None and not _of_family(spec, source, model, issues):
        return None
    return model


def _of_family(spec: ObjectSpec, source: SourceSpec, model: ImportedModel, issues: Issues) -> bool:
    """Whether a model is what the spec says that it must be."""
    what, moving = f"'{source_text(source)}'", len(model.joints)
    if spec.family == "articulation" and not moving:
        issues.add("family", f"{what} has no joints, so it is no articulation; leave `family` out, or say `rigid`")
    elif spec.family in ("rigid", INSTANCER) and moving:
        joints = listing([joint.name for joint in model.joints], 4)
        issues.add("family", f"{what} has {moving} joints ({joints}), so it is an articulation, not `{spec.family}`")
    else:
        return True
    return False


def _model(
    name: str, spec: ObjectSpec, source: SourceSpec, issues: Issues, key: str, base: Path | None, visual_error: float
) -> ImportedModel | None:
    color = nominal_rgb(spec.color, DEFAULT_COLOR, issues)
    friction = DEFAULT_FRICTION if spec.friction is None else float(nominal(spec.friction))
    touch = surface(spec.contact or ContactSpec(), friction, float(nominal(spec.restitution or 0.0)))
    if source.asset is not None:
        model = import_asset(
            source.asset, base=base, scale=source.scale, packages=source.packages, visual_error=visual_error
        )
        return _asset(spec, source, _collided(model, spec, source), touch, color, issues, key)
    if source.procedural is not None:
        model = build(source.procedural, source.params, scale=source.scale)
        return _asset(spec, source, model, touch, color, issues, key)
    meshes: dict[str, Mesh] = {}
    wholes: dict[str, WholeMesh] = {}
    if source.mesh is None:
        solid = _primitive(source)
        geoms = [Geom("shape", 0, solid, color=(*color, 1.0), surface=touch, collides=spec.collides)]
    else:
        geoms, solid = _mesh_geoms(spec, source, touch, color, meshes, wholes, base, visual_error)
    if problem := size_problem(solid, meshes):
        issues.add(key, problem)
        return None
    if inertia.volume(solid, meshes) <= 0:
        issues.add(key, "the mesh encloses no volume, so it cannot have a mass")
        return None
    massive = dict(meshes)
    if wholes and source.collision is not None and source.collision.method != "hull":
        for name, whole in wholes.items():  # the mass of what is there, if it is closed, and not of its hull
            mesh = whole.mesh()
            outward = replace(mesh, faces=mesh.faces[:, ::-1])  # of one whose triangles face inward
            closed = [{name: one} for one in (mesh, outward) if inertia.volume(MeshShape(name), {name: one}) > 0]
            massive |= closed[0] if whole.volume > 0 and closed else {}
    body = Body("", BodyKind.FREE, inertial=_inertial(spec, solid, massive))
    if not spec.fixed and (problem := inertial_problem(body.inertial)):
        issues.add("mass" if spec.mass is not None else "density" if spec.density is not None else key, problem)
        return None
    model = ImportedModel(
        name,
        (body,),
        geoms=tuple(geoms),
        geom_links=("",) * len(geoms),
        meshes=tuple(meshes.values()),
        links={"": 0},
        wholes=wholes,
    )
    return _collided(model, spec, source)


def _collided(model: ImportedModel, spec: ObjectSpec, source: SourceSpec) -> ImportedModel:
    """The model with the collision geometry of its source."""
    if source.collision is not None and source.collision.method == "mesh" and not spec.fixed:
        raise AssetError(
            f"'{source_name(source)}': `collision: mesh` is for what is fixed; set `fixed: true`, or say `decompose`"
        )
    return with_collision(model, source.collision)


def _primitive(source: SourceSpec) -> Shape:
    size = source.scale
    if source.box is not None:
        x, y, z = source.box
        return Box((size * x / 2, size * y / 2, size * z / 2))
    if source.sphere is not None:
        return Sphere(size * source.sphere)
    if source.cylinder is not None:
        return Cylinder(size * source.cylinder[0], size * source.cylinder[1] / 2)
    assert source.capsule is not None  # the spec has exactly one of them
    return Capsule(size * source.capsule[0], size * source.capsule[1] / 2)


def _inertial(spec: ObjectSpec, solid: Shape, meshes: Mapping[str, Mesh]) -> inertia.Inertial:
    density = DEFAULT_DENSITY if spec.density is None else float(nominal(spec.density))
    mass = float(nominal(spec.mass)) if spec.mass is not None else density * inertia.volume(solid, meshes)
    return inertia.moving(inertia.of_shape(solid, mass, meshes))


def _mesh_geoms(
    spec: ObjectSpec,
    source: SourceSpec,
    touch: Surface,
    color: Rgb,
    meshes: dict[str, Mesh],
    wholes: dict[str, WholeMesh],
    base: Path | None,
    visual_error: float,
) -> tuple[list[Geom], Shape]:
    """The hull to collide (also the solid that has the mass), and the coloured parts to look at; z up."""
    path = locate(source.mesh or "", base=base).path
    scale = (source.scale, source.scale, source.scale)
    hull = collision_mesh(path, scale, upright=True)
    hull = replace(hull, name=f"{hull.name}_hull")
    meshes[hull.name], wholes[hull.name] = hull, whole_of(path, scale, upright=True)
    geoms = [Geom("hull", 0, MeshShape(hull.name), surface=touch, collides=spec.collides, visible=False)]
    for i, part in enumerate(visual_parts(path, scale, upright=True, error=visual_error)):
        meshes[part.mesh.name] = part.mesh
        shown = part.color if part.color is not None and spec.color is None else (*color, 1.0)
        geoms.append(Geom(f"visual{i}", 0, MeshShape(part.mesh.name), color=shown, collides=False))
    return geoms, MeshShape(hull.name)


def _asset(
    spec: ObjectSpec, source: SourceSpec, model: ImportedModel, touch: Surface, color: Rgb, issues: Issues, key: str
) -> ImportedModel | None:
    """What a file or a builder makes. What the spec gives explicitly wins; its mass is that of the whole object."""
    if spec.density is not None:
        what = "a procedural asset" if source.procedural else "an asset file"
        issues.add("density", f"{what} has its own masses; give `mass` to scale them, or leave it out")
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
        issues.add(key, f"the root link '{bodies[0].name}' of a free object has no mass; add one, or set `fixed: true`")
        return None
    if spec.mass is not None and total > 0:
        factor = float(nominal(spec.mass)) / total
        bodies = tuple(replace(body, inertial=inertia.scaled(body.inertial, factor)) for body in bodies)
    if model.actuator_hints:
        text = f"{len(model.actuator_hints)} drives of its file are left out: joints of an object are not driven"
        model = noted(model, ImportNote("dropped", "actuators", text))
    if not spec.fixed:
        root, text = inertia.repaired(bodies[0].inertial)
        bodies = (replace(bodies[0], inertial=inertia.moving(root)), *bodies[1:])
        if text is not None:
            model = noted(model, ImportNote("repaired", f"link '{bodies[0].name}'", text))
    return replace(model, geoms=tuple(geoms), bodies=bodies)

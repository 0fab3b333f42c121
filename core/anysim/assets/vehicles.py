"""Changes of a vehicle's model by its entry: joints that move it over a plane, and wheels that are round."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase

from anysim.assets.model import ImportedModel
from anysim.errors import AssetError, listing, suggest
from anysim.model.world import Body, BodyKind, Geom, Inertial, Joint, JointType, Sphere, Surface
from anysim_schemas.robot_model import RobotModelSpec
from anysim_schemas.vehicle import PlanarSpec, wheels_of

PLANAR_JOINTS = ("base_x", "base_y", "base_yaw")
_ADDED = 3  # bodies and joints under the robot
# A tenth of a kilogram: nothing beside a base, yet no body without mass, which engines repair each in its own way.
_CARRIAGE = Inertial(0.1, inertia=(1e-3, 1e-3, 1e-3, 0.0, 0.0, 0.0))
CARRIAGES = 2 * _CARRIAGE.mass
"""[kg] of what `base: planar` adds."""


def as_vehicle(model: ImportedModel, entry: RobotModelSpec) -> ImportedModel:
    """The model with what its entry says of the base and of wheels.

    Raises:
        AssetError: joints of those names are there already, or links that are named are not.
    """
    vehicle = entry.vehicle
    if isinstance(vehicle, PlanarSpec):
        model = _lifted(model, vehicle.lifted, entry.name)
    elif vehicle is not None and vehicle.rolling == "sphere":
        model = _rounded(model, wheels_of(vehicle))
    return planar(model, entry.name) if entry.base == "planar" else model


def planar(model: ImportedModel, name: str) -> ImportedModel:
    """The model on joints along x and y and about z, its root fixed to the last of them.

    Raises:
        AssetError: it has joints or links of those names.
    """
    taken = sorted({*(joint.name for joint in model.joints), *model.links} & {*PLANAR_JOINTS, "rail"})
    if taken:
        raise AssetError(
            f"robot '{name}' cannot be put on `base: planar`, which adds {listing(PLANAR_JOINTS)} on a link 'rail': "
            f"its source has {listing(taken)} already; use the source's own with `base: fixed`"
        )
    root = model.bodies[0]
    rail = Body("rail", BodyKind.STATIC)
    carriages = (
        Body("base_x", BodyKind.LINK, 0, inertial=_CARRIAGE),
        Body("base_y", BodyKind.LINK, 1, inertial=_CARRIAGE),
    )
    own = [replace(body, parent=body.parent + _ADDED) for body in model.bodies[1:]]
    bodies = (rail, *carriages, replace(root, kind=BodyKind.LINK, parent=2), *own)
    axes = (
        (JointType.PRISMATIC, (1.0, 0.0, 0.0)),
        (JointType.PRISMATIC, (0.0, 1.0, 0.0)),
        (JointType.REVOLUTE, (0.0, 0.0, 1.0)),
    )
    added = [
        Joint(joint, i + 1, type, axis) for i, (joint, (type, axis)) in enumerate(zip(PLANAR_JOINTS, axes, strict=True))
    ]
    return replace(
        model,
        bodies=bodies,
        joints=(*added, *map(_shifted, model.joints)),
        geoms=tuple(replace(geom, body=geom.body + _ADDED) for geom in model.geoms),
        sites=tuple(replace(site, body=site.body + _ADDED) for site in model.sites),
        links={"rail": 0, **{link: body + _ADDED for link, body in model.links.items()}},
        actuator_hints=tuple(hint.renumbered(lambda j: j + _ADDED) for hint in model.actuator_hints),
        tendons=tuple(tendon.renumbered(lambda j: j + _ADDED) for tendon in model.tendons),
        constraints=tuple(c.renumbered(lambda b: b + _ADDED) for c in model.constraints),
        spatial_tendons=tuple(t.renumbered(lambda b: b + _ADDED) for t in model.spatial_tendons),
        excluded_pairs=frozenset((a + _ADDED, b + _ADDED) for a, b in model.excluded_pairs),
    )


def _shifted(joint: Joint) -> Joint:
    mimic = None if joint.mimic is None else joint.mimic._replace(joint=joint.mimic.joint + _ADDED)
    return replace(joint, body=joint.body + _ADDED, mimic=mimic)


def _lifted(model: ImportedModel, patterns: Sequence[str], name: str) -> ImportedModel:
    """Links that match touch nothing."""
    for pattern in patterns:
        if not any(fnmatchcase(link, pattern) for link in model.links):
            raise AssetError(
                f"robot '{name}', vehicle.lifted: no link matches '{pattern}'{suggest(pattern, list(model.links))} "
                f"(links: {listing(model.links, 20)})"
            )
    geoms, links = [], []
    for geom, link in zip(model.geoms, model.geom_links, strict=True):
        if any(fnmatchcase(link, pattern) for pattern in patterns):
            if not geom.visible:
                continue
            geom = replace(geom, collides=False)
        geoms.append(geom)
        links.append(link)
    return replace(model, geoms=tuple(geoms), geom_links=tuple(links))


def _rounded(model: ImportedModel, wheels: Mapping[str, float]) -> ImportedModel:
    """Spheres about the axles in place of what the wheels touch the ground with; their looks stay."""
    named = {joint.name: joint for joint in model.joints}
    axles = {named[name].body: (named[name], radius) for name, radius in wheels.items() if name in named}
    geoms, links = [], []
    surfaces: dict[int, Surface] = {}
    for geom, link in zip(model.geoms, model.geom_links, strict=True):
        if geom.body in axles and geom.collides:
            surfaces.setdefault(geom.body, geom.surface)
            if not geom.visible:
                continue
            geom = replace(geom, collides=False)
        geoms.append(geom)
        links.append(link)
    for body, (joint, radius) in axles.items():
        surface = surfaces.get(body, Surface())
        owner = model.bodies[body].name
        geoms.append(Geom(f"{owner}.tyre", body, Sphere(radius), joint.anchor, surface=surface, visible=False))
        links.append(owner)
    return replace(model, geoms=tuple(geoms), geom_links=tuple(links))

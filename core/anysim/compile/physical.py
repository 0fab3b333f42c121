"""Physical properties and looks of an object, on top of its source's model: contact, damping, inertia, colours."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from anysim.assets.model import ImportedModel
from anysim.compile.appearance import material, material_name, options, texture, texture_name, tint
from anysim.errors import AssetError, Issues, PluginError
from anysim.model.appearance import Material, Texture
from anysim.model.world import Geom, Inertial, Solver, Surface
from anysim.randomization.distributions import nominal
from anysim_schemas.objects import ContactSpec, ObjectSpec

PRESETS: Mapping[str, Surface] = {
    "default": Surface(),
    # Stiff rubber pads. With an engine's defaults a 40 N grip sinks millimetres into what it holds and thin handles
    # slip through; 4 ms is twice the usual step of 2 ms, the stiffest that integrates well. The pads' word counts in a
    # pair, and spin about the contact normal is resisted, else a pinched object turns like on a needle.
    "pad": Surface(softness=0.004, impedance=(0.99, 0.999), priority=1, torsional=True),
    # Foam: twice the time constant of the usual defaults and an impedance that stays low.
    "soft": Surface(softness=0.04, impedance=(0.7, 0.9), torsional=True),
}

GRIPPER_LIMIT_SOFTNESS = 0.004
"""[s] of a gripper's joint limits and mimic constraint: as stiff as its pads, else the limit gives before the pad."""


def surface(contact: ContactSpec, friction: float, restitution: float = 0.0) -> Surface:
    """The surface of a contact spec: its preset, with what else the spec gives on top."""
    chosen = replace(PRESETS[contact.preset], friction=friction, restitution=restitution)
    if contact.torsional_friction is not None:
        chosen = replace(
            chosen, torsional_friction=contact.torsional_friction, torsional=contact.torsional_friction > 0
        )
    if contact.rolling_friction is not None:
        chosen = replace(chosen, rolling_friction=contact.rolling_friction)
    if contact.priority is not None:
        chosen = replace(chosen, priority=contact.priority)
    if contact.offset is not None:
        chosen = replace(chosen, contact_offset=contact.offset)
    return chosen


def with_matter(model: ImportedModel, spec: ObjectSpec, issues: Issues, base: Path | None) -> ImportedModel:
    """The model with what the spec says of it beyond shape, mass and friction; faults go to `issues`."""
    return _with_looks(_with_dynamics(model, spec, issues), spec, issues, base)


def _with_dynamics(model: ImportedModel, spec: ObjectSpec, issues: Issues) -> ImportedModel:
    root, *rest = model.bodies
    inertial = root.inertial
    if spec.com_offset is not None:
        shift = nominal(spec.com_offset)
        x, y, z = (float(a + b) for a, b in zip(inertial.com, shift, strict=True))
        inertial = Inertial(inertial.mass, (x, y, z), inertial.inertia)
    root = replace(root, inertial=inertial)
    if spec.damping is not None:
        if spec.fixed:
            issues.add("damping", "it is fixed, so nothing slows it down; remove damping, or `fixed: true`")
        elif model.joints:
            issues.add(
                "damping",
                f"the asset has {len(model.joints)} joints, and damping is for objects of one body; give the joints "
                f"of the file damping",
            )
        root = replace(root, damping=(float(nominal(spec.damping.linear)), float(nominal(spec.damping.angular))))
    if spec.solver is not None:
        root = replace(root, solver=Solver(**spec.solver.model_dump()))
    bodies = (root, *rest)
    if spec.inertia_scale is not None:
        scale = float(nominal(spec.inertia_scale))
        bodies = tuple(replace(b, inertial=_turning(b.inertial, scale)) for b in bodies)
    return replace(model, bodies=bodies)


def _turning(inertial: Inertial, scale: float) -> Inertial:
    xx, yy, zz, xy, xz, yz = (scale * moment for moment in inertial.inertia)
    return inertial._replace(inertia=(xx, yy, zz, xy, xz, yz))


def _with_looks(model: ImportedModel, spec: ObjectSpec, issues: Issues, base: Path | None) -> ImportedModel:
    textures: dict[str, Texture] = {}
    materials: dict[str, Material] = {}
    for path, one in options(spec.texture):
        where = ".".join(part for part in ("texture", path) if part)
        try:
            made = texture(one, base)
            textures[made.name] = made
        except AssetError as error:
            issues.asset(f"{where}.image", error)
        except PluginError as error:
            issues.add(f"{where}.pattern", str(error))
        except ValueError as error:
            issues.add(f"{where}.colors", str(error))
    for _, one in options(spec.material):
        materials[material_name(one)] = material(one)
    if spec.texture is None and spec.material is None:
        return model
    painted = "" if spec.texture is None else texture_name(nominal(spec.texture))
    chosen = "" if spec.material is None else material_name(nominal(spec.material))
    geoms = tuple(_dressed(geom, spec, painted, materials.get(chosen)) for geom in model.geoms)
    return replace(model, geoms=geoms, textures=tuple(textures.values()), materials=tuple(materials.values()))


def _dressed(geom: Geom, spec: ObjectSpec, painted: str, chosen: Material | None) -> Geom:
    if not geom.visible:
        return geom
    own = geom.color[:3] if spec.color is not None else None
    color = tint(own, bool(painted), chosen) or geom.color[:3]
    opacity = geom.color[3] if chosen is None else chosen.opacity
    return replace(geom, texture=painted, material="" if chosen is None else chosen.name, color=(*color, opacity))

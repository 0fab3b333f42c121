"""Axes of variation between episodes, and what an engine must be able to change for each."""

from collections.abc import Mapping
from typing import NamedTuple

from anysim.engine.base import SimEngine
from anysim.engine.capability import Capability


class Axis(NamedTuple):
    """One kind of variation.

    Attributes:
        what: in words.
        keys: the keys of a file that take values, as people read them.
        parameters: the engine parameters that it changes; none where managers do all of it.
        capability: what an engine needs besides, where it needs something.
    """

    what: str
    keys: str
    parameters: tuple[str, ...] = ()
    capability: Capability | None = None


_DYNAMICS = "robots.R.dynamics."

AXES = (
    Axis("place and yaw of objects", "layout.O: x, y, yaw, position, …"),
    Axis("mass and density of objects", "objects.O: mass, density", ("body.mass", "body.inertia")),
    Axis("friction of objects", "objects.O.friction", ("geom.friction",)),
    Axis("colour of objects", "objects.O.color", ("geom.color",)),
    Axis("gravity", "physics.gravity", ("world.gravity",)),
    Axis("place and yaw of a robot's base", "robots.R: position, yaw"),
    Axis("joints at the start", "robots.R: home, home_velocity, home_noise"),
    Axis("stiffness of drives", f"{_DYNAMICS}kp_scale", ("actuator.kp",)),
    Axis("damping of drives", f"{_DYNAMICS}kd_scale", ("actuator.kd",)),
    Axis("effort limits", f"{_DYNAMICS}effort_limit_scale", ("actuator.effort_limit",)),
    Axis("damping of joints", f"{_DYNAMICS}damping_scale, damping_offset", ("joint.damping",)),
    Axis("dry friction of joints", f"{_DYNAMICS}friction_scale, friction_offset", ("joint.friction",)),
    Axis("armature", f"{_DYNAMICS}armature_scale, armature_offset", ("joint.armature",)),
    Axis("masses of links", f"{_DYNAMICS}mass_scale", ("body.mass", "body.inertia")),
    Axis("payload at a link's centre of mass", f"{_DYNAMICS}payload.mass", ("body.mass",)),
    Axis("payload at a place", f"{_DYNAMICS}payload: mass, position", ("body.mass", "body.com", "body.inertia")),
    Axis("friction of links", f"{_DYNAMICS}link_friction_scale", ("geom.friction",)),
    Axis("noise and delay of actions", "robots.R.actions.C: noise, delay"),
    Axis("noise, bias and delay of observations", "task.observations.G: noise, bias, delay"),
    Axis("direction of lights", "lights.L.direction", ("light.direction",), Capability.RENDER_RGB),
    Axis("place of lights", "lights.L.position", ("light.position",), Capability.RENDER_LIGHTS),
    Axis("colour of lights", "lights.L.color", ("light.color",), Capability.RENDER_RGB),
    Axis("strength of lights", "lights.L.intensity", ("light.intensity",), Capability.RENDER_RGB),
    Axis("ambient light", "scenery.ambient", ("world.ambient",), Capability.RENDER_RGB),
    Axis("background", "scenery.background", ("world.background",), Capability.RENDER_RGB),
    Axis("shadows", "scenery.shadows", ("world.shadows",), Capability.RENDER_SHADOWS),
    Axis("place and aim of cameras", "cameras.C: from, look_at_offset, position, …", (), Capability.RENDER_RGB),
    Axis("field of view", "cameras.C.fov", (), Capability.RENDER_RGB),
    Axis("brightness and noise of images", "cameras.C: exposure, noise", (), Capability.RENDER_RGB),
)  # fmt: skip
"""Keys of the world are written without `world.`; R, O, C, L and G stand for names."""


def can(engine: type[SimEngine], axis: Axis) -> str:
    """`yes`, `approx.` or `-`, as the engine declares."""
    if not set(axis.parameters) <= engine.parameters:
        return "-"
    if axis.capability is None:
        return "yes"
    support = engine.capabilities.supported.get(axis.capability)
    return "-" if support is None else "yes" if support.exact else "approx."


def table(engines: Mapping[str, type[SimEngine]]) -> list[tuple[str, ...]]:
    """Rows of axis, keys, and a cell for each engine."""
    return [(axis.what, f"`{axis.keys}`", *(can(engine, axis) for engine in engines.values())) for axis in AXES]

"""Random changes of a world between episodes: colours, light, friction, masses and places."""

from typing import Any, NamedTuple

import numpy as np

from anysim.engine.base import SimEngine
from anysim.errors import EngineError
from anysim.math.arrays import shown
from anysim.model.world import BodyKind, EntityKind
from anysim_adapters.strands.things import finite


class Ranges(NamedTuple):
    """What is drawn, uniformly: factors on what the world was built with, colours in [0, 1], metres to either side."""

    colors: bool
    lighting: bool
    physics: bool
    positions: bool
    position_noise: float
    color_range: Any
    friction_range: Any
    mass_range: Any


def randomize(engine: SimEngine, ranges: Ranges, rng: np.random.Generator) -> list[str]:
    """Change what is asked for; returns what was changed, in words.

    Raises:
        EngineError: a range that is none.
        CapabilityError: the engine cannot change it in a running simulation.
    """
    world, done = engine.world, []
    spans = {
        name: _span(name, value)
        for name, value in (
            ("color_range", ranges.color_range),
            ("friction_range", ranges.friction_range),
            ("mass_range", ranges.mass_range),
        )
    }
    noise = finite("position_noise", ranges.position_noise)
    if noise.shape != () or noise < 0:
        raise EngineError(f"position_noise is a length [m] of 0 or more, got {shown(ranges.position_noise)}")
    if ranges.colors and world.geoms:
        colors = engine.built_parameters("geom.color").copy()
        colors[..., :3] = rng.uniform(*spans["color_range"], (*colors.shape[:-1], 3)).clip(0, 1)
        engine.set_parameters("geom.color", colors[None])
        done.append("colors")
    if ranges.lighting and world.lights:
        light = engine.built_parameters("light.intensity")
        engine.set_parameters("light.intensity", (light * rng.uniform(0.5, 1.5, light.shape))[None])
        done.append("lighting")
    if ranges.physics:
        for name, span in (("geom.friction", "friction_range"), ("body.mass", "mass_range")):
            _scale(engine, name, rng.uniform(*spans[span], engine.built_parameters(name).shape))
        done.append("physics")
    if ranges.positions:
        roots = [
            e.body_start
            for e in world.entities
            if e.kind is EntityKind.OBJECT and world.bodies[e.body_start].kind is BodyKind.FREE
        ]
        if roots:
            pose = engine.get_state().body_pose[:, roots].copy()
            pose[..., :2] += rng.uniform(-noise, noise, pose[..., :2].shape)
            engine.set_body_state(pose, np.zeros((*pose.shape[:2], 6)), bodies=roots)
        done.append("positions")
    return done


def _scale(engine: SimEngine, name: str, factor: Any) -> None:
    """A parameter of what objects are made of as it was built, times a factor; inertias go with masses."""
    world = engine.world
    objects = [e for e in world.entities if e.kind is EntityKind.OBJECT]
    bodies = [
        b for e in objects for b in range(e.body_start, e.body_stop) if world.bodies[b].kind is not BodyKind.STATIC
    ]
    which = bodies if name == "body.mass" else [i for i, geom in enumerate(world.geoms) if geom.body in bodies]
    if not which:
        return
    engine.set_parameters(name, (engine.built_parameters(name) * factor)[None, which], indices=which)
    if name == "body.mass":
        inertia = engine.built_parameters("body.inertia") * factor[..., None]
        engine.set_parameters("body.inertia", inertia[None, which], indices=which)


def _span(name: str, value: Any) -> tuple[float, float]:
    found = finite(name, value)
    if found.shape != (2,) or not 0 <= found[0] <= found[1]:
        raise EngineError(f"{name} is the least and the greatest of 0 or more, got {shown(value)}")
    return float(found[0]), float(found[1])

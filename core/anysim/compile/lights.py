"""Lights and surroundings of a spec, with the nominal value of what is drawn anew in each episode."""

from collections.abc import Mapping

import numpy as np

from anysim.issues import Issues
from anysim.model.colors import WHITE, nominal_rgb
from anysim.model.world import Light, Scenery
from anysim.randomization.distributions import nominal
from anysim_schemas.lights import LightSpec, ScenerySpec
from anysim_schemas.values import Drawn

DEFAULT_LIGHTS = (
    Light("key", direction=(-0.4, 0.3, -0.87), intensity=0.7),  # from the front right, as a lamp beside the viewer
    Light("fill", direction=(0.5, -0.6, -0.62), intensity=0.35),  # weaker, from the other side: no side is black
)
"""The lights of a world that asks for none; an engine may draw such a world with lights of its own."""


def compile_lights(specs: Mapping[str, LightSpec], issues: Issues) -> tuple[Light, ...]:
    """The lights, or a key and a fill light where none is given."""
    lights: list[Light] = []
    for name, spec in specs.items():
        direction = nominal(spec.direction)
        length = float(np.linalg.norm(direction))
        if length < 1e-9:
            text = "; choose bounds whose middle is not zero" if isinstance(spec.direction, Drawn) else ""
            issues.add(f"{name}.direction", f"a light needs a direction that is not zero{text}")
            continue
        x, y, z = (component / length for component in direction)
        position = None if spec.position is None else nominal(spec.position)
        color = nominal_rgb(spec.color, WHITE, issues, f"{name}.color")
        lights.append(Light(name, (x, y, z), position, color, nominal(spec.intensity)))
    return tuple(lights) if specs else DEFAULT_LIGHTS


def compile_scenery(spec: ScenerySpec, issues: Issues) -> Scenery:
    """Background, ambient light and shadows; None where the engine decides."""
    background = None if spec.background is None else nominal_rgb(spec.background, WHITE, issues, "background")
    ambient = None if spec.ambient is None else nominal_rgb(spec.ambient, WHITE, issues, "ambient")
    return Scenery(background, ambient, None if spec.shadows is None else bool(nominal(spec.shadows)))

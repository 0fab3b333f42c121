"""Trial of one engine in this process, `python -m anysim_inspect.engine_trial NAME`: a ball falls and is drawn.

Prints one JSON document per finding as soon as it is known: what a crash leaves unprinted is what crashed.
"""

import json
import sys
from typing import Any

import numpy as np

from anysim import registry
from anysim.engine.availability import Finding, Health
from anysim.engine.capability import Capability
from anysim.engine.factory import engine_class
from anysim.errors import AnysimError
from anysim.model.world import Body, BodyKind, Camera, Entity, EntityKind, Geom, Inertial, Sphere, World

HEIGHT, RADIUS, STEPS = 1.0, 0.1, 100
TOLERANCE = 0.02
"""Relative, of the distance fallen: a first-order integrator is off by 1/n after n steps."""


def ball(drawn: bool) -> World:
    """A ball in the air, red, with a camera in front of it where it is to be drawn."""
    front = Camera("front", -1, (0.0, -1.0, HEIGHT), (-(0.5**0.5), 0.0, 0.0, 0.5**0.5), 45.0, 64, 64)
    inertial = Inertial(1.0, inertia=(0.004, 0.004, 0.004, 0.0, 0.0, 0.0))
    return World(
        "ball",
        bodies=(Body("ball", BodyKind.FREE, position=(0.0, 0.0, HEIGHT), inertial=inertial),),
        geoms=(Geom("ball", 0, Sphere(RADIUS), color=(0.9, 0.1, 0.1, 1.0), collides=False),),
        entities=(Entity("ball", EntityKind.OBJECT, 0, 1, 0, 0),),
        cameras=(front,) if drawn else (),
    )


def physics(name: str, engine: Any) -> tuple[Finding, bool]:
    """Whether the ball falls as it must; engines without dynamics move nothing, and that is right for them."""
    what, world = f"{name}: physics", engine.world
    before = engine.get_state().body_pose[0, 0, 2]
    engine.step(STEPS)
    fallen = float(before - engine.get_state().body_pose[0, 0, 2])
    if Capability.DYNAMICS not in engine.capabilities:
        return Finding(what, Health.ABSENT, "a kinematic engine: it moves only what drives move"), False
    duration = STEPS * world.physics.dt
    expected = -world.physics.gravity[2] * duration**2 / 2
    right = abs(fallen - expected) <= TOLERANCE * expected
    found = f"a ball falls {fallen:.4f} m in {duration:g} s; g t^2 / 2 is {expected:.4f} m"
    return Finding(what, Health.OK if right else Health.WRONG, found, "" if right else "report it"), right


def rendering(name: str, engine: Any) -> Finding:
    """Whether the ball is in its picture, and what drew it."""
    what = f"{name}: rendering"
    if Capability.RENDER_RGB not in engine.capabilities:
        return Finding(what, Health.ABSENT, "this engine does not draw")
    engine.reset()
    pixels = engine.render("front")["rgb"][0].astype(int)
    middle, corner = pixels[32, 32], pixels[1, 1]
    if np.abs(middle - corner).sum() < 30 or middle[0] <= middle[1]:
        return Finding(
            what, Health.WRONG, f"{engine.renderer_name()}: the red ball is not in its picture", "try another driver"
        )
    return Finding(what, Health.OK, engine.renderer_name())


def main(name: str) -> None:
    """Try the engine `name` and print what was found."""

    def say(finding: Finding, works: bool = False) -> None:
        sys.stdout.write(json.dumps(finding._asdict() | {"works": works}) + "\n")
        sys.stdout.flush()

    try:
        made = engine_class(name)
        with made() as engine:
            engine.create_world(ball(Capability.RENDER_RGB in engine.capabilities))
            say(*physics(name, engine))
            try:
                say(rendering(name, engine))
            except BaseException as error:  # noqa: BLE001  as below
                say(Finding(f"{name}: rendering", Health.BROKEN, _words(error)))
            for finding in made.findings():
                say(finding)
    except BaseException as error:  # noqa: BLE001  whatever an engine does here, sys.exit too, belongs into its row
        remedy = registry.remedy(registry.distribution("engines", name))
        say(Finding(f"{name}: physics", Health.BROKEN, _words(error), remedy))


def _words(error: BaseException) -> str:
    return str(error) if isinstance(error, AnysimError) else registry.in_words(error)


if __name__ == "__main__":
    main(sys.argv[1])

"""Moments of an env as they are shown: copies, so that the env may move on while the page draws."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.capability import Capability
from anysim.engine.state import ContactPoints
from anysim.record.film import capture_of
from anysim.task.env import TaskEnv
from anysim_viewer.solids import Looks, built_looks


class Matter(NamedTuple):
    """A family: points (P, 3) [m], their radius [m], faces (F, 3) of a surface, and red, green, blue in [0, 1]."""

    points: Array
    radius: float
    faces: Array
    color: Array


@dataclass(frozen=True)
class Moment:
    """An env at a control step.

    Attributes:
        step: control steps since the reset.
        time: simulated time since then [s].
        body_pose: (B, 7).
        present: (E,) bool, which entities are there.
        goals: world poses (7,) by name.
        matter: points by family.
        contacts: of the env; None where they are not asked for.
        image: (H, W, 3) uint8 of the chosen camera; None without one.
    """

    step: int
    time: float
    body_pose: Array
    present: Array
    goals: Mapping[str, Array] = field(default_factory=dict)
    matter: Mapping[str, Matter] = field(default_factory=dict)
    contacts: ContactPoints | None = None
    image: Array | None = None


@dataclass
class Selection:
    """What is to be shown beside bodies: chosen in the page.

    Attributes:
        contacts: points and forces.
        matter: points of families.
        camera: whose image; empty for none.
    """

    contacts: bool = False
    matter: bool = True
    camera: str = ""


OVERVIEW = "overview"
"""The camera of a world that has none: what an engine calls `default`."""


def cameras_of(engine: SimEngine) -> list[str]:
    """The cameras that an engine can draw from; none where it draws nothing."""
    if Capability.RENDER_RGB not in engine.capabilities:
        return []
    return [*(camera.name for camera in engine.world.cameras if "rgb" in camera.channels), OVERVIEW]


def picture(env: TaskEnv, camera: str, i: int) -> Array:
    """The image (H, W, 3) uint8 of a camera in env `i`, goals marked.

    Raises:
        EngineError: the engine cannot draw it.
    """
    if camera == OVERVIEW:
        return env.render("default", [i], size=(480, 360))[0]
    return capture_of(env).picture(camera, np.array([i]))[0]


def moment_of(env: TaskEnv, i: int, wanted: Selection) -> Moment:
    """Env `i` now; an engine is asked for what is wanted only."""
    state, engine = env.engine.get_state(), env.engine
    ids = np.array([i])
    contacts = engine.contacts(ids) if wanted.contacts and Capability.CONTACT_POINTS in engine.capabilities else None
    image = picture(env, wanted.camera, i) if wanted.camera else None
    return Moment(
        step=int(env.scene.elapsed[i]),
        time=float(state.time[i]),
        body_pose=state.body_pose[i],
        present=env.scene.presence[i],
        goals={name: poses[i].copy() for name, poses in env.scene.poses.items()},
        matter=matter_of(env, i) if wanted.matter else {},
        contacts=contacts,
        image=image,
    )


def matter_of(env: TaskEnv, i: int) -> dict[str, Matter]:
    """The points of the families of env `i` whose matter no engine has."""
    found: dict[str, Matter] = {}
    for name in env.spec.world.families or {} if env.families is not None else ():
        assert env.families is not None
        family = env.families.family(name)
        if not family.drawn:
            continue
        state = env.families.state(name, np.array([i]))
        there = state.fields.get("there")
        points = state.points[0] if there is None else state.points[0][there[0]]
        radius = float(state.radius.mean()) if len(state.radius) else 0.0
        found[name] = Matter(np.asarray(points, dtype=np.float32), radius, state.faces, np.array(family.color))
    return found


def looks_of(engine: SimEngine, i: int) -> Looks:
    """How the geoms of env `i` look now."""
    built = built_looks(engine.world)
    now = {
        name: engine.get_parameters(f"geom.{name}", [i])[0]
        for name in Looks._fields
        if f"geom.{name}" in engine.parameters and len(engine.world.geoms)
    }
    texture, material = (np.asarray(now.get(n, getattr(built, n))).astype(int) for n in ("texture", "material"))
    return Looks(np.asarray(now.get("color", built.color), dtype=float), texture, material)

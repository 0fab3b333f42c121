"""Ill-conditioned physics of a World: time steps, sizes, masses and gains with which engines give poor results.

Nothing here is refused; `anysim check` says it, and a build warns of it. The numbers were measured on MuJoCo, PyBullet
and SAPIEN: boxes that rest on the ground, and two boxes of different mass on each other.
"""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.geometry.bounds import shape_bounds
from anysim.kinematics.dynamics import coupling, driven_trees, joints_of, mass_matrix
from anysim.math import pose as P
from anysim.model.shapes import is_ground
from anysim.model.world import Actuation, BodyKind, ControlMode, World

SINKING = 10.0
"""Half the size of a thing over what it falls from rest in a step: below, it sinks into the ground or jumps on it."""
MASS_RATIO = 300.0
"""A box sinks a third into a lighter one below it at this ratio (MuJoCo, PyBullet), and falls through at 1,000."""
FOOT_DIAMETERS = 2.0
"""Cells of a height field over the diameter of a ball foot: on finer ones MuJoCo has a trot fall that others walk."""
LOOKED_AT = 1000
"""Of so many bodies, the heaviest, it is asked what is below them."""


class PhysicsWarning(UserWarning):
    """Physics that an engine can step, and that it is likely to get wrong."""


class UnstableGainsWarning(PhysicsWarning):
    """Explicit drives that are too stiff for the time step."""


class Doubt(NamedTuple):
    """What is ill-conditioned: the dotted key to change, a sentence, and how it is warned of."""

    path: str
    sentence: str
    category: type[PhysicsWarning] = PhysicsWarning

    def __str__(self) -> str:
        return self.sentence


def doubts(world: World) -> Iterator[Doubt]:
    """What of a world is ill-conditioned, one of a kind."""
    boxes = _boxes(world)
    yield from _steps(world, boxes)
    yield from _masses(world, boxes)
    yield from _cells(world)
    if world.physics.actuation is Actuation.EXPLICIT_PD and (ratio := damping_ratio(world)) > 1:
        sentence = (
            f"explicit drives of '{world.name}' are too stiff for dt = {world.physics.dt:g} s: the largest eigenvalue "
            f"of dt Kd / M at the initial pose is {ratio:.3g} (up to 1 is well damped, above 2 diverges); lower kd or "
            f"dt, or use physics.actuation: implicit_pd"
        )
        yield Doubt("physics.actuation", sentence, UnstableGainsWarning)


class _Box(NamedTuple):
    """Lowest and highest corner (3,) of what collides of a body, in its frame."""

    low: Array
    high: Array


def _boxes(world: World) -> dict[int, _Box]:
    """Of each free body that collides."""
    meshes = {mesh.name: mesh for mesh in world.meshes}
    free = {b for b, body in enumerate(world.bodies) if body.kind is BodyKind.FREE}
    found: dict[int, _Box] = {}
    known: dict[tuple[object, ...], _Box] = {}
    for geom in world.geoms:
        if geom.body not in free or not geom.collides or is_ground(geom.shape):
            continue
        key = (geom.shape, geom.position, geom.quaternion)  # of many equal bodies it is asked once
        if key not in known:
            known[key] = _Box(*shape_bounds(geom.shape, P.pose(geom.position, geom.quaternion), meshes))
        box = known[key]
        if geom.body in found:
            other = found[geom.body]
            box = _Box(np.minimum(box.low, other.low), np.maximum(box.high, other.high))
        found[geom.body] = box
    return found


def _steps(world: World, boxes: Mapping[int, _Box]) -> Iterator[Doubt]:
    gravity, dt = float(np.linalg.norm(world.physics.gravity)), world.physics.dt
    thickness = {id(box): float((box.high - box.low).min()) for box in boxes.values()}
    thin = {b: thickness[id(box)] for b, box in boxes.items() if thickness[id(box)] < 2 * SINKING * gravity * dt**2}
    if thin:
        body = min(thin, key=lambda b: thin[b])
        longest = (thin[body] / (2 * SINKING * gravity)) ** 0.5
        more = f" and {len(thin) - 1} more" if len(thin) > 1 else ""
        yield Doubt(
            "physics.dt",
            f"'{world.bodies[body].name}'{more}: {1000 * thin[body]:.3g} mm thick, and falls "
            f"{1000 * gravity * dt**2:.2g} mm in a step of {dt:g} s: it may sink into what it rests on, or jump on it; "
            f"use a physics.dt of at most {longest:.1g} s, or make it larger",
        )


def _masses(world: World, boxes: Mapping[int, _Box]) -> Iterator[Doubt]:
    carrying = {body.parent for body in world.bodies if body.kind is BodyKind.LINK}
    loose = [b for b in boxes if b not in carrying]
    if not loose:
        return
    mass = np.array([world.bodies[b].inertial.mass for b in loose])
    place = np.array([world.bodies[b].position for b in loose])
    worst = (MASS_RATIO, -1, -1)
    for heavy in np.argsort(-mass)[:LOOKED_AT].tolist():
        if mass[heavy] <= worst[0] * mass.min():
            break
        low, high = boxes[loose[heavy]]
        aside = np.abs(place[:, :2] - place[heavy, :2]).max(axis=1) > np.abs([low[:2], high[:2]]).max()
        beneath = (place[:, 2] <= place[heavy, 2] + low[2]) & ~aside
        light = int(np.argmin(np.where(beneath, mass, np.inf)))
        if beneath[light] and mass[heavy] / mass[light] > worst[0]:
            worst = (float(mass[heavy] / mass[light]), heavy, light)
    ratio, heavy, light = worst
    if heavy >= 0:
        yield Doubt(
            "world.layout",
            f"'{world.bodies[loose[heavy]].name}' begins above '{world.bodies[loose[light]].name}' and weighs "
            f"{ratio:,.0f} times as much: what lies on a body that is over {MASS_RATIO:g} times lighter sinks into it "
            f"or falls through; keep them apart, or choose masses that are closer",
        )


def _cells(world: World) -> Iterator[Doubt]:
    balls = [(leg.radius, r.name) for r in world.robots if r.entry is not None for leg in r.entry.legs.values()]
    radius, robot = max(balls, default=(0.0, ""))
    for field in world.heightfields:
        cell = min(size / (count - 1) for size, count in zip(field.size, field.heights.shape[::-1], strict=True))
        if cell < (least := FOOT_DIAMETERS * 2 * radius) - 1e-9:
            yield Doubt(
                "world.terrain",
                f"the ground has a height every {100 * cell:.3g} cm, and '{robot}' has ball feet of {200 * radius:.3g} "
                f"cm: contacts with the sides of small cells may trip it; let cells be {100 * least:.3g} cm or larger",
            )


def damping_ratio(world: World) -> float:
    """The largest eigenvalue of dt Kd inv(M) at the initial pose: what a step takes off the fastest motion.

    An explicit step multiplies that motion by 1 - this number, so that it alternates above 1 and grows above 2.
    """
    damping = np.zeros(len(world.joints))
    for actuator in world.actuators:
        if actuator.mode is not ControlMode.EFFORT:
            damping[actuator.joint] += actuator.kd
    poses = world.initial_body_pose
    return max((_ratio(world, poses, tree, damping) for tree in driven_trees(world)), default=0.0)


def _ratio(world: World, poses: Array, tree: list[int], damping: Array) -> float:
    mass, together = mass_matrix(world, poses, tree), coupling(world, tree)
    own = damping[joints_of(world, tree)]
    diagonal = np.diag(np.concatenate([own, np.zeros(len(mass) - len(own))]))
    matrix, drag = together.T @ mass @ together, together.T @ diagonal @ together
    if not len(matrix) or not drag.any():
        return 0.0
    if np.linalg.matrix_rank(matrix) < len(matrix):
        return float("inf")
    return float(world.physics.dt * np.abs(np.linalg.eigvals(np.linalg.solve(matrix, drag))).max())

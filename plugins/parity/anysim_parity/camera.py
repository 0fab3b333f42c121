"""The camera layer: the same world in the same state through the same cameras, drawn by every engine.

Every image is held against what the neutral geometry looks like through a pinhole (`anysim_parity.sight`), and against
the other engines'. Depth is compared where both see the same entity: at its outline a pixel shows one thing or the
other, which the segmentation accounts for.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.cameras import CameraRig, CameraView
from anysim.engine.capability import Capability
from anysim.errors import AnysimError, EngineError, listing
from anysim.math import pose as P
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.index import Index
from anysim.model.world import BodyKind, World
from anysim_parity.pictures import depth_picture, segmentation_picture
from anysim_parity.result import Gap, Layer, Measure, Picture
from anysim_parity.sight import Sight, sight
from anysim_parity.variants import nominal_population

QUESTION = "Do the same cameras see the same things at the same distances?"

DEPTH = 5e-3
"""[m], of the median difference: below what depth cameras of this range resolve."""

OVERLAP = 0.05
"""Of the pixels of an object that either sees, the share that one alone sees: an intersection over union of 0.95."""

MIDDLE = 0.25
"""[pixels] between where the middle of an object is and where it should be. A camera that looks through the corners of
its pixels instead of their centres is off by 0.5 in each direction."""

OUTLINE = 100
"""[pixels]: an object of fewer is mostly outline, where the choice of one engine's rounding decides; its overlap is
reported and not judged."""

NEEDS = (Capability.RENDER_RGB, Capability.RENDER_DEPTH, Capability.RENDER_SEGMENTATION)
SIZE = (320, 240)


class Pose(NamedTuple):
    """A state in which pictures are taken: joints (J,), free and static bodies (B, 7), and all bodies (B, 7)."""

    name: str
    joints: Array
    bodies: Array


class Shot(NamedTuple):
    """One engine's images through one camera in one pose: (H, W, 3), (H, W), (H, W)."""

    rgb: Array
    depth: Array
    segmentation: Array


def camera_layer(
    world: World,
    engines: Mapping[str, Callable[[], SimEngine]],
    *,
    size: tuple[int, int] | None = SIZE,
    cameras: Sequence[str] | None = None,
    moved: bool = True,
) -> Layer:
    """Draw a world on every engine.

    Args:
        world: its cameras are used; without any, the overview named `default`.
        engines: by name what makes an engine without a world; each is made once and destroyed.
        size: width and height [pixels]; None takes each camera's own.
        cameras: the names of some of the cameras; all by default.
        moved: also draw a second state, with joints turned and free bodies lifted and turned.

    An engine that cannot draw takes no part; `refused` says why.

    Raises:
        NameLookupError: there is no such camera.
    """
    world = nominal_population(world)
    index = Index(world)
    names = list(cameras) if cameras is not None else [c.name for c in world.cameras] or ["default"]
    poses = [rest(world), *([bent(world)] if moved else [])]
    views = {(pose.name, name): _view(world, index, pose, name, size) for pose in poses for name in names}
    shots: dict[str, dict[tuple[str, str], Shot]] = {}
    refused: dict[str, str] = {}
    for engine, make in engines.items():
        try:
            shots[engine] = _draw(world, make, poses, views)
        except Exception as error:  # noqa: BLE001  a stranger's engine may raise anything; the others go on
            refused[engine] = str(error) if isinstance(error, AnysimError) else f"{type(error).__name__}: {error}"
    measures: list[Measure] = []
    gaps: list[Gap] = []
    pictures: list[Picture] = []
    for pose in poses:
        for name in names:
            view, taken = views[pose.name, name], {e: shots[e][pose.name, name] for e in shots}
            seen = sight(world, pose.bodies, view)
            place = f"camera {name}, {pose.name}"
            measures += _measures(place, world, seen, taken)
            gaps += [gap for pair in combinations(taken, 2) for gap in _gaps(place, world, pair, taken)]
            pictures += _pictures(place, seen, taken)
    return Layer("camera", QUESTION, tuple(measures), pictures=tuple(pictures), refused=refused, gaps=tuple(gaps))


# ---------------------------------------------------------------------- states


def rest(world: World) -> Pose:
    """The state after a reset."""
    return _pose(world, "at rest", np.array([j.initial for j in world.joints]), _roots(world))


def bent(world: World) -> Pose:
    """Another state: every joint a sixth of its range, or 0.3, towards the middle of it; free bodies off their place.

    Free bodies are 6 cm higher and turned by 0.5 about z: nothing was hidden by what they lay on.
    """
    joints = np.array([j.initial for j in world.joints])
    for i, joint in enumerate(world.joints):
        span = joint.upper - joint.lower
        step = min(0.3, span / 6) if np.isfinite(span) else 0.3
        middle = (joint.lower + joint.upper) / 2 if np.isfinite(span) else np.inf
        joints[i] += step if joint.initial < middle else -step
    for i, joint in enumerate(world.joints):
        if joint.mimic is not None:
            joints[i] = joint.mimic.multiplier * joints[joint.mimic.joint] + joint.mimic.offset
    roots = _roots(world)
    turn = P.from_axis_angle(np.array([0.0, 0.0, 1.0]), np.array(0.5))
    for i, body in enumerate(world.bodies):
        if body.kind is BodyKind.FREE:
            roots[i, 2] += 0.06
            roots[i, 3:] = P.multiply(turn, roots[i, 3:])
    return _pose(world, "moved", joints, roots)


def _roots(world: World) -> Array:
    return np.array([[*b.position, *b.quaternion] for b in world.bodies], dtype=float).reshape(-1, 7)


def _pose(world: World, name: str, joints: Array, roots: Array) -> Pose:
    return Pose(name, joints, forward_kinematics(world, roots[None], joints[None])[0])


def _view(world: World, index: Index, pose: Pose, name: str, size: tuple[int, int] | None) -> CameraView:
    """The camera as the contract places it, bodies where the neutral model has them."""
    width, height = size or (None, None)
    return CameraRig(world, 1).view(name, index, pose.bodies[None], np.array([0]), width, height)


def _draw(
    world: World, make: Callable[[], SimEngine], poses: Sequence[Pose], views: Mapping[tuple[str, str], CameraView]
) -> dict[tuple[str, str], Shot]:
    """All images of one engine."""
    shots: dict[tuple[str, str], Shot] = {}
    with make() as engine:
        absent = [str(c) for c in NEEDS if c not in engine.capabilities]
        if absent:
            raise EngineError(f"{engine.name} does not declare {listing(absent)}")
        engine.create_world(world)
        free = [i for i, b in enumerate(world.bodies) if b.kind is BodyKind.FREE]
        for pose in poses:
            if len(pose.joints):
                engine.set_joint_state(pose.joints, np.zeros_like(pose.joints))
            if free:
                engine.set_body_state(pose.bodies[None, free], np.zeros((1, len(free), 6)), bodies=free)
            for (where, name), view in views.items():
                if where == pose.name:
                    images = engine.render(name, view.width, view.height, channels=("rgb", "depth", "segmentation"))
                    shots[where, name] = Shot(images["rgb"][0], images["depth"][0], images["segmentation"][0])
    return shots


# ---------------------------------------------------------------------- what is compared


def depth_differences(a: Shot | Sight, b: Shot | Sight) -> Array:
    """[m] of all pixels where both see the same entity, at a finite distance."""
    both = (a.segmentation == b.segmentation) & np.isfinite(a.depth) & np.isfinite(b.depth)
    return np.abs(a.depth[both].astype(float) - b.depth[both])


def alone(a: Array, b: Array) -> float:
    """One less the intersection over union of two masks; nan where both are empty."""
    union = int((a | b).sum())
    return 1 - int((a & b).sum()) / union if union else float("nan")


def middle(mask: Array) -> Array:
    """Column and row (2,) of the middle of a mask; 0.5 is the middle of the first pixel."""
    return np.argwhere(mask).mean(axis=0)[::-1] + 0.5


def _objects(world: World, *segmentations: Array) -> Iterator[tuple[str, int, bool]]:
    """Entities that any image shows: name, id, and whether they are more than outline in each."""
    for k, entity in enumerate(world.entities, start=1):
        sizes = [int((s == k).sum()) for s in segmentations]
        if any(sizes):
            yield entity.name, k, min(sizes) >= OUTLINE or max(sizes) >= 2 * OUTLINE


def _measures(place: str, world: World, seen: Sight, taken: Mapping[str, Shot]) -> Iterator[Measure]:
    """Every engine against the neutral geometry."""
    off = {engine: depth_differences(shot, seen) for engine, shot in taken.items()}
    off = {engine: values for engine, values in off.items() if len(values)}
    for what, share, tolerance in (("median", 50, DEPTH), ("95th percentile", 95, None)):
        values = {engine: float(np.percentile(v, share)) for engine, v in off.items()}
        yield Measure(f"{place}: depth off the geometry, {what}", "m", values, 0.0, tolerance)
    for name, k, judged in _objects(world, seen.segmentation):
        mask = seen.segmentation == k
        values = {engine: alone(shot.segmentation == k, mask) for engine, shot in taken.items()}
        tolerance = OVERLAP if judged else None
        yield Measure(f"{place}: outline of {name} off the geometry", "", values, 0.0, tolerance, EDGE)
        shown = {e: shot.segmentation == k for e, shot in taken.items() if (shot.segmentation == k).any()}
        values = {e: float(np.abs(middle(own) - middle(mask)).max()) for e, own in shown.items()}
        yield Measure(f"{place}: middle of {name} off the geometry", "px", values, 0.0, MIDDLE if judged else None)


EDGE = "One less the intersection over union."


def _gaps(place: str, world: World, pair: tuple[str, str], taken: Mapping[str, Shot]) -> Iterator[Gap]:
    """Two engines against each other."""
    a, b = (taken[engine] for engine in pair)
    off = depth_differences(a, b)
    if len(off):
        yield Gap(f"{place}: depth, median", "m", *pair, float(np.median(off)), DEPTH)
        yield Gap(f"{place}: depth, 95th percentile", "m", *pair, float(np.percentile(off, 95)))
    for name, k, judged in _objects(world, a.segmentation, b.segmentation):
        value = alone(a.segmentation == k, b.segmentation == k)
        yield Gap(f"{place}: outline of {name}", "", *pair, value, OVERLAP if judged else None, EDGE)
    colors = float(np.abs(a.rgb.astype(float) - b.rgb).mean())
    yield Gap(f"{place}: colour, mean", "of 255", *pair, colors, None, "Light and shading are each engine's own.")


def _pictures(place: str, seen: Sight, taken: Mapping[str, Shot]) -> Iterator[Picture]:
    finite = seen.depth[np.isfinite(seen.depth)]
    near, far = (float(finite.min()), float(np.percentile(finite, 98))) if len(finite) else (0.0, 1.0)
    for engine, shot in taken.items():
        yield Picture(f"{place}: colour", engine, shot.rgb)
        yield Picture(f"{place}: depth", engine, depth_picture(shot.depth, near, far))
        yield Picture(f"{place}: segmentation", engine, segmentation_picture(shot.segmentation))

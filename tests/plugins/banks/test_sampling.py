"""Sampled grasps: where fingers close on each shape, from where, and which of them are free."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from anysim.api import compile_world
from anysim.conventions import Array
from anysim.math import pose as P
from anysim.model.affordances import Affordance, AffordanceKind
from anysim.model.world import Box, Capsule, Cylinder, MeshShape, Shape, Sphere
from anysim_banks.collision import CollisionFilter
from anysim_banks.diversity import bins, distance, diverse
from anysim_banks.gripper import gripper
from anysim_banks.pieces import Piece
from anysim_banks.sampling import AIM, Candidates, sample
from anysim_banks.subject import subjects

ORIGIN = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
TILTED = np.concatenate([[0.1, -0.2, 0.3], P.from_roll_pitch_yaw(np.array([0.4, -0.3, 1.1]))])
ANY = Affordance("body", AffordanceKind.BODY)


def sampled(
    shape: Shape, count: int = 300, at: Array = ORIGIN, spec: Affordance = ANY, width: float = 0.08
) -> Candidates:
    return sample([Piece(shape, at)], spec, ORIGIN, count, width, np.random.default_rng(3))


def fingers(grasps: Candidates, at: Array) -> tuple[Array, Array, Array, Array]:
    """Where both pads touch, the closing direction and the approach, in the shape's frame."""
    local = P.compose(np.broadcast_to(P.inverse(at), grasps.pose.shape), grasps.pose)
    closing = P.rotate(local[:, 3:], np.array([0.0, 1.0, 0.0]))
    half = 0.5 * grasps.width[:, None] * closing
    return local[:, :3] - half, local[:, :3] + half, closing, P.rotate(local[:, 3:], np.array([0.0, 0.0, 1.0]))


def depth(shape: Shape, points: Array) -> Array:
    """How far points are outside of a shape's surface [m], negative inside."""
    match shape:
        case Box(half):
            return (np.abs(points) - np.array(half)).max(axis=1)
        case Sphere(radius):
            return np.linalg.norm(points, axis=1) - radius
        case Cylinder(radius, half):
            return np.maximum(np.hypot(points[:, 0], points[:, 1]) - radius, np.abs(points[:, 2]) - half)
        case Capsule(radius, half):
            off = points[:, 2] - np.clip(points[:, 2], -half, half)
            return np.sqrt(points[:, 0] ** 2 + points[:, 1] ** 2 + off**2) - radius
        case _:
            raise AssertionError(shape)


@pytest.mark.parametrize("at", [ORIGIN, TILTED], ids=["straight", "tilted"])
@pytest.mark.parametrize(
    "shape", [Box((0.02, 0.03, 0.2)), Sphere(0.03), Cylinder(0.03, 0.05), Cylinder(0.1, 0.02), Capsule(0.008, 0.06)]
)
def test_both_pads_touch_the_surface_and_the_hand_comes_at_right_angles(shape: Shape, at: Array) -> None:
    grasps = sampled(shape, at=at)
    assert len(grasps.width) == 300
    one, other, closing, approach = fingers(grasps, at)
    np.testing.assert_allclose(depth(shape, one), 0.0, atol=1e-9)
    np.testing.assert_allclose(depth(shape, other), 0.0, atol=1e-9)
    np.testing.assert_allclose(np.einsum("nk,nk->n", closing, approach), 0.0, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(grasps.pose[:, 3:], axis=1), 1.0, atol=1e-12)
    assert (grasps.width <= 0.08).all()


def test_the_long_side_of_a_box_and_a_thick_ball_are_not_grasped() -> None:
    closing = fingers(sampled(Box((0.02, 0.03, 0.2))), ORIGIN)[2]
    assert np.abs(closing[:, 2]).max() < 1e-9
    assert {tuple(c) for c in np.abs(closing).round().astype(int).tolist()} == {(1, 0, 0), (0, 1, 0)}
    assert len(sampled(Sphere(0.05)).width) == 0


def test_a_bar_is_not_grasped_along_its_axis() -> None:
    approach = fingers(sampled(Capsule(0.008, 0.06)), ORIGIN)[3]
    np.testing.assert_allclose(approach[:, 2], 0.0, atol=1e-9)


def test_declared_directions_and_rolls_are_kept() -> None:
    spec = Affordance("h", AffordanceKind.HANDLE, approach=((-1.0, 0.0, 0.0),), roll=(-0.5, 0.5))
    grasps = sampled(Capsule(0.008, 0.06), spec=spec)
    assert len(grasps.width) == 300
    approach = fingers(grasps, ORIGIN)[3]
    angle = np.arccos(np.clip(-approach[:, 0], -1, 1))
    assert angle.max() <= 0.5 + AIM
    assert angle.max() > 0.5, "the range is used"


def test_a_hull_is_grasped_as_the_box_that_it_is(tmp_path: Path) -> None:
    path = tmp_path / "block.stl"
    trimesh.creation.box((0.04, 0.06, 0.3)).export(path)
    world = compile_world({"world": {"objects": {"block": {"source": {"mesh": str(path)}, "mass": 0.2}}}})
    [one] = subjects(world, "block")
    [piece] = one.pieces
    assert isinstance(piece.shape, MeshShape)
    grasps = sample(one.pieces, one.affordance, one.frame, 300, 0.08, np.random.default_rng(0))
    assert len(grasps.width) > 100
    first, second, _, _ = fingers(grasps, piece.pose)
    box = Box((0.02, 0.03, 0.15))
    for points in (first, second):
        np.testing.assert_allclose(depth(box, points), 0.0, atol=1e-6)


def test_the_filter_agrees_with_points_inside_of_the_grippers_boxes() -> None:
    hand, box = gripper(), Box((0.02, 0.03, 0.05))
    grasps = sampled(box, 400)
    free = CollisionFilter(hand, [Piece(box, ORIGIN)]).free(grasps.pose, grasps.width)
    assert 0.2 < free.mean() < 0.9
    axis = [np.linspace(-h, h, 25) for h in box.half_size]
    points = np.stack(np.meshgrid(*axis, indexing="ij"), axis=-1).reshape(-1, 3)
    places, halves = hand.boxes
    for number in range(400):
        seen = P.compose(grasps.pose[number], places)
        hit = False
        for place, half in zip(seen, halves, strict=True):
            local = P.rotate_inverse(place[3:], points - place[:3])
            hit |= bool((np.abs(local) < half - 0.002).all(axis=1).any())
        assert not (hit and free[number]), f"grasp {number} is in collision, and passed"


def test_fingers_do_not_close_through_what_stands_beside() -> None:
    """A plate of 2 mm between the open finger and the box is in the way, though neither end of the way touches it."""
    hand, box = gripper(), Piece(Box((0.02, 0.01, 0.03)), ORIGIN)
    beside = Piece(Box((0.02, 0.001, 0.03)), np.array([0.0, 0.03, 0.0, 0.0, 0.0, 0.0, 1.0]))
    down = np.array([[0.0, 0.0, 0.02, 1.0, 0.0, 0.0, 0.0]])
    assert CollisionFilter(hand, [box]).free(down, np.array([0.02])).tolist() == [True]
    assert CollisionFilter(hand, [box, beside]).free(down, np.array([0.02])).tolist() == [False]
    assert CollisionFilter(hand, [box, beside]).free(down, np.array([0.07])).tolist() == [True]


def test_a_diverse_choice_takes_from_every_bin_and_is_spread() -> None:
    grasps = sampled(Box((0.02, 0.03, 0.03)), 500)
    chosen = diverse(grasps, np.ones(500), 24)
    assert len(set(chosen.tolist())) == 24
    assert set(bins(grasps)[chosen]) == set(bins(grasps))


def test_within_a_bin_the_choice_is_spread() -> None:
    grasps = sampled(Box((0.02, 0.03, 0.03)), 600)
    grasps = grasps.take(np.flatnonzero(bins(grasps) == bins(grasps)[0]))
    n, rng = len(grasps.width), np.random.default_rng(0)

    def nearest(which: Array) -> float:
        apart = np.stack([distance(grasps.pose[which], grasps.pose[one]) for one in which])
        return float((apart + np.eye(len(which))).min())

    chosen = nearest(diverse(grasps, rng.random(n), 10))
    assert chosen > max(nearest(rng.choice(n, 10, replace=False)) for _ in range(50))

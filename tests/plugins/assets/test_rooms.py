"""Procedural rooms: plans, furniture that fits, doors that stay clear, and free space that is free."""

from time import perf_counter
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from anysim.compile.world import compile_world
from anysim.errors import AnysimError, Issues, SpecError
from anysim.model.world import BodyKind, World
from anysim_assets.rooms import outlines as G
from anysim_assets.rooms.furnish import FRONT, HOSTS, NoPlace, furnish
from anysim_assets.rooms.furnished import Furnished, room_of
from anysim_assets.rooms.furniture import MAKERS, piece
from anysim_assets.rooms.occupancy import Occupancy, footprints, occupancy
from anysim_assets.rooms.plan import plan_of
from anysim_schemas.rooms import FURNITURE, STYLES, RoomSpec
from anysim_schemas.run import WorldSpec

L_SHAPE = [[0, 0], [6, 0], [6, 3], [3.5, 3], [3.5, 5.5], [0, 5.5]]


def world_of(room: Any, **more: Any) -> World:
    return compile_world(WorldSpec.model_validate({"room": room, **more}))


def room(**fields: Any) -> Furnished:
    issues = Issues()
    made = room_of(RoomSpec.model_validate(fields), issues)
    issues.raise_if_any()
    assert made is not None
    return made


def random_spec(seed: int) -> dict[str, Any]:
    """A room of a style, size, and openings that the seed says."""
    rng = np.random.default_rng(seed)
    style = ["living_room", "bedroom", "kitchen", "office"][seed % 4]
    size = [round(float(v), 2) for v in rng.uniform((4.0, 3.8), (6.5, 5.5))]
    sides = rng.permutation(["south", "east", "north", "west"]).tolist()
    doors = [{"wall": side, "at": round(float(rng.uniform(0.25, 0.75)), 2)} for side in sides[: 1 + seed % 2]]
    windows = [{"wall": side, "width": round(float(rng.uniform(0.8, 1.6)), 2)} for side in sides[2 : 2 + seed % 3]]
    return {"style": style, "size": size, "doors": doors, "windows": windows, "seed": seed}


def check(made: Furnished, spec: RoomSpec) -> None:
    """What holds of every furnished room."""
    plan, placed = made.plan, made.pieces
    assert sorted(one.kind for one in placed) == sorted(k for k, n in spec.pieces.items() for _ in range(n))
    for i, one in enumerate(placed):
        assert G.encloses(plan.outline, one.footprint), f"{one.name} is in a wall"
        for other in placed[:i]:
            assert not G.overlap(one.footprint, other.footprint), f"{one.name} is in {other.name}"
            if one.kind not in HOSTS and other.kind in FRONT:
                assert not G.overlap(one.footprint, other.zone(FRONT[other.kind])), f"{one.name} bars {other.name}"
        for opening in plan.openings:
            if opening.is_door:
                assert not G.overlap(one.footprint, plan.approach(opening)), f"{one.name} bars a door"
    solid = [one.footprint for one in placed]
    grid = Occupancy.of_footprints(solid, plan.outline, 0.05)
    points = grid.free_points(50, 0.25, np.random.default_rng(0))
    assert G.inside(points, plan.outline).all()
    for polygon in solid:
        assert G.distance(points, polygon).min() >= 0.25
    for wall in plan.walls:
        assert G.distance(points, np.stack([wall.start, wall.at(wall.length)])).min() >= 0.25


@pytest.mark.parametrize("count", [16, pytest.param(200, marks=pytest.mark.slow)])
def test_random_rooms_keep_the_rules(count: int, capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing overlaps, doors are clear, free points are free; also says what a room costs."""
    times: list[float] = []
    for seed in range(count):
        fields = random_spec(seed)
        start = perf_counter()
        made = room(**fields)
        times.append(perf_counter() - start)
        check(made, RoomSpec.model_validate(fields))
    with capsys.disabled():
        print(f"\n{count} rooms: {1e3 * np.mean(times):.0f} ms each, the longest {1e3 * max(times):.0f} ms")


def test_equal_specs_are_equal_rooms_and_seeds_differ() -> None:
    spec = random_spec(5)
    assert world_of(spec).hash == world_of(spec).hash
    assert world_of(spec).hash != world_of({**spec, "seed": 6}).hash
    swapped = {**spec, "furniture": {"lamp": 1, "plant": 2}}
    other = {**spec, "furniture": {"plant": 2, "lamp": 1}}
    assert world_of(swapped).hash == world_of(other).hash, "the order of the file does not matter"


@pytest.mark.parametrize("kind", sorted(MAKERS))
def test_pieces_stay_within_their_footprint_and_on_the_floor(kind: str) -> None:
    from anysim.geometry.bounds import shape_bounds
    from anysim.math import pose as P

    sizes: set[tuple[float, ...]] = set()
    for seed in range(12):
        made = piece(kind, np.random.default_rng(seed))
        sizes.add((*made.half, made.height))
        for part in made.parts:
            low, high = shape_bounds(part.shape, P.pose(part.position, (0.0, 0.0, 0.0, 1.0)), {})
            assert low[2] >= -1e-9
            if part.collides:
                assert (np.abs(np.stack([low, high])[:, :2]) <= np.array(made.half) + 1e-9).all(), part
                assert high[2] <= made.height + 0.11
    assert len(sizes) > 2, "pieces come in sizes"


def test_furniture_is_entities_that_can_carry_things() -> None:
    made = world_of(
        {"furniture": {"table": 1, "chair": 2}, "seed": 2},
        objects={"mug": {"source": {"cylinder": [0.04, 0.1]}}},
        layout={"mug": {"on": "table", "x": 0.0, "y": 0.0}},
    )
    assert [e.name for e in made.entities] == ["room", "table", "chair_0", "chair_1", "mug"]
    table = next(e for e in made.entities if e.name == "table")
    assert (table.label, made.bodies[table.root].kind) == ("table", BodyKind.STATIC)
    assert 0.7 < made.bodies[-1].position[2] - 0.05 < 0.8
    assert not next(g for g in made.geoms if g.name == "terrain").visible
    assert made.ground.heights_at(np.zeros(2)) == 0


def test_walls_have_openings_where_the_spec_has_them() -> None:
    fields = {"size": [4, 3], "doors": [{"wall": "east", "at": 0.4}], "windows": [{"wall": "north"}]}
    made = world_of(fields)
    low_band = occupancy(made, np.array([[-3, -2], [3, -2], [3, 2], [-3, 2]]), heights=(0.1, 0.5), resolution=0.02)
    inside = lambda x, y: not low_band.occupied[tuple(((np.array([y, x]) - low_band.low[::-1]) / 0.02).astype(int))]  # noqa: E731
    assert inside(2.06, -0.3), "the doorway"
    assert not inside(2.06, 0.6), "the wall beside it"
    assert not inside(0.0, 1.56), "below the window"
    names = {g.name for g in made.geoms}
    assert {"room.lintel1_0", "room.sill2_0", "room.pane2_0", "room.floor"} <= names


def test_a_polygonal_plan_is_closed_but_for_its_door() -> None:
    """From inside an L-shaped room a small disc gets out through the door and nowhere else."""
    fields = {"plan": L_SHAPE, "doors": [{"wall": 3, "at": 0.5}], "furniture": {"sofa": 1, "table": 1, "chair": 2}}
    made = world_of({**fields, "seed": 1})
    check(room(**fields, seed=1), RoomSpec.model_validate(fields))
    area = np.array([[-1.0, -1.0], [7.0, -1.0], [7.0, 6.5], [-1.0, 6.5]])
    grid = occupancy(made, area, heights=(0.1, 1.5), resolution=0.05)
    outside, within = np.array([5.0, 5.0]), np.array([1.0, 4.9])
    assert grid.connected(np.stack([outside, within]), 0.2)
    shut = world_of({**fields, "doors": [], "seed": 1})
    assert not occupancy(shut, area, heights=(0.1, 1.5)).connected(np.stack([outside, within]), 0.05)


def test_free_points_are_even_and_repeatable() -> None:
    grid = Occupancy.of_footprints([], np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]]), 0.05)
    points = grid.free_points(4000, 0.1, np.random.default_rng(1))
    assert (points == grid.free_points(4000, 0.1, np.random.default_rng(1))).all()
    counts = np.histogram(points[:, 0], bins=4, range=(0.2, 1.8))[0]
    assert counts.min() > 0.85 * counts.max()
    with pytest.raises(AnysimError, match="nowhere in the room is a free place"):
        grid.free_points(1, 0.6, np.random.default_rng(0))


def test_free_points_can_keep_to_what_is_reached() -> None:
    area = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [0.0, 2.0]])
    wall = G.oriented_rectangle(np.array([2.5, 1.0]), (0.05, 1.2), 0.0)
    grid = Occupancy.of_footprints([wall], area, 0.05)
    start = np.array([0.5, 0.5])
    points = grid.free_points(200, 0.1, np.random.default_rng(0), connected_to=start)
    assert points[:, 0].max() < 2.4
    assert grid.free_points(200, 0.1, np.random.default_rng(0))[:, 0].max() > 2.7
    assert not grid.connected(np.array([[0.5, 0.5], [3.5, 0.5]]), 0.1)


def test_outlines_hold_the_shapes_of_geoms() -> None:
    from anysim.math import pose as P
    from anysim.model.world import Box, Capsule, Cylinder, Sphere
    from anysim.testing.sketch import Sketch

    rng = np.random.default_rng(4)
    for shape in (Box((0.2, 0.1, 0.3)), Sphere(0.2), Capsule(0.1, 0.2), Cylinder(0.15, 0.25)):
        s = Sketch("one")
        turn = rng.normal(size=4)
        turn /= np.linalg.norm(turn)
        s.fixed("thing", shape, (0.3, -0.1, 1.0), quaternion=tuple(turn.tolist()))
        world = s.world()
        (polygon,) = footprints(world, world.initial_body_pose, (0.0, 2.0), set())
        points = surface_points(shape, rng)
        seen = np.array([0.3, -0.1]) + P.rotate(turn, points)[:, :2]
        assert G.distance(seen, polygon).max() < 1e-9
        covered = G.size(G.corners_of(polygon)) / G.size(G.corners_of(hull(seen)))
        assert 1.0 - 1e-9 <= covered < 1.05
        assert footprints(world, world.initial_body_pose, (2.0, 3.0), set()) == []


def surface_points(shape: Any, rng: np.random.Generator) -> np.ndarray:
    from tests.geometry.test_bounds import surface

    return surface(shape, rng, 20_000)


def hull(points: np.ndarray) -> np.ndarray:
    from scipy.spatial import ConvexHull

    return points[ConvexHull(points).vertices]


@pytest.mark.parametrize(
    ("fields", "path", "message"),
    [
        ({"size": [2, 2], "style": "bedroom"}, "room.style", r"no place for '.*' \(.* m\), in \d+ of 24 arrangements"),
        ({"furniture": {"bed": 9}, "size": [4, 4]}, "room.furniture", "9 pieces on 16.0 square metres; have fewer"),
        ({"doors": [{"width": 6}]}, "room.doors.0.at", "a width of 6 m does not fit"),
        ({"doors": [{}, {"at": 0.6}]}, "room.doors.1.at", "overlaps another opening"),
        ({"windows": [{"sill": 2.0}]}, "room.windows.0.height", "reaches 3.2 m, the walls 2.6 m"),
        ({"plan": [[0, 0], [0, 3], [3, 3], [3, 0]]}, "room.plan", "clockwise"),
        ({"plan": [[0, 0], [3, 3], [3, 0], [0, 3]]}, "room.plan", "cross each other"),
        ({"wall_color": "whit"}, "room.wall_color", "did you mean 'white'"),
    ],
)
def test_what_does_not_fit_is_said(fields: dict[str, Any], path: str, message: str) -> None:
    start = perf_counter()
    if "plan" in fields:
        fields = {**fields, "doors": []}
    with pytest.raises(SpecError, match=message) as caught:
        world_of(fields)
    assert caught.value.issues[0].path == path
    assert perf_counter() - start < 60


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"furniture": {"piano": 1}}, "bed"),
        ({"furniture": {"bed": -1}}, "expected 0 or more"),
        ({"doors": [{"wall": 4}]}, "walls 0 to 3, got 4"),
        ({"plan": L_SHAPE}, "a plan has numbered walls, 0 to 5"),
        ({"plan": L_SHAPE, "size": [3, 3]}, "either `size` or `plan`"),
    ],
)
def test_faults_of_the_spec(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        RoomSpec.model_validate(fields)


def test_names_and_grounds_that_clash_are_said() -> None:
    with pytest.raises(SpecError, match="'table' is a piece of furniture"):
        world_of({"furniture": {"table": 1}}, objects={"table": {"source": {"box": [1, 1, 1]}}})
    with pytest.raises(SpecError, match="a room stands on a plane"):
        world_of({}, terrain="rough")


def test_the_way_between_doors_is_kept_or_refused() -> None:
    """Across a narrow room a wardrobe leaves a way of one width and not of another."""
    fields = {"size": [5, 2.2], "doors": [{"wall": "east"}, {"wall": "west"}], "furniture": {"wardrobe": 2}}
    assert room(**fields, walkway=0.6)
    issues = Issues()
    plan = plan_of(RoomSpec.model_validate(fields), issues)
    assert plan is not None
    with pytest.raises(NoPlace, match=r"no (way of 2 m|place)"):
        furnish(plan, {"wardrobe": 2}, 2.0, 0)


def test_styles_have_furniture_that_exists() -> None:
    assert {kind for table in STYLES.values() for kind in table} <= set(MAKERS)


def test_kinds_of_furniture_are_placed_in_the_order_of_the_spec() -> None:
    """The draws of a piece come from the number of its kind, its name from the order of the spec's kinds."""
    assert tuple(MAKERS) == FURNITURE

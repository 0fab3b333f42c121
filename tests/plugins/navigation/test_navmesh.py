"""Navigation meshes: ways that are free and short, ends that are refused, slopes, headroom, and what is kept."""

import json
from pathlib import Path

import numpy as np
import pytest
import shapely
import typer
import yaml
from PIL import Image
from typer.testing import CliRunner

from anysim.api import compile_world, load
from anysim.errors import AnysimError, NameLookupError
from anysim.math import pose as P
from anysim.model.world import Box, World
from anysim.testing.sketch import Sketch
from anysim_navigation import commands
from anysim_navigation.agent import Agent, NoRoute
from anysim_navigation.maps import NavMaps
from anysim_navigation.navmesh import length_of
from anysim_navigation.visibility import VisibilityGraph
from anysim_navigation_bench.rooms import measure_room, random_room

ROOM = Path(__file__).parents[3] / "docs/worlds/room.yaml"
AREA = [[-3.0, -3.0], [3.0, -3.0], [3.0, 3.0], [-3.0, 3.0]]
SMALL = Agent(radius=0.25)


def blocks(*boxes: tuple[tuple[float, float, float], tuple[float, float, float]], pitch: float = 0.0) -> World:
    """Boxes (half sizes, middles) on a plane, the first of them with its front raised or lowered."""
    s = Sketch("blocks")
    s.ground()
    for number, (half, at) in enumerate(boxes):
        turn = P.from_roll_pitch_yaw(np.array([0.0, pitch if number == 0 else 0.0, 0.0]))
        s.fixed(f"block{number}", Box(half), at, quaternion=tuple(float(v) for v in turn))
    return s.world()


def wall(gap: float) -> World:
    """A wall across the area, along x = 0, with a gap in its middle."""
    half = (3.2 - gap / 2) / 2
    return blocks(((0.05, half, 0.5), (0, gap / 2 + half, 0.5)), ((0.05, half, 0.5), (0, -gap / 2 - half, 0.5)))


@pytest.mark.parametrize("seed", range(4))
def test_ways_through_a_room_are_free_short_and_not_refused(seed: int) -> None:
    found = measure_room(random_room(seed), SMALL, 60, np.random.default_rng(seed), compared=25)
    assert found.failures == 0
    assert found.ways > 20
    assert found.nearest > -1e-6
    assert min(found.excess) > 1 - 1e-9
    assert np.median(found.excess) < 1.05
    assert max(found.excess) < 1.1
    assert (found.refused > 0) == (seed == 3)  # which has no door


@pytest.mark.full
def test_two_hundred_rooms() -> None:
    rng, every = np.random.default_rng(0), []
    for seed in range(200):
        found = measure_room(random_room(seed), SMALL, 200, rng, compared=20)
        assert (found.failures, found.nearest > -1e-6) == (0, True), seed
        every += found.excess
    assert np.median(every) < 1.05


def test_triangles_without_area_turn_no_way_around() -> None:
    """Room 53 has corners in a line: a triangle of them with its sides exchanged made ways 60 % longer."""
    mesh = NavMaps(random_room(53), SMALL).at()
    start, goal = np.array([3.191362, -1.124725]), np.array([-2.650752, -0.719116])
    assert length_of(mesh.path(start, goal)) < 1.001 * VisibilityGraph(mesh.free).length(start, goal)


def test_a_way_around_a_corner_has_the_length_of_trigonometry() -> None:
    mesh = NavMaps(blocks(((0.5, 0.5, 0.5), (0, 0, 0.5))), SMALL, area=AREA).at()
    path = mesh.path((-2.0, 0.0), (2.0, 0.0))
    tangent = np.hypot(1.5, 0.5)  # to the corner at (-0.5, 0.5)
    line = np.sqrt(tangent**2 - 0.25**2)
    turn = np.arctan2(0.5, 1.5) + np.arcsin(0.25 / tangent)  # of the heading, at each of two corners
    assert length_of(path) == pytest.approx(2 * (line + 0.25 * turn) + 1.0, rel=0.01)


def test_the_reference_finds_a_way_around_two_walls() -> None:
    world = blocks(((0.05, 2.0, 0.5), (-1, -1.5, 0.5)), ((0.05, 2.0, 0.5), (1, 1.5, 0.5)))
    mesh = NavMaps(world, Agent(radius=0.1), area=AREA).at()
    start, goal = np.array([-2.5, -2.5]), np.array([2.5, 2.5])
    best = VisibilityGraph(mesh.free).length(start, goal)
    assert np.hypot(5, 5) < best <= length_of(mesh.path(start, goal)) < 1.01 * best


@pytest.mark.parametrize(("gap", "through"), [(0.5, True), (0.4999, False), (0.56, True)])
def test_a_gap_is_passed_by_what_fits(gap: float, through: bool) -> None:
    agent = Agent(radius=0.24 if through else 0.25)
    mesh = NavMaps(wall(gap), agent, area=AREA).at()
    if through:
        assert length_of(mesh.path((-1.0, 0.0), (1.0, 0.0))) == pytest.approx(2.0)
    else:
        with pytest.raises(NoRoute, match=r"no way from \(-1.00, 0.00\) to \(1.00, 0.00\) .* part of 1\d"):
            mesh.path((-1.0, 0.0), (1.0, 0.0))


def test_ends_that_are_off_the_mesh_are_refused_or_moved() -> None:
    mesh = NavMaps(blocks(((0.5, 0.5, 0.5), (0, 0, 0.5))), SMALL, area=AREA).at()
    assert not mesh.is_navigable((0.6, 0.0))
    assert mesh.is_navigable((0.8, 0.0))
    assert np.allclose(mesh.snap((0.6, 0.0)), (0.75, 0.0), atol=0.01)
    assert (mesh.snap((1.5, 1.0)) == (1.5, 1.0)).all()
    with pytest.raises(NoRoute, match=r"the goal \(0.60, 0.00\) is nowhere .* \(0.75, 0.00\), 0.15 m off"):
        mesh.path((2.0, 0.0), (0.6, 0.0))
    assert np.allclose(mesh.path((2.0, 0.0), (0.6, 0.0), snap=0.2)[-1], (0.75, 0.0), atol=0.01)
    crowded = NavMaps(blocks(((4.0, 4.0, 0.5), (0, 0, 0.5))), SMALL, area=AREA).at()
    with pytest.raises(NoRoute, match="no room"):
        crowded.path((0.0, 0.0), (1.0, 0.0))


def test_what_is_low_is_driven_over_and_what_is_high_passed_under() -> None:
    plate, shelf = ((0.5, 0.5, 0.01), (-1, 0, 0.01)), ((0.5, 0.5, 0.1), (1, 0, 1.35))
    mesh = NavMaps(blocks(plate, shelf), Agent(0.25, height=1.2, step=0.03), area=AREA).at()
    assert mesh.area == pytest.approx(36.0)
    taller = NavMaps(blocks(plate, shelf), Agent(0.25, height=1.3, step=0.01), area=AREA).at()
    assert not taller.is_navigable((-1.0, 0.0))
    assert not taller.is_navigable((1.0, 0.0))


# ---------------------------------------------------------------------------------------------------- uneven ground


def ramp(degrees: float) -> World:
    """A platform of 0.3 m along all of x > 1, and a ramp up to it."""
    angle = np.deg2rad(degrees)
    run = 0.3 / np.tan(angle)
    half, thick = np.hypot(run, 0.3) / 2, 0.1
    middle = np.array([1 - run / 2, 0.0, 0.15]) - thick * np.array([-np.sin(angle), 0, np.cos(angle)])
    board = ((half, 0.8, thick), (float(middle[0]), 0.0, float(middle[2])))
    return blocks(board, ((1.2, 3.5, 0.15), (2.2, 0, 0.15)), pitch=-angle)


@pytest.mark.parametrize(("degrees", "passable"), [(8, True), (15, True), (25, False), (40, False)])
def test_a_ramp_is_climbed_up_to_a_slope(degrees: float, passable: bool) -> None:
    agent = Agent(0.25, step=0.03, slope=np.deg2rad(20))
    mesh = NavMaps(ramp(degrees), agent, area=AREA, uneven=True).at()
    if not passable:
        with pytest.raises(NoRoute):
            mesh.path((-2.5, 0.0), (2.0, 1.5))
        return
    path = mesh.path((-2.5, 2.0), (2.0, 1.5))
    assert np.abs(path[:, 1][np.abs(path[:, 0] - 0.9) < 0.2]).max(initial=0.0) < 0.8 - 0.25  # by the ramp, not its side
    heights = mesh.heights_at(np.array([[-2.5, 0.0], [2.0, 1.5], [1 - 0.15 / np.tan(np.deg2rad(degrees)), 0.0]]))
    assert np.allclose(heights, [0.0, 0.3, 0.15], atol=0.01)


@pytest.mark.parametrize(("under", "passable"), [(0.8, False), (1.0, False), (1.25, True)])
def test_a_beam_is_passed_under_with_headroom(under: float, passable: bool) -> None:
    beam = blocks(((0.3, 4.0, 0.1), (0, 0, under + 0.1)))
    for uneven in (False, True):
        mesh = NavMaps(beam, Agent(0.25, height=1.2), area=AREA, uneven=uneven).at()
        assert mesh.is_navigable((0.0, 0.0)) == passable
        assert (len(np.unique(mesh.part)) == 1) == passable


def test_ground_from_rays_agrees_with_ground_from_outlines() -> None:
    world = random_room(1)
    exact, cells = (NavMaps(world, SMALL, uneven=uneven).at() for uneven in (False, True))
    points = np.random.default_rng(3).uniform(-2.0, 2.0, (400, 2))
    near = [exact.free.boundary.distance(shapely.Point(p)) < 0.08 for p in points]
    same = [exact.is_navigable(p) == cells.is_navigable(p) for p in points]
    assert all(s or n for s, n in zip(same, near, strict=True))


# ---------------------------------------------------------------------------------------------------- kept, and files


def test_meshes_are_kept_by_what_they_are_made_of() -> None:
    world = compile_world(ROOM)
    maps = NavMaps(world, SMALL, without=("ball",))
    first, poses = maps.at(), world.initial_body_pose.copy()
    poses[world.entities[world.entity_numbers["ball"]].root, :2] += 0.3
    assert maps.at(poses) is first  # which does not count
    crate = world.entity_numbers["crate_0"]
    poses[world.entities[crate].root, :2] = (0.3, 0.4)
    moved = maps.at(poses)
    assert moved is not first
    assert not moved.is_navigable((0.3, 0.4))
    present = world.initial_presence.copy()
    present[crate] = False
    assert maps.at(poses, present) is not moved
    assert maps.at() is first
    assert maps.made == 3


def test_a_map_says_what_is_wrong() -> None:
    world = compile_world(ROOM)
    with pytest.raises(NameLookupError, match="no entity 'bal'; did you mean 'ball'"):
        NavMaps(world, without=("bal",))
    with pytest.raises(AnysimError, match="radius above 0"):
        NavMaps(world, Agent(radius=0.0))
    with pytest.raises(AnysimError, match="three or more corners"):
        NavMaps(world, area=[0.0, 1.0])


def test_a_map_of_a_room_is_written_as_map_server_reads_it(tmp_path: Path) -> None:
    app = typer.Typer()
    commands.add_cli(app)
    app.command("other")(lambda: None)  # with one command alone there would be no name to give
    result = CliRunner().invoke(app, ["map", str(ROOM), "--out", str(tmp_path / "room"), "--json"])
    assert result.exit_code == 0, result.output
    about = yaml.safe_load((tmp_path / "room/map.yaml").read_text())
    pixels = np.asarray(Image.open(tmp_path / "room" / about["image"]))
    world = compile_world(load(ROOM))
    crate = world.initial_body_pose[world.entities[world.entity_numbers["crate_0"]].root, :2]

    def value(point: np.ndarray) -> int:
        column, row = ((point - about["origin"][:2]) / about["resolution"]).astype(int)
        return int(pixels[len(pixels) - 1 - row, column])

    assert value(crate) == 0
    assert value(np.array([-2.56, 0.0])) == 0  # the western wall
    assert value(np.array([-1.0, -2.16])) == 254  # the door in the southern one
    walls = json.loads((tmp_path / "room/walls.json").read_text())["walls"]
    kinds = {kind: [w for w in walls if w["kind"] == kind] for kind in ("wall", "lintel", "sill", "pane")}
    assert [len(found) for found in kinds.values()] == [7, 3, 2, 2]
    assert kinds["lintel"][0]["heights"] == [2.05, 2.6]

"""Ways through furnished rooms, held against the shortest ones: what `anysim bench navmesh` prints."""

from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from anysim.compile.world import compile_world
from anysim.conventions import Array
from anysim.model.world import World
from anysim_navigation.agent import Agent, NoRoute
from anysim_navigation.maps import NavMaps
from anysim_navigation.navmesh import NavMesh, length_of
from anysim_navigation.obstacles import outlines_of
from anysim_navigation.visibility import VisibilityGraph
from anysim_schemas.run import WorldSpec

ROOM_STYLES = ("living_room", "bedroom", "kitchen", "office")
EXACT = 1e-6
"""[m] of rounding by which a way may come nearer than the radius."""


class RoomFigures(NamedTuple):
    """What the queries in one room came to.

    Attributes:
        ways, refused: queries that were answered, and refused.
        failures: answered wrongly: refused where both ends lie in one part, or not refused where they do not, or a way
            that leaves the free ground.
        excess: length over that of the shortest way, of each way that was compared.
        nearest: [m] by how much a way keeps more than the radius from what stands there, at the least.
        bake: [s] to make the mesh.
        query: [s] of each.
        triangles: of the mesh.
    """

    ways: int
    refused: int
    failures: int
    excess: list[float]
    nearest: float
    bake: float
    query: list[float]
    triangles: int


def random_room(seed: int) -> World:
    """A furnished room of a style, size and openings that the seed says; every fourth is closed."""
    return compile_world(WorldSpec.model_validate({"name": f"room_{seed}", "room": room_of(seed)}))


def room_of(seed: int) -> dict[str, Any]:
    """The room that `random_room` makes of a seed, as a spec."""
    rng = np.random.default_rng(seed)
    size = [round(float(v), 2) for v in rng.uniform((4.0, 3.8), (7.0, 6.0))]
    sides = rng.permutation(["south", "east", "north", "west"]).tolist()
    count = (1 + seed % 2) if seed % 4 != 3 else 0
    doors = [{"wall": side, "at": round(float(rng.uniform(0.25, 0.75)), 2)} for side in sides[:count]]
    return {"style": ROOM_STYLES[seed % 4], "size": size, "doors": doors, "seed": seed}


def measure_room(world: World, agent: Agent, queries: int, rng: np.random.Generator, *, compared: int) -> RoomFigures:
    """Random queries between points where the agent may be; the first `compared` ways are held against the shortest."""
    import shapely

    begun = perf_counter()
    mesh = NavMaps(world, agent).at()
    bake = perf_counter() - begun
    outlines = outlines_of(world, world.initial_body_pose, world.initial_presence, agent, ())
    things: Any = shapely.union_all([shapely.Polygon(outline) for outline in outlines])
    allowed: Any = mesh.free.buffer(EXACT)
    parts = shapely.get_parts(mesh.free)
    graph = VisibilityGraph(mesh.free) if compared else None
    ways = refused = failures = 0
    excess: list[float] = []
    times: list[float] = []
    nearest = np.inf
    for start, goal in free_pairs(mesh, queries, rng):
        off = [shapely.distance(shapely.Point(end), parts) for end in (start, goal)]
        connected = bool((np.maximum(*off) <= EXACT).any())
        begun = perf_counter()
        try:
            path = mesh.path(start, goal)
        except NoRoute:
            refused += 1
            failures += connected
            continue
        times.append(perf_counter() - begun)
        ways += 1
        line = shapely.LineString(path)
        failures += not connected or not allowed.covers(line)
        nearest = min(nearest, line.distance(things) - agent.radius)
        if graph is not None and len(excess) < compared:
            excess.append(length_of(path) / graph.length(start, goal))
    return RoomFigures(ways, refused, failures, excess, nearest, bake, times, len(mesh.triangles))


def free_pairs(mesh: NavMesh, count: int, rng: np.random.Generator) -> Array:
    """(count, 2, 2) [m] pairs of points where the agent may be, evenly over the free ground."""
    low, high = np.array(mesh.free.bounds[:2]), np.array(mesh.free.bounds[2:])
    found: list[Array] = []
    while len(found) < 2 * count:
        found += [point for point in rng.uniform(low, high, (64, 2)) if mesh.is_navigable(point)]
    return np.array(found[: 2 * count]).reshape(count, 2, 2)

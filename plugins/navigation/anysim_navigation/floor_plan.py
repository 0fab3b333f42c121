"""Static maps of a world as files: an occupancy grid as ROS's map_server reads it, a floor plan, and the walls."""

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from anysim.compile.room import ROOM
from anysim.conventions import Array
from anysim.errors import AnysimError
from anysim.math import pose as P
from anysim.model.world import Box, World
from anysim_assets.rooms.occupancy import Occupancy
from anysim_navigation.agent import Agent
from anysim_navigation.maps import NavMaps
from anysim_navigation.obstacles import area_around, outlines_of

FREE_PIXEL, OCCUPIED_PIXEL, UNKNOWN_PIXEL = 254, 0, 205
"""Greys of map_server in its trinary mode."""
PARTS = {"wall": "wall", "lintel": "lintel", "sill": "sill", "pane": "pane"}
"""What the geoms of a room's shell are, by how their names begin."""
PLAN_WIDTH = 720
COLORS = {"floor": (244, 241, 234), "room": (196, 214, 196), "thing": (168, 150, 128), "wall": (60, 60, 64)}


class StaticMap(NamedTuple):
    """What stands in the way in a world as it begins.

    Attributes:
        grid: the cells: occupied where anything in them could be.
        outlines: polygons (K, 2) [m] of the things, from above.
        walls: (K, 2) of the shell of the room.
        parts: the boxes of the shell, as `walls.json` has them.
    """

    grid: Occupancy
    outlines: list[Array]
    walls: list[Array]
    parts: list[dict[str, Any]]


def static_map(world: World, agent: Agent, resolution: float, without: tuple[str, ...] = ()) -> StaticMap:
    """The map of a world; robots are left out.

    Raises:
        AnysimError: the grid would have more than 25 million cells.
    """
    others = tuple(e.name for e in world.entities if e.name == ROOM)
    poses, there = world.initial_body_pose, world.initial_presence
    things = outlines_of(world, poses, there, agent, (*(robot.name for robot in world.robots), *without, *others))
    shell = [e.name for e in world.entities if e.name != ROOM]
    walls = outlines_of(world, poses, there, agent, shell) if others else []
    area = area_around([*things, *walls], agent)
    cells = np.prod((area.max(axis=0) - area.min(axis=0)) / resolution)
    if cells > 25e6:
        raise AnysimError(f"a map of {cells / 1e6:.0f} million cells is too large; choose a coarser --resolution")
    return StaticMap(Occupancy.of_footprints([*things, *walls], area, resolution), things, walls, _shell(world))


def write_map(world: World, out: Path, agent: Agent, resolution: float, without: tuple[str, ...] = ()) -> StaticMap:
    """Write `map.yaml` and `map.png` (map_server), `floor_plan.png`, and `walls.json` into a directory."""
    from PIL import Image

    made = static_map(world, agent, resolution, without)
    out.mkdir(parents=True, exist_ok=True)
    grid = made.grid
    pixels = np.where(grid.occupied, OCCUPIED_PIXEL, FREE_PIXEL).astype(np.uint8)
    edge = np.ones_like(grid.occupied)
    edge[1:-1, 1:-1] = False
    pixels[edge] = UNKNOWN_PIXEL  # what is beyond the map is not known
    Image.fromarray(pixels[::-1]).save(out / "map.png")  # an image begins at the top
    lines = [
        "image: map.png",
        "mode: trinary",
        f"resolution: {resolution:g}",
        f"origin: [{grid.low[0]:.4f}, {grid.low[1]:.4f}, 0.0]",
        "negate: 0",
        "occupied_thresh: 0.65",
        "free_thresh: 0.25",
    ]
    (out / "map.yaml").write_text("\n".join(lines) + "\n", "utf-8")
    about = {"world": world.name, "hash": world.hash, "unit": "m", "walls": made.parts}
    (out / "walls.json").write_text(json.dumps(about, indent=1) + "\n", "utf-8")
    draw_plan(world, made, agent, without).save(out / "floor_plan.png")
    return made


def draw_plan(world: World, made: StaticMap, agent: Agent, without: tuple[str, ...] = ()) -> Any:
    """A picture of walls, things, and of where the middle of the agent may be."""
    from PIL import Image, ImageDraw

    low = made.grid.low
    high = low + made.grid.resolution * np.array(made.grid.occupied.shape[::-1])
    scale = PLAN_WIDTH / (high[0] - low[0])
    size = (PLAN_WIDTH, int(np.ceil(scale * (high[1] - low[1]))))
    image = Image.new("RGB", size, COLORS["floor"])
    draw = ImageDraw.Draw(image)

    def shape(points: Array, color: str) -> None:
        at = (points - low) * scale
        at[:, 1] = size[1] - at[:, 1]
        draw.polygon([(float(x), float(y)) for x, y in at], fill=COLORS[color])

    robots = tuple(robot.name for robot in world.robots)
    area = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
    mesh = NavMaps(world, agent, without=(*robots, *without), area=area).at()
    for triangle in mesh.triangles:
        shape(mesh.vertices[triangle], "room")
    for outline in made.outlines:
        shape(outline, "thing")
    for outline in made.walls:
        shape(outline, "wall")
    return image


def _shell(world: World) -> list[dict[str, Any]]:
    """The boxes of the room's shell: both ends of the middle line, thickness, and heights [m]."""
    found: list[dict[str, Any]] = []
    for entity in world.entities:
        if entity.name != ROOM:
            continue
        poses = world.initial_body_pose
        for body in range(entity.body_start, entity.body_stop):
            for number in world.body_geoms[body]:
                geom = world.geoms[number]
                name = geom.name.rpartition(".")[2]
                kind = next((kind for start, kind in PARTS.items() if name.startswith(start)), None)
                if kind is None or not isinstance(geom.shape, Box):
                    continue
                pose = P.compose(poses[body], P.pose(geom.position, geom.quaternion))
                along = P.rotate(pose[3:], np.array([geom.shape.half_size[0], 0.0, 0.0]))
                half = geom.shape.half_size
                found.append(
                    {
                        "name": name,
                        "kind": kind,
                        "from": [round(float(v), 4) for v in (pose[:3] - along)[:2]],
                        "to": [round(float(v), 4) for v in (pose[:3] + along)[:2]],
                        "thickness": round(2 * half[1], 4),
                        "heights": [round(float(pose[2] - half[2]), 4), round(float(pose[2] + half[2]), 4)],
                    }
                )
    return found

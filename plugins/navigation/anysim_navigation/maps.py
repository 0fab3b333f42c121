"""Maps of the envs of a world, made when they are asked for and kept by what they are made of."""

from collections import OrderedDict
from collections.abc import Sequence
from hashlib import sha256

import numpy as np
from numpy.typing import ArrayLike

from anysim.conventions import Array
from anysim.errors import AnysimError, NameLookupError, listing, suggest
from anysim.model.shapes import Plane
from anysim.model.world import World
from anysim_navigation.agent import Agent
from anysim_navigation.navmesh import NavMesh
from anysim_navigation.obstacles import area_around, free_ground, outlines_of
from anysim_navigation.uneven import free_of, surfaces, walkable
from anysim_sensors.scene import SceneGeometry

KEPT = 64
"""Meshes that are kept; the one that was not asked for longest goes first."""


class NavMaps:
    """Navigation meshes of a world for one agent.

    On level ground they are exact, from outlines; on ground with slopes they are made from rays, cell by cell. A mesh
    is kept by the outlines (or the poses of the shapes) that it was made of: where nothing has moved it is the same
    one, and a layout that another env had before is not made again.
    """

    def __init__(
        self,
        world: World,
        agent: Agent | None = None,
        *,
        without: Sequence[str] = (),
        area: ArrayLike | None = None,
        uneven: bool | None = None,
        cell: float = 0.05,
    ) -> None:
        """Maps that leave some entities out.

        Args:
            world: the neutral model.
            agent: what moves; a disc of 0.3 m if not given.
            without: entities that do not stand in the way: the agent itself, and what moves by itself.
            area: (K, 2) [m] corners of the ground that is mapped; a rectangle around all things if not given.
            uneven: whether it is made from rays; if not given, wherever the ground is not one level plane. Ramps of
                boxes on a plane need it.
            cell: [m] edge of the cells of uneven ground.
        """
        self.world, self.agent = world, Agent() if agent is None else agent
        self.agent.check()
        names = [entity.name for entity in world.entities]
        for name in without:
            if name not in names:
                raise NameLookupError(f"no entity '{name}'{suggest(name, names)} (entities: {listing(names)})")
        level = all(
            isinstance(g.shape, Plane) and g.position[2] == 0.0 for g in world.geoms if g.body < 0 and g.collides
        )
        self._without, self._cell = tuple(without), cell
        self._uneven = not level if uneven is None else uneven
        self._area = None if area is None else np.array(area, dtype=float)
        if self._area is not None and (self._area.ndim != 2 or self._area.shape[1] != 2 or len(self._area) < 3):
            raise AnysimError(f"an area is three or more corners x, y [m], got an array of shape {self._area.shape}")
        self._scene: SceneGeometry | None = None
        self._kept: OrderedDict[bytes, NavMesh] = OrderedDict()
        self.made = 0
        """How many meshes were made."""

    def at(self, body_pose: ArrayLike | None = None, present: ArrayLike | None = None) -> NavMesh:
        """The mesh with bodies at poses (B, 7), a row of `State.body_pose`, and entities (E,) bool that are there.

        Both are those of the world right after a reset where they are not given.
        """
        poses = np.array(self.world.initial_body_pose if body_pose is None else body_pose, dtype=float)
        there = np.array(self.world.initial_presence if present is None else present, dtype=bool)
        outlines = outlines_of(self.world, poses, there, self.agent, self._without)
        area = area_around(outlines, self.agent) if self._area is None else self._area
        if self._uneven:
            return self._over_rays(poses, there, area)
        key = sha256(b"".join([*(np.round(o, 6).tobytes() + b"|" for o in outlines), area.tobytes()])).digest()
        return self._known(key) or self._keep(key, NavMesh(free_ground(outlines, area, self.agent), self.agent))

    def _over_rays(self, poses: Array, there: Array, area: Array) -> NavMesh:
        import shapely

        if self._scene is None:
            self._scene = SceneGeometry(self.world)
        scene = self._scene
        posed = scene.posed(poses[None], there[None])
        owned = [
            n for n, e in enumerate(self.world.body_entity) if e >= 0 and self.world.entities[e].name in self._without
        ]
        seen = scene.without(owned) & posed.there[0]
        box = [np.round(values[0][seen], 6).tobytes() for values in (posed.frame, posed.low, posed.high)]
        key = sha256(b"".join([*box, seen.tobytes(), area.tobytes()])).digest()
        if (known := self._known(key)) is not None:
            return known
        top = posed.high[0][seen, 2]
        bottom = posed.low[0][seen, 2]
        low = np.array([*area.min(axis=0), float(bottom[np.abs(bottom) < 1e6].min(initial=0.0)) - 1.0])
        high = np.array([*area.max(axis=0), float(top[np.abs(top) < 1e6].max(initial=0.0)) + 1.0])
        ground = walkable(surfaces(scene, posed, seen, low, high, self._cell), self.agent)
        free = free_of(ground, self.agent).intersection(shapely.Polygon(area))
        return self._keep(key, NavMesh(free, self.agent, ground.heights_at))

    def _known(self, key: bytes) -> NavMesh | None:
        if key in self._kept:
            self._kept.move_to_end(key)
        return self._kept.get(key)

    def _keep(self, key: bytes, mesh: NavMesh) -> NavMesh:
        self._kept[key] = mesh
        self.made += 1
        while len(self._kept) > KEPT:
            self._kept.popitem(last=False)
        return mesh

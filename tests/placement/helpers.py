"""Small layouts for tests: envs without an engine's physics, and what the layout did with them."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from anysim.api import compile_world, load
from anysim.geometry.convex_parts import pose_of
from anysim.managers.standard import standard_managers
from anysim.placement.clearance import ClearanceQuery
from anysim.placement.context import PlacementContext
from anysim.testing.kinematic import NullEngine

TABLE = {"table": {"source": {"box": [0.8, 1.0, 0.4]}, "fixed": True}}
ON_TABLE = {"table": {"position": [0.0, 0.0, 0.2]}}


class Layouts:
    """Envs of one world on the kinematic engine; `pose[name]` (N, 7) after a reset."""

    def __init__(
        self,
        objects: Mapping[str, Any],
        layout: Mapping[str, Any],
        num_envs: int = 4,
        proposals: Any = None,
        **world: Any,
    ) -> None:
        source = {
            "engine": "null", "num_envs": num_envs,
            "world": {"objects": {**TABLE, **objects}, "layout": {**ON_TABLE, **layout}, **world},
        }  # fmt: skip
        loaded = load(source)
        self.world = compile_world(loaded)
        self.managers = standard_managers(loaded.spec, self.world, num_envs, proposals)
        self.manager = next(manager for manager in self.managers if manager.name == "layout")
        self.streams = self.manager.streams
        self.engine = NullEngine()
        self.engine.create_world(self.world, num_envs)
        for manager in self.managers:
            manager.bind(self.engine)
        self.envs = np.arange(num_envs)

    def reset(self, seed: int = 0) -> dict[str, np.ndarray]:
        self.streams.seed(seed, self.envs)
        self.streams.begin(self.envs)
        self.engine.reset()
        self.manager.reset(self.envs)
        pose = self.engine.get_state().body_pose
        return {e.name: pose[:, e.root] for e in self.world.entities}

    def gaps(self, pose: Mapping[str, np.ndarray], env: int) -> dict[tuple[str, str], float]:
        """The distance of every pair [m], up to 1 m."""
        context, clearance = PlacementContext(self.world), ClearanceQuery(self.world)
        names = list(pose)
        placed = {name: context.solid(name).at(pose_of(pose[name][env])) for name in names}
        return {(a, b): clearance.gap(placed[a], placed[b], 1.0) for k, a in enumerate(names) for b in names[k + 1 :]}

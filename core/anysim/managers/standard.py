"""The managers that every env has."""

from typing import Any

from anysim.managers.base import Manager
from anysim.managers.board import Board
from anysim.managers.camera import CameraManager
from anysim.managers.capture import CaptureManager
from anysim.managers.joints import JointManager
from anysim.managers.layout import LayoutManager
from anysim.managers.light import LightManager
from anysim.managers.physics import PhysicsManager
from anysim.managers.population import PopulationManager
from anysim.managers.robot import RobotManager
from anysim.managers.scene import SceneManager
from anysim.managers.terrain import TerrainManager
from anysim.model.world import World
from anysim.randomization.streams import Streams
from anysim_schemas.run import RunSpec


def standard_managers(spec: RunSpec, world: World, num_envs: int, proposals: Any = None) -> list[Manager]:
    """Configured and built, sharing one set of streams. `proposals` is what `make` takes for poses."""
    streams, board = Streams(num_envs), Board(num_envs)
    managers: list[Manager] = [
        TerrainManager(), PopulationManager(), LayoutManager(proposals), SceneManager(), JointManager(),
        PhysicsManager(), RobotManager(), LightManager(), CameraManager(), CaptureManager(),
    ]  # fmt: skip
    for manager in managers:
        manager.configure(spec, streams, board)
        manager.build(world)
    return managers

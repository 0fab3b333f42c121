"""The managers that every env has, and what they ask of an engine, checked before anything is built."""

from collections.abc import Callable, Iterable, Sequence

from anysim.engine.base import SimEngine
from anysim.engine.capability import Need, check
from anysim.engine.requirements import needs_of
from anysim.managers.action import ActionManager
from anysim.managers.base import Episodes, Manager
from anysim.managers.camera import CameraManager, CaptureManager
from anysim.managers.curriculum import CurriculumManager
from anysim.managers.families import FamilyManager
from anysim.managers.layout import LayoutManager
from anysim.managers.layout_proposals import Proposed
from anysim.managers.object_parameters import SceneManager
from anysim.managers.population import PopulationManager
from anysim.managers.randomized_parameters import LightManager, SceneParameterManager
from anysim.managers.robot_reset import RobotResetManager
from anysim.managers.sensors import SensorManager
from anysim.managers.terrain import TerrainManager
from anysim.model.world import World
from anysim.randomization.streams import Streams
from anysim_schemas.run import RunSpec


def standard_managers(spec: RunSpec, world: World, num_envs: int, proposals: Proposed | None = None) -> list[Manager]:
    """Configured and built, sharing one set of streams. `proposals` is what `make` takes for poses."""
    streams, episodes = Streams(num_envs, spec.seed), Episodes(num_envs)
    managers: list[Manager] = [
        TerrainManager(), PopulationManager(), LayoutManager(proposals), SceneManager(), SceneParameterManager(),
        RobotResetManager(), ActionManager(), LightManager(), CameraManager(), CaptureManager(),
    ]  # fmt: skip
    if spec.task is not None and spec.task.curriculum:
        managers.append(CurriculumManager())
    if spec.world.families:
        managers.append(FamilyManager())
    if spec.world.sensors:
        managers.append(SensorManager())
    for manager in managers:
        manager.configure(spec, streams, episodes)
        manager.build(world)
    return managers


def unchangeable(
    engine: type[SimEngine] | SimEngine, managers: Iterable[Manager], place: Callable[[str], str] = str
) -> list[str]:
    """A sentence for each parameter that a manager will change and the engine cannot; managers are built already.

    `place` gives `file:line:column` for a dotted path of the spec, or the path itself where it is not known.
    """
    reasons: dict[str, None] = {}
    for manager in managers:
        for parameter, path in manager.parameters():
            if parameter not in engine.parameters:
                where = place(path)
                at = f" ({where})" if where and where != path else ""
                reasons[f"{path}{at} differs between envs, and {engine.name} cannot change '{parameter}' per env"] = (
                    None
                )
    return list(reasons)


def check_run(
    engine: type[SimEngine] | SimEngine,
    world: World,
    managers: Sequence[Manager],
    source: str,
    place: Callable[[str], str] = str,
    options: object = None,
) -> list[Need]:
    """Refuse a world, and what its managers will do with it, in one error; returns the needs met approximately.

    `options` are those that the engine has or will have.

    Raises:
        CapabilityError: lists every need that the engine does not meet.
    """
    refusals = [*engine.refusals(world, options), *unchangeable(engine, managers, place)]
    needs = [*needs_of(world), *(need for manager in managers for need in manager.needs())]
    return check(engine.name, engine.capabilities, needs, source, refusals, place)

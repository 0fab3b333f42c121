"""The comparison: every layer on every engine, one after the other."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

from anysim import registry
from anysim.api import compile_world
from anysim.engine.base import SimEngine
from anysim.engine.capability import Capability
from anysim.engine.factory import create_simulation, runnable
from anysim.errors import EngineError, listing, suggest
from anysim.model.world import World
from anysim_parity.actuation import actuation_layer
from anysim_parity.asset import asset_layer
from anysim_parity.camera import camera_layer
from anysim_parity.contact import contact_layer
from anysim_parity.engines import Engines, guarded
from anysim_parity.kinematics import kinematics_layer
from anysim_parity.report import Comparison
from anysim_parity.result import Layer
from anysim_parity.task import task_layer
from anysim_schemas.load import LoadedRun

Report = Callable[[str, int, int], None]
"""Called with a layer's name, how much of it is done and how much there is."""


class _Plan(NamedTuple):
    loaded: LoadedRun
    world: World
    names: tuple[str, ...]
    engines: Engines
    seed: int
    episodes: int
    report: Report


class _Kind(NamedTuple):
    """A layer: why it does not apply (empty where it does), and how it is measured."""

    not_for: Callable[[_Plan], str]
    measure: Callable[[_Plan], Layer]


def _no_joints(plan: _Plan) -> str:
    return "" if plan.world.joints else "nothing in this world has joints"


def _no_drives(plan: _Plan) -> str:
    return "" if plan.world.actuators else "nothing in this world has drives"


def _no_cameras(plan: _Plan) -> str:
    return "" if plan.world.cameras else "this world has no cameras"


def _no_expert(plan: _Plan) -> str:
    task = plan.loaded.spec.task
    if task is None:
        return "this is a world without a task"
    return "" if task.expert is not None or plan.loaded.spec.collect is not None else "the task has no expert"


def _task(plan: _Plan) -> Layer:
    total, done = len(plan.names) * plan.episodes, iter(range(1, 1 + len(plan.names) * plan.episodes))
    return task_layer(
        plan.loaded,
        plan.names,
        episodes=plan.episodes,
        seed=plan.seed,
        tick=lambda engine: plan.report("task", next(done), total),
    )


_KINDS: dict[str, _Kind] = {
    "asset": _Kind(lambda plan: "", lambda plan: asset_layer(plan.world, plan.engines)),
    "kinematics": _Kind(_no_joints, lambda plan: kinematics_layer(plan.world, plan.engines, seed=plan.seed)),
    "actuation": _Kind(_no_drives, lambda plan: actuation_layer(plan.world, plan.engines, seed=plan.seed)),
    "contact": _Kind(lambda plan: "", lambda plan: contact_layer(plan.engines, dt=plan.world.physics.dt)),
    "camera": _Kind(_no_cameras, lambda plan: camera_layer(plan.world, plan.engines)),
    "task": _Kind(_no_expert, _task),
}

LAYERS = tuple(_KINDS)
"""In the order in which one rests on the other."""


def compare(
    loaded: LoadedRun,
    engines: Sequence[str] | None = None,
    layers: Sequence[str] | None = None,
    *,
    episodes: int = 16,
    seed: int = 0,
    name: str = "",
    report: Report = lambda layer, done, total: None,
) -> Comparison:
    """Measure how far engines agree on a world or task.

    Args:
        loaded: what `anysim.api.load` returned.
        engines: installed ones by name; all that can run here and move by forces where it is None.
        layers: some of `LAYERS`; all that apply where it is None.
        episodes: of the layer `task`, on each engine.
        seed: everything random follows from it.
        name: what the comparison is called; the world's name by default.
        report: called as the work goes on.

    Raises:
        EngineError: an engine cannot run here, a layer does not exist or does not apply, or nothing is to be compared.
        SpecError, AssetError: the world cannot be compiled.
    """
    names = tuple(engines) if engines is not None else engines_here()
    if len(set(names)) != len(names) or not names:
        raise EngineError(f"name each engine once, and at least one (installed: {listing(registry.names('engines'))})")
    options = {n: loaded.spec.engine.options if n == loaded.spec.engine.name else {} for n in names}
    factories = {n: partial(_engine, n, options[n]) for n in names}
    versions = {n: _version(factories[n]) for n in names}
    world = compile_world(loaded)
    plan = _Plan(loaded, world, names, factories, seed, episodes, report)
    chosen = _chosen(plan, layers)
    found = []
    for number, layer in enumerate(chosen):
        report(layer, 0, 0)
        found.append(_measured(plan, layer))
        report(layer, number + 1, len(chosen))
    words = f"{len(world.bodies)} bodies, {len(world.joints)} joints, {len(world.geoms)} geoms"
    return Comparison(
        name or world.name, versions, seed, episodes if "task" in chosen else 0, world.hash, words, tuple(found)
    )


def _measured(plan: _Plan, layer: str) -> Layer:
    """One layer; engines that fail are noted in it, and a layer that fails as a whole is refused for all of them."""
    whole = guarded({layer: lambda: _KINDS[layer].measure(plan)})
    if layer in whole.found:
        return whole.found[layer]
    return Layer(layer, "It could not be measured.", refused=dict.fromkeys(plan.names, whole.refused[layer]))


def engines_here() -> tuple[str, ...]:
    """The installed engines that can run here and have dynamics."""
    return runnable(Capability.DYNAMICS)


def _engine(name: str, options: dict[str, Any]) -> SimEngine:
    return create_simulation(name, **options)


def _version(make: Callable[[], SimEngine]) -> str:
    with make() as engine:
        return engine.version


def _chosen(plan: _Plan, layers: Sequence[str] | None) -> list[str]:
    if layers is None:
        return [layer for layer in LAYERS if not _KINDS[layer].not_for(plan)]
    for layer in layers:
        if layer not in _KINDS:
            raise EngineError(f"there is no layer '{layer}'{suggest(layer, LAYERS)} (layers: {listing(LAYERS)})")
        if why := _KINDS[layer].not_for(plan):
            raise EngineError(f"the layer '{layer}' does not apply: {why}; leave it out of --layers")
    return [layer for layer in LAYERS if layer in layers]

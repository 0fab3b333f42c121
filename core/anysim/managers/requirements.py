"""What managers will change per env, checked against an engine before anything is built."""

from collections.abc import Callable, Iterable
from typing import Any

from anysim.engine.base import SimEngine
from anysim.engine.capability import check
from anysim.engine.requirements import needs_of
from anysim.managers.base import Manager
from anysim.model.world import World


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
    managers: Iterable[Manager],
    source: str,
    place: Callable[[str], str] = str,
) -> Any:
    """Refuse a world, and what its managers will do with it, in one error.

    Raises:
        CapabilityError: lists every need that the engine does not meet.
    """
    refusals = [*engine.refusals(world), *unchangeable(engine, managers, place)]
    return check(engine.name, engine.capabilities, needs_of(world), source, refusals)

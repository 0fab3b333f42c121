"""Doing the same on several engines, so that one that fails takes no other with it."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Generic, NamedTuple, TypeVar

from anysim.engine.base import SimEngine
from anysim.engine.capability import Capability
from anysim.errors import AnysimError
from anysim.model.world import World

Engines = Mapping[str, Callable[[], SimEngine]]
"""By name a function that makes the engine, without a world."""

T = TypeVar("T")


class Each(NamedTuple, Generic[T]):
    """What a probe found, and why it found nothing; by engine."""

    found: dict[str, T]
    refused: dict[str, str]


def on_each(engines: Engines, probe: Callable[[SimEngine], T]) -> Each[T]:
    """Run a probe on a fresh engine of each kind; one that cannot, or that breaks, is noted with its message."""

    def run(make: Callable[[], SimEngine]) -> T:
        with make() as engine:
            return probe(engine)

    return guarded({name: partial(run, make) for name, make in engines.items()})


def guarded(probes: Mapping[str, Callable[[], T]]) -> Each[T]:
    """Call each; what one raises becomes its refusal, and the others go on."""
    found: dict[str, T] = {}
    refused: dict[str, str] = {}
    for name, probe in probes.items():
        try:
            found[name] = probe()
        except AnysimError as error:
            refused[name] = str(error)
        except Exception as error:  # noqa: BLE001  whatever breaks in one engine must not cost the others their numbers
            refused[name] = f"{type(error).__name__}: {error}"
    return Each(found, refused)


def in_world(world: World, probe: Callable[[SimEngine], T]) -> Callable[[SimEngine], T]:
    """A probe of an engine that runs a world."""
    return lambda engine: probe(engine.create_world(world))


def moves_by_force(engine: SimEngine) -> bool:
    """Whether forces do anything on this engine."""
    return Capability.DYNAMICS in engine.capabilities.supported


def declared(engines: Engines, *capabilities: Capability) -> str:
    """What engines say of their approximations of these capabilities: `pybullet declares of joint limits: …`."""
    parts = []
    for name, make in engines.items():
        with make() as engine:
            supported = engine.capabilities.supported
        notes = [(c, supported[c].note) for c in capabilities if c in supported and supported[c].note]
        parts += [f"{name} declares of {capability}: {note}" for capability, note in notes]
    return "; ".join(parts)

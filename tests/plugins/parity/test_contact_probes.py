"""The probes: each finds the engine that is wrong in it, and the real ones are right or say what they are wrong by."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import pytest

from anysim.engine.base import SimEngine
from anysim.engine.capability import Capabilities, Capability
from anysim.engine.factory import create_simulation
from anysim.errors import EngineError
from anysim.model.world import Surface, World
from anysim.testing.engines import require_engine
from anysim.testing.kinematic import NullEngine
from anysim_mujoco.engine import MujocoEngine
from anysim_parity.contact import PROBES, contact_layer
from anysim_parity.judge import outside
from anysim_parity.result import Layer, Measure

ENGINES = ("mujoco", "pybullet", "sapien")


def measured(layer: Layer) -> Mapping[str, Measure]:
    return {m.subject: m for m in layer.measures}


def wrong(spoil: Callable[[World], World]) -> type[SimEngine]:
    """MuJoCo, building another world than it was given."""

    class Wrong(MujocoEngine):
        def _build(self, world: World, num_envs: int) -> None:
            super()._build(spoil(world), num_envs)

    return Wrong


def surfaces(**change: Callable[[Surface], Any]) -> Callable[[World], World]:
    """Worlds with other surfaces."""

    def spoil(world: World) -> World:
        changed = [
            replace(g, surface=replace(g.surface, **{name: value(g.surface) for name, value in change.items()}))
            for g in world.geoms
        ]
        return replace(world, geoms=tuple(changed))

    return spoil


def gravity(scale: float) -> Callable[[World], World]:
    """Worlds on another planet."""
    return lambda w: replace(w, physics=replace(w.physics, gravity=(0.0, 0.0, -9.81 * scale)))


def masses(scale: float) -> Callable[[World], World]:
    """Worlds of another density."""
    return lambda w: replace(
        w, bodies=tuple(replace(b, inertial=b.inertial._replace(mass=b.inertial.mass * scale)) for b in w.bodies)
    )


def inertias(scale: float) -> Callable[[World], World]:
    """Worlds of hollow things."""

    def other(world: World) -> World:
        bodies = [
            replace(b, inertial=b.inertial._replace(inertia=tuple(scale * i for i in b.inertial.inertia)))
            for b in world.bodies
        ]
        return replace(world, bodies=tuple(bodies))

    return other


SLIPPERY = surfaces(friction=lambda s: 0.8 * s.friction)
FOUND = {
    "drop": (gravity(0.9), "drop: time of a fall over 0.4 m"),
    "drop, mass": (masses(1.1), "drop: force under a box of 1 kg at rest"),
    "bounce": (surfaces(restitution=lambda s: min(1.0, 1.2 * s.restitution)), "bounce: apex after the impact, e = 0.6"),
    "slide": (SLIPPERY, "slide: stopping distance from 2 m/s, mu = 0.3"),
    "slide, pushed": (SLIPPERY, "slide: acceleration pushed with 5 N"),
    "incline": (SLIPPERY, "incline: acceleration at 30 degrees, mu = 0.4"),
    "pairs": (surfaces(friction=lambda s: s.friction**2), "pairs: friction of 0.2 on a fixed 0.6"),
    "roll": (inertias(1.5), "roll: acceleration of a sphere down 15 degrees"),
    "roll, launched": (SLIPPERY, "roll: time until it rolls"),
    "slip": (SLIPPERY, "tilt: angle at which a box slips, mu = 0.5"),
    "topple": (SLIPPERY, None),
    "stack": (masses(1.1), "stack: force on box 1 from the one above"),
    "grasp": (SLIPPERY, "grasp: least grip that holds, in m g / (2 mu)"),
    "lift": (surfaces(friction=lambda s: 0.2 * s.friction), "lift: slip in a lift of 0.1 m"),
}
"""By probe: what spoils an engine, and the measure that finds it (None: topples all the same)."""


@pytest.mark.parametrize("case", FOUND)
def test_a_probe_finds_the_engine_that_is_wrong(case: str) -> None:
    spoil, subject = FOUND[case]
    layer = contact_layer({"right": MujocoEngine, "wrong": wrong(spoil)}, probes=[case.partition(",")[0]])
    assert not layer.refused
    if subject is None:
        assert not outside(layer.measures[0])
        return
    found = measured(layer)[subject]
    assert "wrong" in outside(found)
    assert found.reference is not None
    right, off = (abs(found.values[name] - found.reference) for name in ("right", "wrong"))
    assert off > 2 * right


SOFT = ": soft"
MULTIPLIES = ": friction multiplies"
DECLARED = {
    ("mujoco", "bounce: depth of the impact, e = 0"): "declares for restitution",
    ("mujoco", "bounce: depth of the impact, e = 0.3"): "declares for restitution",
    ("mujoco", "bounce: depth of the impact, e = 0.6"): "declares for restitution",
    ("mujoco", "bounce: depth of the impact, e = 0.9"): "declares for restitution",
    ("mujoco", "stack: height of the top one of 5 boxes after 2.5 s"): SOFT,
    ("mujoco", "stack: height of 50 kg on 1 kg"): SOFT,
    ("mujoco", "lift: force of a finger on the cube"): SOFT,
    ("mujoco", "lift: slip in a lift of 0.1 m"): SOFT,
    ("mujoco", "lift: slip in 2 s of holding"): SOFT,
    ("pybullet", "roll: acceleration of a cylinder down 15 degrees"): MULTIPLIES,
    ("sapien", "roll: acceleration of a cylinder down 15 degrees"): "a cylinder is a prism",
}
"""Known errors of the engines, and the declared words that account for them."""


@pytest.mark.parametrize("engine", ENGINES)
def test_a_real_engine_is_right_or_says_what_it_is_wrong_by(engine: str) -> None:
    require_engine(engine)
    layer = contact_layer({engine: lambda: create_simulation(engine)})
    assert not layer.refused
    assert all(engine in m.values for m in layer.measures)
    off = {m.subject: m.explanation for m in layer.measures if outside(m)}
    known = {subject: words for (name, subject), words in DECLARED.items() if name == engine}
    assert set(off) == set(known)
    for subject, words in known.items():
        assert words in off[subject], f"{subject}: {off[subject]}"
    for plot in layer.plots:
        assert plot.reference is not None
        assert [s.name for s in plot.series] == [engine]


def test_two_runs_are_one() -> None:
    """The same numbers, bit for bit, however often."""
    engines = {"mujoco": MujocoEngine}
    assert contact_layer(engines, probes=["stack", "lift"]) == contact_layer(engines, probes=["stack", "lift"])


def test_an_engine_that_lacks_something_is_left_out_and_named() -> None:
    layer = contact_layer({"null": NullEngine, "mujoco": MujocoEngine}, probes=["drop", "slide"])
    assert layer.refused == {
        "null": "drop: null does not declare dynamics; slide: null does not declare dynamics, external wrenches"
    }
    assert all(set(m.values) == {"mujoco"} for m in layer.measures)


def test_an_engine_without_contact_sensors_is_asked_for_the_rest() -> None:
    class Numb(MujocoEngine):
        capabilities = Capabilities(
            {c: s for c, s in MujocoEngine.capabilities.supported.items() if c is not Capability.CONTACT_SENSORS}
        )

    layer = contact_layer({"numb": Numb}, probes=["drop"])
    found = measured(layer)
    assert "numb" in found["drop: height of a box of 1 kg at rest"].values
    assert "numb" not in found["drop: force under a box of 1 kg at rest"].values
    assert layer.refused["numb"].endswith("does not declare contact sensors")
    assert "drop: force under a box of 1 kg at rest" in layer.refused["numb"]


def test_an_engine_that_fails_is_refused_with_its_words() -> None:
    class Failing(MujocoEngine):
        def _step(self, *_: Any) -> None:
            raise ValueError("the spring broke")

    layer = contact_layer({"failing": Failing, "mujoco": MujocoEngine}, probes=["drop"])
    assert layer.refused == {"failing": "drop: ValueError: the spring broke"}
    assert all(set(m.values) == {"mujoco"} for m in layer.measures)


def test_an_unknown_probe_is_an_error_that_lists_them() -> None:
    with pytest.raises(EngineError, match=r"there is no probe 'fly'.*drop, bounce"):
        contact_layer({}, probes=["fly"])
    assert next(iter(PROBES)) == "drop"

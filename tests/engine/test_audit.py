"""The audit finds what an engine changed, and nothing where it changed nothing."""

from dataclasses import replace
from typing import ClassVar

import pytest

import anysim
from anysim.engine.base import SimEngine
from anysim.engine.capability import Allowance
from anysim.engine.factory import create_simulation
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.world import World
from anysim.testing.audit import audit
from anysim.testing.kinematic import NullEngine
from tests.task.helpers import BLIND


@pytest.fixture(scope="module")
def world() -> World:
    return anysim.compile_world("pick_cube", overrides=BLIND)


def differing(engine: SimEngine, world: World) -> set[tuple[str, str]]:
    with engine:
        engine.create_world(world)
        return {(line.subject, line.quantity) for line in audit(engine) if line.ok is False}


@pytest.mark.parametrize("name", ["null", "mujoco"])
def test_an_engine_that_builds_what_it_is_told_is_clean(name: str, world: World) -> None:
    assert differing(create_simulation(name), world) == set()


def test_mujoco_reports_every_quantity(world: World) -> None:
    with create_simulation("mujoco") as engine:
        engine.create_world(world)
        assert [line for line in audit(engine) if line.ok is None] == []


class Spoiled(NullEngine):
    """Builds another world than it is given, as a native importer would."""

    def _build(self, world: World, num_envs: int) -> None:
        bodies = list(world.bodies)
        bodies[3] = replace(bodies[3], inertial=bodies[3].inertial._replace(mass=9.0))
        bodies[5] = replace(bodies[5], position=(0.0, 0.0, 0.1))
        joints = list(world.joints)
        joints[2] = replace(joints[2], damping=0.5)
        self._spoiled = replace(world, bodies=tuple(bodies), joints=tuple(joints))
        super()._build(self._spoiled, num_envs)

    _shown: World | None = None

    @property
    def world(self) -> World:
        return self._shown or super().world

    def _read(self, name: str):
        self._shown = self._spoiled
        try:
            return super()._read(name)
        finally:
            self._shown = None


def test_a_spoiled_engine_is_found_out(world: World) -> None:
    found = differing(Spoiled(), world)
    names = [b.name for b in world.bodies]
    assert (names[3], "mass") in found
    assert ("panda", "total mass") in found
    assert (world.joints[2].name, "damping") in found
    assert (names[5], "frame") in found
    assert (names[1], "frame") not in found


class Crooked(NullEngine):
    """Turns one joint about another axis, and lets the second joint move the third one's body."""

    def _build(self, world: World, num_envs: int) -> None:
        joints = list(world.joints)
        joints[0] = replace(joints[0], axis=(0.0, 1.0, 0.0))
        self._crooked = replace(world, joints=tuple(joints))
        super()._build(world, num_envs)

    def _read(self, name: str):
        if name != "body_pose":
            return super()._read(name)
        swapped = self._envs.position.copy()
        swapped[:, [1, 2]] = swapped[:, [2, 1]]
        return forward_kinematics(self._crooked, self._envs.roots, swapped)


def test_a_wrong_axis_and_a_wrong_order_are_found_out(world: World) -> None:
    found = differing(Crooked(), world)
    first, second, third, fourth = (world.joints[i].name for i in range(4))
    assert (first, "axis") in found
    assert (first, "moves") not in found
    assert {(second, "moves"), (third, "moves")} <= found
    assert (fourth, "axis") not in found
    assert (fourth, "moves") not in found


class Rounded(NullEngine):
    """Has masses that are 0.2 % off and declares 0.5 %; its inertias are off as much and it does not."""

    audit_allowances: ClassVar = {"mass": Allowance(0.005, "scales are coarse")}

    def _get_parameter(self, name: str):
        return super()._get_parameter(name) * (1.002 if name in ("body.mass", "body.inertia") else 1.0)


def test_what_is_declared_counts_as_equal_and_is_told(world: World) -> None:
    with Rounded() as engine:
        engine.create_world(world)
        lines = audit(engine)
    masses = [line for line in lines if line.quantity == "mass"]
    assert all(line.ok for line in masses)
    assert {line.note for line in masses} == {"within the declared 0.5 %: scales are coarse"}
    moments = [line for line in lines if line.quantity == "principal moments" and min(line.expected) > 1e-4]
    assert moments
    assert all(line.ok is False and not line.note for line in moments)

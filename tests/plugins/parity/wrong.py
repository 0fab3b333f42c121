"""Engines that do one thing wrong, each in a layer of its own."""

from dataclasses import replace

from anysim.engine.factory import create_simulation
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.shapes import Box
from anysim.model.world import BodyKind, JointType, World
from anysim.testing.kinematic import NullEngine
from anysim.testing.sketch import Sketch, inertial


def arm() -> World:
    """Two links that turn about z and y, driven, with a sliding third one."""
    s = Sketch("arm", gravity=(0.0, 0.0, -9.81))
    part = inertial(Box((0.1, 0.05, 0.05)), 2.0)
    base = s.robot("arm", (0.3, 0.1, 0.5))
    first = s.link("first", base, JointType.REVOLUTE, (0.0, 0.0, 1.0), part, lower=-2.0, upper=2.0)
    second = s.link(
        "second",
        first,
        JointType.REVOLUTE,
        (0.0, 1.0, 0.0),
        part,
        position=(0.2, 0.0, 0.1),
        lower=-1.5,
        upper=1.5,
        armature=0.1,
    )
    third = s.link(
        "third", second, JointType.PRISMATIC, (1.0, 0.0, 0.0), part, position=(0.2, 0.0, 0.0), lower=-0.1, upper=0.2
    )
    for body, kp, kd in ((first, 200.0, 20.0), (second, 300.0, 20.0), (third, 800.0, 60.0)):
        s.drive(body, kp=kp, kd=kd)
    return s.world()


class Shifted(NullEngine):
    """Puts one link's frame 1 mm from where it belongs; the base body's world is right."""

    SHIFT = 1e-3

    def _read(self, name: str):
        world = self._world
        bodies = list(world.bodies)
        spot = next(i for i, body in enumerate(bodies) if body.kind is BodyKind.LINK)
        x, y, z = bodies[spot].position
        bodies[spot] = replace(bodies[spot], position=(x + self.SHIFT, y, z))
        wrong = replace(world, bodies=tuple(bodies))
        if name == "body_pose":
            return forward_kinematics(wrong, self._envs.roots, self._envs.position)
        return super()._read(name)


class Heavier(NullEngine):
    """Builds one body a tenth heavier and says so when it is asked."""

    def _get_parameter(self, name: str):
        values = super()._get_parameter(name).copy()
        if name == "body.mass":
            values[:, 1] *= 1.1
        return values


def altered(change):
    """A MuJoCo that is given another world than it was asked for: `change` makes it."""

    def make():
        engine = create_simulation("mujoco")
        build = engine._build

        def _build(world: World, num_envs: int) -> None:
            build(change(world), num_envs)

        engine._build = _build
        return engine

    return make


def softer(world: World) -> World:
    """Drives with half their gain."""
    return replace(world, actuators=tuple(replace(a, kp=0.5 * a.kp) for a in world.actuators))


def slower(world: World) -> World:
    """Drives that brake three times as much."""
    return replace(world, actuators=tuple(replace(a, kd=3.0 * a.kd) for a in world.actuators))


def lighter(world: World) -> World:
    """A last link with half its mass."""
    *bodies, last = world.bodies
    part = last.inertial
    half = part._replace(mass=part.mass / 2, inertia=tuple(v / 2 for v in part.inertia))
    return replace(world, bodies=(*bodies, replace(last, inertial=half)))

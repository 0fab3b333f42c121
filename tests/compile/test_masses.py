"""Masses of what moves: a floating base must have one, its inertia is repaired, and engines build nothing without."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from anysim.compile.world import compile_with_report
from anysim.engine.factory import create_simulation, runnable
from anysim.errors import CapabilityError, EngineError, SpecError
from anysim.model.world import (
    Body,
    BodyKind,
    Entity,
    EntityKind,
    Geom,
    Inertial,
    Joint,
    JointType,
    Physics,
    Sphere,
    World,
)
from anysim.testing.audit import audit
from anysim_schemas.run import WorldSpec

ENTRY = "name: made\ndescription: it\nsource: made.urdf\nlicense: MIT\nlicense_source: me\ncategory: arm\n"
SOLID = Inertial(1.0, inertia=(0.01, 0.01, 0.01, 0.0, 0.0, 0.0))


def spec(folder: Path, base: str, root: str, inertial: Callable[[float], str]) -> WorldSpec:
    """A robot of two links on such a base; `root` is the inertial of its root."""
    joint = '<joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint>'
    links = f'<link name="a">{root}</link><link name="b">{inertial(1)}</link>'
    (folder / "made.urdf").write_text(f'<robot name="made">{links}{joint}</robot>')
    rails = "channels: {base: {joints: [base_x, base_y, base_yaw], gains: {kp: 9, kd: 1, effort_limit: 9}}}\n"
    rest = f"vehicle: {{kind: planar}}\n{rails}" if base == "planar" else "channels: {}\n"
    (folder / "made.yaml").write_text(f"{ENTRY}base: {base}\n{rest}")
    return WorldSpec.model_validate({"robots": {"r": {"robot": str(folder / "made.yaml")}}})


@pytest.mark.parametrize("base", ["floating", "planar"])
def test_a_base_that_moves_has_a_mass(tmp_path: Path, inertial: Callable[[float], str], base: str) -> None:
    """PyBullet would let it hang in the air."""
    with pytest.raises(SpecError, match="the link 'a' moves and has no mass; add one to the robot's source"):
        compile_with_report(spec(tmp_path, base, "", inertial))
    assert compile_with_report(spec(tmp_path, "fixed", "", inertial)).world.bodies[0].inertial.mass == 0


@pytest.mark.parametrize("base", ["floating", "planar"])
@pytest.mark.parametrize(
    ("moments", "words"),
    [
        ('ixx="0" iyy="0" izz="0"', "has a mass of 5 kg and no inertia"),
        ('ixx="1e-18" iyy="1e-18" izz="1e-18"', "kg m^2, which is none"),
        ('ixx="1" iyy="1" izz="9"', "has an inertia that no body can have"),
    ],
)
def test_the_inertia_of_a_base_that_moves_is_repaired(
    tmp_path: Path, inertial: Callable[[float], str], base: str, moments: str, words: str
) -> None:
    root = f'<inertial><mass value="5"/><inertia {moments} ixy="0" ixz="0" iyz="0"/></inertial>'
    compiled = compile_with_report(spec(tmp_path, base, root, inertial))
    body = next(body for body in compiled.world.bodies if body.name == "r.a")
    assert min(body.inertial.inertia[:3]) > 1e-5
    assert words in "\n".join(map(str, compiled.report["r"]))


def chain(joints: int, spheres: int = 0, *, last: Inertial = SOLID, free: bool = False, far: float = 1.0) -> World:
    """A pendulum of many links, each with some shapes."""
    bodies = [Body("it", BodyKind.FREE if free else BodyKind.STATIC, inertial=last if free else SOLID)]
    bodies += [Body(f"it.{i}", BodyKind.LINK, i, (0.05, 0.0, 0.0), inertial=SOLID) for i in range(joints)]
    if not free:
        bodies[-1] = replace(bodies[-1], inertial=last)
    made = [
        Joint(f"it.{i}", i + 1, JointType.REVOLUTE, (0.0, 1.0, 0.0), lower=-far, upper=far, friction=0.25)
        for i in range(joints)
    ]
    geoms = [
        Geom(f"it.{i}{chr(39) * k}", i + 1, Sphere(0.001), (0.0, 0.0, 0.1 * k))
        for i in range(joints)
        for k in range(spheres)
    ]
    entity = Entity("it", EntityKind.OBJECT, 0, joints + 1, 0, joints)
    return World("w", Physics(), tuple(bodies), tuple(made), tuple(geoms), entities=(entity,))


@pytest.mark.parametrize("engine", runnable())
@pytest.mark.parametrize("free", [True, False])
@pytest.mark.parametrize("own", [Inertial(0.0), Inertial(1.0), Inertial(1.0, inertia=(0.1, 0.1, 0.0, 0.0, 0.0, 0.0))])
def test_no_engine_builds_what_moves_without_mass(engine: str, own: Inertial, free: bool) -> None:
    with create_simulation(engine) as simulation:
        with pytest.raises(EngineError, match=r"moves and has no (mass|inertia about each axis); give it some"):
            simulation.create_world(chain(2, last=own, free=free))


@pytest.mark.parametrize("engine", runnable())
@pytest.mark.parametrize(("joints", "spheres"), [(128, 0), (64, 2), (300, 0)])
def test_many_joints_run_or_are_refused_in_a_sentence(engine: str, joints: int, spheres: int) -> None:
    """Bullet tells the states of 127 links, PhysX has 254 joints at most."""
    most = {"pybullet": 127, "sapien": 254}.get(engine, 1000)
    world = chain(joints, spheres)
    with create_simulation(engine) as simulation:
        if joints + joints * max(0, spheres - 1) > most:
            with pytest.raises(CapabilityError, match=f"'it' has {joints} joints.*, {most} at most"):
                simulation.create_world(world)
        else:
            simulation.create_world(world)
            simulation.step(2)
            assert simulation.get_state().joint_pos.shape == (1, joints)


@pytest.mark.parametrize("engine", runnable())
def test_limits_that_are_far_out_pass_the_audit(engine: str) -> None:
    with create_simulation(engine) as simulation:
        simulation.create_world(chain(2, far=1e16))
        assert [line for line in audit(simulation) if line.ok is False] == []


@pytest.mark.parametrize("engine", runnable())
def test_the_audit_keeps_a_joint_and_a_geom_of_one_name_apart(engine: str) -> None:
    """Both have friction: 0.25 N m the one, a coefficient of 0.8 the other."""
    with create_simulation(engine) as simulation:
        simulation.create_world(chain(1, 1))
        rows = {(line.subject, line.quantity): line for line in audit(simulation)}
        assert rows["it.0", "dry friction"].expected == (0.25,)
        assert rows["it.0", "friction"].expected == (0.8,)
        assert [line for line in rows.values() if line.ok is False] == []

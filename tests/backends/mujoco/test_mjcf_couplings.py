"""Tendons and equalities of MJCF files, against MuJoCo on the same files."""

from collections.abc import Callable
from dataclasses import replace
from math import inf
from pathlib import Path

import mujoco
import numpy as np
import pytest

from anysim import load as load_run
from anysim.api import compile_world
from anysim.assets.load import import_asset
from anysim.assets.model import ImportedModel
from anysim.engine.factory import create_simulation
from anysim.errors import AssetError, CapabilityError
from anysim.model.world import ConstraintKind, ControlMode, World

ARMS = """<mujoco><option gravity="0 0 0" timestep="0.002" integrator="implicitfast"/><worldbody><body name="base">
  <geom size="0.05"/>
  <body name="a" pos="0.3 0 0" euler="0 0 20"><joint name="x" axis="0 1 0" ref="{ref}"/><geom name="arm" type="capsule"
    size="0.02" fromto="0 0 0 0 0 -0.4"/><site name="tip" pos="0 0 -0.4"/>
    <body name="b" pos="0 0 -0.4"><joint name="y" axis="0 1 0"/><geom type="capsule" size="0.02"
      fromto="0 0 0 0 0 -0.3"/><site name="end" pos="0 0 -0.3" euler="10 0 0"/></body></body>
  <body name="c" pos="-0.3 0 0"><joint name="z" type="slide" axis="1 0 0"/><geom size="0.06"/></body></body></worldbody>
  {rest}</mujoco>"""
FIRM = 'solref="0.004 1" solimp="0.99 0.999 0.001"'
CORD = '<joint joint="x" coef="0.5"/><joint joint="y" coef="-1"/><joint joint="z" coef="2"/>'


@pytest.fixture
def load(tmp_path: Path) -> Callable[..., ImportedModel]:
    def read(rest: str, ref: str = "0") -> ImportedModel:
        (tmp_path / "arms.xml").write_text(ARMS.format(rest=rest, ref=ref), encoding="utf-8")
        return import_asset(f"file:{tmp_path / 'arms.xml'}")

    return read


def apart(folder: Path, velocity: tuple[float, float, float] = (1.0, -2.0, 0.5)) -> float:
    """The largest difference of a joint from MuJoCo's own reading of the file in 100 steps, contacts left out."""
    path = folder / "arms.xml"
    raw = mujoco.MjModel.from_xml_path(str(path))
    raw.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    data = mujoco.MjData(raw)
    world = compile_world(load_run({"world": {"objects": {"o": {"source": {"asset": f"file:{path}"}, "fixed": True}}}}))
    world = replace(world, physics=replace(world.physics, dt=0.002, gravity=(0.0, 0.0, 0.0)), geoms=())
    engine = create_simulation("mujoco").create_world(world)
    worst = 0.0
    try:
        data.qvel[:] = velocity
        data.qpos[:] = raw.qpos0
        engine.set_joint_state([float(q) for q in raw.qpos0], list(velocity))
        for _ in range(100):
            mujoco.mj_step(raw, data)
            engine.step()
            worst = max(worst, float(np.abs(engine.get_state().joint_pos[0] - data.qpos).max()))
        assert np.abs(data.qpos - raw.qpos0).max() > 0.01
    finally:
        engine.destroy()
    return worst


def test_a_fixed_tendon_is_that_of_the_file(load: Callable[..., ImportedModel], tmp_path: Path) -> None:
    (tendon,) = load(
        f'<tendon><fixed name="cord" stiffness="20" damping="0.5" springlength="0.1 0.3" armature="0.1">{CORD}'
        "</fixed></tendon>"
    ).tendons
    assert (tendon.joints, tendon.coefficients, tendon.rest) == ((0, 1, 2), (0.5, -1.0, 2.0), (0.1, 0.3))
    assert (tendon.stiffness, tendon.damping, tendon.lower, tendon.upper) == (20.0, 0.5, -inf, inf)
    assert apart(tmp_path) < 1e-12


def test_a_limit_and_a_held_length_are_those_of_the_file(load: Callable[..., ImportedModel], tmp_path: Path) -> None:
    """With MuJoCo's stiffest settings in the file, which are what limits have here."""
    firm = FIRM.replace("solref", "solreflimit").replace("solimp", "solimplimit")
    model = load(f'<tendon><fixed name="cord" range="-0.1 0.05" {firm}>{CORD}</fixed></tendon>')
    assert (model.tendons[0].lower, model.tendons[0].upper) == (-0.1, 0.05)
    assert apart(tmp_path) < 1e-6
    tie = f'<equality><tendon tendon1="cord" polycoef="0.2 0 0 0 0" {FIRM}/></equality>'
    model = load(f'<tendon><fixed name="cord">{CORD}</fixed></tendon>{tie}', ref="30")
    length = 0.5 * np.deg2rad(30) + 0.2
    assert (model.tendons[0].lower, model.tendons[0].upper) == (pytest.approx(length), pytest.approx(length))
    assert apart(tmp_path) < 1e-6


def test_a_held_tendon_of_two_joints_makes_one_follow(load: Callable[..., ImportedModel], tmp_path: Path) -> None:
    two = '<joint joint="x" coef="-0.5"/><joint joint="y" coef="0.25"/>'
    tie = f'<equality><tendon tendon1="cord" polycoef="0.1 0 0 0 0" {FIRM}/></equality>'
    model = load(f'<tendon><fixed name="cord">{two}</fixed></tendon>{tie}')
    assert not model.tendons
    assert model.joints[1].mimic == (0, 2.0, pytest.approx(0.4), ())


def test_a_polynomial_is_a_curve_about_the_files_zero(load: Callable[..., ImportedModel], tmp_path: Path) -> None:
    model = load(f'<equality><joint joint1="y" joint2="x" polycoef="0 0.5 0.8 -0.3 0" {FIRM}/></equality>', ref="20")
    mimic, start = model.joints[1].mimic, np.deg2rad(20)
    assert mimic is not None
    for place in (start, 0.1, -0.4):
        away = place - start
        assert mimic.position(place) == pytest.approx(0.5 * away + 0.8 * away**2 - 0.3 * away**3)
    assert apart(tmp_path, (1.0, 0.5, 0.5)) < 1e-6


@pytest.mark.parametrize(
    "tie",
    [
        '<connect body1="b" body2="base" anchor="0 0 -0.3"',
        '<connect site1="end" site2="tip"',
        '<weld body1="b" body2="a" anchor="0.1 0 0.2"',
        '<weld site1="end" site2="tip"',
    ],
)
def test_what_is_held_is_held_as_in_mujoco(load: Callable[..., ImportedModel], tmp_path: Path, tie: str) -> None:
    model = load(f"<equality>{tie} {FIRM}/></equality>")
    (held,) = model.constraints
    assert held.kind is (ConstraintKind.CONNECT if "connect" in tie else ConstraintKind.WELD)
    assert apart(tmp_path) < 1e-6


def test_the_world_holds_only_what_stands_in_it(load: Callable[..., ImportedModel], tmp_path: Path) -> None:
    """A fixed model is held by its base; where one floats the file cannot know where the world has it."""
    model = load('<equality><connect body1="b" anchor="0 0 -0.3"/></equality>')
    assert (model.constraints[0].body, model.constraints[0].other) == (2, 0)
    floating = ARMS.replace('<body name="base">', '<body name="base"><freejoint/>')
    tie = '<equality><connect body1="b" anchor="0 0 -0.3"/></equality>'
    (tmp_path / "arms.xml").write_text(floating.format(rest=tie, ref="0"), encoding="utf-8")
    with pytest.raises(AssetError, match=r"is a connect to the world, and the model floats"):
        import_asset(f"file:{tmp_path / 'arms.xml'}")


def test_drives_of_tendons(load: Callable[..., ImportedModel]) -> None:
    """The joint that no drive has alone names the drive; coefficients and gears enter squared."""
    model = load(
        f'<tendon><fixed name="cord">{CORD}</fixed></tendon>'
        '<actuator><position name="p" tendon="cord" kp="4" gear="3"/>'
        '<motor name="m" joint="x" gear="7" ctrlrange="-1 1"/><motor name="n" tendon="cord"/></actuator>'
    )
    motor, position, other = model.actuator_hints
    assert (motor.joint, motor.mode, motor.effort_limit, motor.shares) == (0, ControlMode.EFFORT, 7.0, ())
    assert (position.joint, position.kp, position.shares) == (1, 36.0, ((0, -0.5), (2, -2.0)))
    assert (other.joint, other.shares) == (2, ((0, 0.25), (1, -0.5)))


@pytest.mark.parametrize("name", ["pybullet", "sapien"])
def test_other_engines_refuse_by_name_what_they_cannot(
    load: Callable[..., ImportedModel], tmp_path: Path, name: str
) -> None:
    pytest.importorskip(name)
    load(f'<tendon><fixed name="cord" range="-1 1">{CORD}</fixed></tendon>')
    source = {"asset": f"file:{tmp_path / 'arms.xml'}"}
    world: World = compile_world(load_run({"world": {"objects": {"o": {"source": source, "fixed": True}}}}))
    with pytest.raises(CapabilityError, match=r"tendon 'o.cord' is limited \(fixed tendons: limits"):
        create_simulation(name).create_world(world)

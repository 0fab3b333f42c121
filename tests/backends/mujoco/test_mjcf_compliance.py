"""Solver settings and strings of MJCF files: in the model, in MuJoCo as in the file, and approximated elsewhere."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from anysim import load
from anysim.api import compile_world
from anysim.engine.capability import Capability as C
from anysim.engine.requirements import needs_of
from anysim.model.world import Compliance, World
from anysim_mujoco.build import build
from anysim_mujoco.mjcf.load import import_mjcf
from anysim_mujoco.options import MujocoOptions

FILE = """<mujoco><option timestep="0.001"/><worldbody><body name="base"><geom name="slab" type="box" size="0.1 0.1 0.1"
  condim="1" solref="0.015 0.7" solimp="0.8 0.9 0.02 0.4 3" margin="0.01" gap="0.002" solmix="3"/>
 <geom name="slick" type="sphere" size="0.1" pos="0 1 0" condim="6" solref="-500 -20"/>
 <geom name="drum" type="cylinder" size="0.05 0.1" pos="0.3 0 0.1" euler="90 0 0" contype="0" conaffinity="0"/>
 <site name="side" pos="0.3 0 0.5"/><site name="eye" pos="0 0 0.1"/>
 <body name="arm" pos="0 0 0.3"><joint name="turn" axis="0 1 0" range="-60 60" solreflimit="0.01 0.5"
   solimplimit="0.7 0.8 0.02" margin="0.02" frictionloss="0.3" solreffriction="0.03 2" solimpfriction="0.5 0.6 0.01"/>
  <geom name="rod" size="0.05" fromto="0 0 0 0.6 0 0" type="capsule"/><site name="tip" pos="0.6 0 0"/>
  <body name="toe" pos="0.6 0 0"><geom name="ball" size="0.08"/></body>
  <body name="hand" pos="0.6 0 0.2"><joint name="slip" type="slide" axis="1 0 0"/><geom name="fist" size="0.05"/></body>
 </body></body></worldbody>
<equality><weld body1="hand" body2="base" solref="0.01 0.5" solimp="0.5 0.6 0.01" torquescale="0.3"/>
 <joint joint1="slip" joint2="turn" solref="0.02 0.6" solimp="0.6 0.7 0.01"/></equality>
<tendon><spatial name="cord" stiffness="50" damping="2" springlength="0.1 0.4" limited="true" range="0 0.9"
  solreflimit="0.02 0.4" solimplimit="0.6 0.7 0.02" margin="0.03" frictionloss="0.2">
 <site site="eye"/><geom geom="drum" sidesite="side"/><site site="tip"/><pulley divisor="2"/><site site="tip"/>
 <site site="side"/></spatial></tendon></mujoco>"""
GEOMS = "condim friction solref solimp margin gap solmix priority".split()
TENDONS = "length0 lengthspring range stiffness damping frictionloss armature solref_lim solimp_lim margin".split()


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("compliance") / "arm.xml"
    path.write_text(FILE)
    return path


@pytest.fixture(scope="module")
def world(file: Path) -> World:
    found = compile_world(load({"world": {"objects": {"it": {"source": {"asset": f"file:{file}"}, "fixed": True}}}}))
    return replace(found, physics=replace(found.physics, dt=0.001))


def ours(world: World, **given: Any) -> Any:
    return build(world, MujocoOptions(**given)).model


def test_the_model_has_what_the_file_sets(file: Path) -> None:
    model = import_mjcf(file, root=file.parent)
    slab, slick = model.geoms[:2]
    assert slab.surface.compliance == Compliance((0.015, 0.7), (0.8, 0.9, 0.02, 0.4, 3.0), 0.01, 0.002, 3.0, 1)
    assert slick.surface.compliance == Compliance((-500.0, -20.0), dimensions=6)
    assert model.joints[0].limit_compliance == Compliance((0.01, 0.5), (0.7, 0.8, 0.02, 0.5, 2.0), 0.02)
    assert model.joints[0].friction_compliance == Compliance((0.03, 2.0), (0.5, 0.6, 0.01, 0.5, 2.0))
    assert model.joints[1].mimic_compliance == Compliance((0.02, 0.6), (0.6, 0.7, 0.01, 0.5, 2.0))
    assert model.constraints[0].compliance == Compliance((0.01, 0.5), (0.5, 0.6, 0.01, 0.5, 2.0))
    assert model.constraints[0].turn_scale == 0.3
    (cord,) = model.spatial_tendons
    assert [point.body for point in cord.path if not point.pulley] == [0, 0, 1, 1, 0]
    assert cord.bodies == (0, 1)
    assert model.geoms[3].part_com is not None, "the toe is a part of the arm with a weight of its own"


def test_lengths_scale(file: Path) -> None:
    small = import_mjcf(file, root=file.parent, scale=0.5)
    given = small.geoms[0].surface.compliance
    assert given is not None
    assert (given.margin, given.gap) == (0.005, 0.001)
    assert given.impedance == (0.8, 0.9, 0.01, 0.4, 3.0)
    (cord,) = small.spatial_tendons
    assert (cord.upper, cord.rest) == (0.45, (0.05, 0.2))
    turn = small.joints[0].limit_compliance
    assert turn is not None
    assert turn.margin == 0.02


@pytest.mark.parametrize("constraints", ["stiff", "mujoco"])
def test_mujoco_has_what_the_file_has(file: Path, world: World, constraints: str) -> None:
    """Field by field, whatever is set for what files say nothing of."""
    raw, own = mujoco.MjModel.from_xml_path(str(file)), ours(world, constraints=constraints)
    for name in ("slab", "slick", "rod", "ball"):
        for field in GEOMS:
            a, b = (getattr(m, f"geom_{field}")[m.geom(n).id] for m, n in ((own, f"it.{name}"), (raw, name)))
            np.testing.assert_allclose(a, b, rtol=1e-12, err_msg=f"{name} {field}")
    a, b = own.joint("it.turn").id, raw.joint("turn").id
    for field in ("jnt_solref", "jnt_solimp", "jnt_margin", "dof_solref", "dof_solimp"):
        np.testing.assert_allclose(getattr(own, field)[a], getattr(raw, field)[b], err_msg=field)
    np.testing.assert_allclose(sorted(own.eq_solref.tolist()), sorted(raw.eq_solref.tolist()))
    np.testing.assert_allclose(sorted(own.eq_solimp.tolist()), sorted(raw.eq_solimp.tolist()))
    welds = [m.eq_data[m.eq_type == int(mujoco.mjtEq.mjEQ_WELD), 10].tolist() for m in (own, raw)]
    assert welds == [[0.3], [0.3]]
    for field in TENDONS:
        np.testing.assert_allclose(
            getattr(own, f"tendon_{field}")[0], getattr(raw, f"tendon_{field}")[0], err_msg=field
        )


def test_what_a_file_leaves_open_is_stiff_or_mujocos_own(world: World) -> None:
    assert ours(world).jnt_solref[1].tolist() == [0.004, 1.0]
    assert ours(world, constraints="mujoco").jnt_solref[1].tolist() == [0.02, 1.0]


def test_each_part_of_a_lumped_body_is_weighed_by_itself(file: Path, world: World) -> None:
    """MuJoCo estimates the mass that a contact feels by the body of its geom: as in the file, where it is asked to."""
    raw, own = mujoco.MjModel.from_xml_path(str(file)), ours(world, constraints="mujoco")
    weights = [m.body_invweight0[m.geom_bodyid[m.geom(n).id], 0] for m, n in ((own, "it.ball"), (raw, "ball"))]
    assert weights[0] == pytest.approx(weights[1], rel=1e-6)
    stiff = ours(world)
    assert stiff.body_invweight0[stiff.geom_bodyid[stiff.geom("it.ball").id], 0] != pytest.approx(weights[1], rel=1e-2)
    assert own.body_mass.sum() == pytest.approx(stiff.body_mass.sum(), rel=1e-12)


def test_a_world_needs_an_engine_that_has_them(world: World) -> None:
    why = {need.capability: need.why for need in needs_of(world)}
    assert why[C.SPATIAL_TENDONS] == "tendon 'it.cord' runs through space"
    assert why[C.COMPLIANCE] == "joint 'it.turn' gives way as its file says"


def test_a_string_to_the_world_of_a_model_that_stands_above_it(tmp_path: Path) -> None:
    """A model that is fixed where its file has it keeps its string to the file's world, wherever it is put."""
    path = tmp_path / "stand.xml"
    path.write_text("""<mujoco><worldbody><site name="hook" pos="0 0 2"/><body name="post" pos="0 0 1">
    <geom size="0.1"/><body pos="0 0 0.5"><joint name="swing" axis="0 1 0"/><geom size="0.1"/>
    <site name="tip"/></body></body></worldbody>
    <tendon><spatial stiffness="1"><site site="hook"/><site site="tip"/></spatial></tendon></mujoco>""")
    (cord,) = import_mjcf(path, root=tmp_path).spatial_tendons
    assert [(point.body, point.position) for point in cord.path] == [(0, (0.0, 0.0, 1.0)), (1, (0.0, 0.0, 0.0))]

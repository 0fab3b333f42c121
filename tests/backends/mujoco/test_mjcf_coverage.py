"""Every attribute of MJCF that the table of the importer reads is in the model: another value is another model."""

from pathlib import Path
from xml.etree import ElementTree

import pytest

from anysim.assets.model import Fate
from anysim.errors import AssetError
from anysim_mujoco.mjcf import coverage
from anysim_mujoco.mjcf.load import import_mjcf

WHOLE = """<mujoco><compiler angle="radian"/><asset>
<mesh name="wedge" vertex="0 0 0 1 0 0 0 1 0 0 0 1" face="0 2 1 0 1 3 1 2 3 0 3 2" scale="1 1 1" refpos="0 0 0"
    refquat="1 0 0 0"
  inertia="convex"/>
<mesh name="block" vertex="0 0 0 2 0 0 0 2 0 0 0 2"/>
<hfield name="hill" nrow="2" ncol="2" size="1 1 1 0.1" elevation="0 0.5 1 0"/>
<hfield name="dale" nrow="2" ncol="2" size="2 1 1 0.1" elevation="0 0.5 1 0"/>
<material name="red" rgba="1 0 0 1"/><material name="blue" rgba="0 0 1 1"/></asset><worldbody>
<body name="base" pos="0 0 1"><geom name="trunk" type="box" size="0.1 0.1 0.1" pos="0 0 0.1" quat="1 0 0 0"
    friction="1 0.005 0.0001"
  density="1000" material="red" condim="3" contype="1" conaffinity="1" priority="0" solref="0.03 1"
    solimp="0.9 0.95 0.001" margin="0.01" gap="0.02" solmix="2"/>
  <geom name="tool" type="mesh" mesh="wedge" mass="1" rgba="1 0 0 1" pos="3 0 0"/><geom type="hfield"
    hfield="hill" pos="0 5 0"/>
  <geom name="rod" type="capsule" fromto="0 0 0 0 0 1" size="0.1" shellinertia="false" axisangle="0 0 1 0"/>
  <geom name="fit" type="box" mesh="wedge" fitscale="1" euler="0 0 0.1"/>
  <body name="arm" pos="0 0 0.5" quat="1 0 0 0" gravcomp="0"><inertial pos="0 0 0.1" quat="1 0 0 0" mass="1"
    diaginertia="0.1 0.2 0.25"/>
    <joint name="turn" type="hinge" pos="0 0 0.1" axis="0 0 1" range="-1 1" limited="true" armature="0.1"
    damping="1" frictionloss="0.1"
      ref="0.1" springref="0.2" stiffness="2" actuatorfrclimited="true" actuatorfrcrange="-5 5" solreflimit="0.03 1"
    solimplimit="0.8 0.9 0.01" margin="0.01" solreffriction="0.03 1" solimpfriction="0.8 0.9 0.01"/>
    <geom name="fist" size="0.1"/>
    <site name="tip" pos="0 0 0.1" quat="1 0 0 0"/><site name="far" pos="1 1 0"/><site name="line"
    type="capsule" size="0.1"
    fromto="0 0 0 0 0 1"/>
    <body name="hand" pos="0 1 0" euler="0 0 0.1"><inertial pos="0 0 0" mass="1" fullinertia="0.1 0.2 0.25 0 0 0"/>
      <joint name="grip" springdamper="0.1 1" range="-2 2"/><geom name="nail" size="0.1"
    pos="0 0 1"/></body></body></body></worldbody>
<equality><weld body1="hand" body2="base" anchor="0 0 0.1" relpose="0 0 0 1 0 0 0" solref="0.03 1"
    solimp="0.8 0.9 0.01" torquescale="2"/>
  <joint name="tie" joint1="grip" joint2="turn" polycoef="0 1 0 0 0" active="true"/></equality>
<tendon><fixed name="cord" stiffness="4" damping="1" springlength="0.1 0.2" range="-1 1"
  limited="true" frictionloss="0.1" armature="0.1"
  solreflimit="0.03 1" solimplimit="0.8 0.9 0.01" margin="0.01" solreffriction="0.03 1"
    solimpfriction="0.8 0.9 0.01"><joint joint="turn" coef="0.5"/><joint joint="grip" coef="2"/></fixed>
  <spatial stiffness="1" damping="1"><site site="tip"/><geom geom="nail" sidesite="line"/><site site="line"/>
    <pulley divisor="2"/>
    <site site="tip"/><site site="line"/></spatial></tendon>
<actuator><position name="p" joint="turn" kp="50" kv="5" gear="1" forcelimited="true" forcerange="-9 9"/>
  <general name="g" joint="grip" gaintype="fixed" gainprm="5" biastype="affine" biasprm="0 -5 -1" dyntype="none"
    ctrllimited="true"
  ctrlrange="-2 2"/></actuator>
<keyframe><key name="home" qpos="0.2 0.2"/></keyframe></mujoco>"""
"""A model with the attributes that the table reads."""
VALUES = {
    key.strip(): value.strip()
    for pair in """
type: slide; inertia: shell; material: blue; mesh: block; hfield: dale; quat: 1 1 0 0; refquat: 1 1 0 0;
axisangle: 0 1 1 1; euler: 1 1 0.1; contype: 0; conaffinity: 2; condim: 4; priority: 2; limited: false;
actuatorfrclimited: false; forcelimited: false; ctrllimited: false; active: false; gravcomp: 1; joint1: turn;
joint2: grip; joint: hand; gaintype: affine; biastype: none; dyntype: integrator; shellinertia: true; axis: 0 1 0;
pos: 0.1 0.2 0.3; refpos: 0.1 0.2 0.3; fromto: 0 0 0 0 1 1; stiffness: 3; polycoef: 0.1 2 0 0 0; ref: 0.3;
nrow: 4; ncol: 1; elevation: 1 0 0 0.5; angle: degree; solreflimit: 0.06 1; solref: 0.06 1;
site: far; sidesite: far; geom: fist; body1: arm; body2: arm; relpose: 0 0 0 0 1 0 0""".split(";")
    for key, value in [pair.split(":")]
}
"""Other values than those of the model; numbers are scaled where there is none."""
ALIKE = {("geom", "conaffinity"), ("mesh", "face"), ("site", "type")}
"""What has no effect on this model: masks that let no other pair pass, faces of a hull, looks of a frame."""


def model_of(root: ElementTree.Element, folder: Path) -> str:
    (folder / "model.xml").write_bytes(ElementTree.tostring(root))
    try:
        model = import_mjcf(folder / "model.xml", root=folder)
    except AssetError as error:
        return str(error)
    fields = [(field.name, field.size, field.heights.tolist()) for field in model.heightfields]
    geoms = [(geom, None) for geom in model.geoms]
    meshes = [(mesh.name.rpartition("_")[0], mesh.vertices.tolist()) for mesh in model.meshes]
    held = (model.tendons, model.spatial_tendons, model.constraints, model.actuator_hints, model.excluded_pairs)
    parts = (model.bodies, model.joints, geoms, model.sites, meshes, fields, held)
    return repr((*parts, [str(note) for note in model.report]))


ATTRIBUTES = [
    (node.tag, key)
    for node in ElementTree.fromstring(WHOLE).iter()
    for key in node.attrib
    if key not in ("name", "vertex")
]


@pytest.mark.parametrize(("tag", "key"), sorted(set(ATTRIBUTES) - ALIKE))
def test_what_the_table_reads_is_in_the_model(
    tag: str, key: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each attribute gets another value wherever it stands: the model, its report or an error tells of it."""
    monkeypatch.setenv("ANYSIM_CACHE_DIR", str(tmp_path / "cache"))
    root = ElementTree.fromstring(WHOLE)
    before = model_of(root, tmp_path)
    for node in root.iter(tag):
        if (old := node.get(key)) is not None:
            other = VALUES[key] if key in VALUES else " ".join(f"{float(word) * 0.7:g}" for word in old.split())
            if tag == "geom" and key == "type":
                other = "sphere"
            elif tag == "site" and key == "type":
                continue
            node.set(key, other)
    assert model_of(root, tmp_path) != before


def test_the_model_has_what_the_table_reads() -> None:
    """All but what stands in for another, as `zaxis` does for `quat`."""
    given = {key for _, key in ATTRIBUTES} | {"xyaxes", "zaxis", "builtin", "params", "vertex"}
    elsewhere = set(
        "actdim actlimited actrange body class content_type cranksite dampratio dynprm file inertial input "
        "jointinparent mpos mquat name normal tendon texcoord timeconst velrange".split()
    )
    rows = [row for row in coverage.rows() if row[2] in (Fate.EXACT, Fate.APPROXIMATED)]
    missing = {name.rpartition("/")[2] for _, names, *_ in rows for name in names.split()} - given - elsewhere
    assert missing == set()

"""Notes of a URDF import: what a file says is read or noted; where they are told."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from typer import Typer
from typer.testing import CliRunner

from anysim import load
from anysim.api import compile_world
from anysim.assets.model import Fate, ImportedModel
from anysim.compile.edit import without_entity
from anysim.errors import AssetError
from anysim_recording.collector import run_header
from anysim_urdf import coverage
from anysim_urdf.coverage import ROWS

Load = Callable[..., ImportedModel]

GAZEBO = '<gazebo reference="b"><mu1>0.2</mu1></gazebo>'


def words(model: ImportedModel) -> list[str]:
    return [str(note) for note in model.report]


@pytest.fixture
def pair(urdf: Load, inertial: Callable[[float], str]) -> Load:
    """A robot of two links, with more in the link, the joint and the robot."""

    def read(link: str = "", joint: str = "", robot: str = "", limit: str = "") -> ImportedModel:
        joints = (
            '<joint name="j" type="revolute"><parent link="a"/><child link="b"/>'
            f'<limit lower="-1" upper="1" effort="1" velocity="1" {limit}/>{joint}</joint>'
        )
        return urdf(f'<link name="a">{inertial(1)}</link><link name="b">{inertial(1)}{link}</link>{joints}{robot}')

    return read


def test_a_plain_file_has_no_notes(pair: Load) -> None:
    shape = '<{0} name="s"><origin xyz="0 0 1"/><geometry><sphere radius="1"/></geometry><material name="m"/></{0}>'
    robot = '<material name="m"><color rgba="1 0 0 1"/></material><material name="n"/>'
    assert words(pair(shape.format("visual") + shape.format("collision") * 2, '<dynamics damping="1"/>', robot)) == []


def test_springs_of_gazebo_are_the_joint_s(pair: Load) -> None:
    spring = "<springStiffness>5</springStiffness><springReference>0.2</springReference>"
    model = pair(robot=f'<gazebo reference="j">{spring}</gazebo>')
    assert (model.joints[0].stiffness, model.joints[0].spring_rest) == (5.0, 0.2)
    assert words(model) == []
    other = pair(robot=f'<gazebo reference="b">{spring}</gazebo><gazebo reference="j">{spring}<mu1>1</mu1></gazebo>')
    assert other.joints[0].stiffness == 5.0
    (note,) = words(other)
    assert note.startswith("<gazebo>: is left out: what it says of friction")
    assert "(2: robot)" in note


def test_a_spring_that_is_no_number_is_refused(pair: Load) -> None:
    with pytest.raises(AssetError, match="<springStiffness> holds 'stiff': expected a finite number"):
        pair(robot='<gazebo reference="j"><springStiffness>stiff</springStiffness></gazebo>')


@pytest.mark.parametrize(
    ("part", "text", "note"),
    [
        ("link", '<contact><lateral_friction value="1"/></contact>', "<contact>: is left out: PyBullet's surfaces"),
        (
            "robot",
            GAZEBO * 2,
            "<gazebo>: is left out: what it says of friction, sensors and plugins is Gazebo's alone (2",
        ),
        ("robot", '<transmission name="t"/>', "<transmission>: is left out: gears and drives are those of the"),
        ("robot", '<material name="m"><texture filename="a.png"/></material>', "<texture>: is left out: surfaces have"),
        ("joint", '<safety_controller k_velocity="1"/>', "<safety_controller>: is left out: limits are those of"),
        ("joint", '<calibration rising="0"/>', "<calibration>: is left out: it is of the real robot's encoders (1: jo"),
        ("limit", 'jerk="3"', "<limit jerk>: is left out: a planner's limits are its own (1: joint 'j')"),
        ("link", '<inertial><mass value="9"/></inertial>', "<inertial>: of several in one <link> the first is read (1"),
        ("joint", '<axis xyz="1 0 0"/><axis xyz="0 1 0"/>', "<axis>: of several in one <joint> the first is read"),
    ],
)
def test_what_is_left_out_is_named(pair: Load, part: str, text: str, note: str) -> None:
    found = words(pair(**{part: text}))
    assert any(one.startswith(note) for one in found), found


@pytest.mark.parametrize("row", [row for row in ROWS if row.fate is Fate.LEFT_OUT])
def test_what_the_table_leaves_out_is_noted(row: coverage.Row) -> None:
    """Each element where it may stand, with its attributes."""
    from lxml import etree

    from anysim_urdf.unheld import notes_of

    inner = ""
    for depth, tag in enumerate(reversed(row.path.split("/")[1:])):
        given = "" if depth else "".join(f' {key}="0.5"' for key in row.attributes.split())
        inner = f"<{tag}{given}>{inner}</{tag}>"
    found = {note.where: note.message for note in notes_of(etree.fromstring(f"<robot>{inner}</robot>"))}
    tag = row.path.rpartition("/")[2]
    for where in [f"<{tag} {key}>" for key in row.attributes.split()] or [f"<{tag}>"]:
        assert row.text in found[where]


WHOLE = """<robot name="r"><material name="red"><color rgba="1 0 0 1"/></material>
<link name="a"><inertial><origin xyz="0 0 0.1" rpy="0.1 0 0"/><mass value="1"/>
  <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0.01" ixz="0.01" iyz="0.01"/></inertial>
  <visual name="v"><origin xyz="1 0 0" rpy="0 0.1 0"/><geometry><box size="1 1 1"/></geometry>
    <material name="red"/></visual>
  <visual><geometry><cylinder radius="1" length="2"/></geometry>
    <material name="own"><color rgba="0 1 0 1"/></material></visual>
  <visual><geometry><sphere radius="1"/></geometry></visual>
  <visual><geometry><capsule radius="1" length="2"/></geometry></visual>
  <visual><geometry><mesh filename="thing.obj" scale="1 1 1"/></geometry></visual>
  <collision name="c"><origin xyz="1 0 0" rpy="0 0.1 0"/><geometry><box size="1 1 1"/></geometry></collision>
  <collision><geometry><cylinder radius="1" length="2"/></geometry></collision>
  <collision><geometry><sphere radius="1"/></geometry></collision>
  <collision><geometry><capsule radius="1" length="2"/></geometry></collision>
  <collision><geometry><mesh filename="thing.obj" scale="1 1 1"/></geometry></collision></link>
<link name="b"><inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1"/></inertial></link>
<link name="c"><inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1"/></inertial></link>
<joint name="j" type="revolute"><origin xyz="0 0 1" rpy="0.1 0 0"/><parent link="a"/><child link="b"/>
  <axis xyz="0 0 1"/>
  <limit lower="-1" upper="1" effort="1" velocity="1"/><dynamics damping="1" friction="1"/></joint>
<joint name="k" type="revolute"><parent link="a"/><child link="c"/><limit lower="-4" upper="4" effort="1" velocity="1"/>
  <mimic joint="j" multiplier="2" offset="0.5"/></joint></robot>"""
"""A robot with every element and attribute that the table does not leave out."""
OTHERWISE = {
    key.strip(): value.strip()
    for pair in """
xyz: 0 1 0; rpy: 0.2 0.1 0; size: 2 2 2; scale: 2 2 2; rgba: 0 0 1 1; type: prismatic; link: c;
filename: other.obj; joint: k; name: own""".split(";")
    for key, value in [pair.split(":")]
}
READ = [
    (row.path, key) for row in ROWS for key in row.attributes.split() if row.fate in (Fate.EXACT, Fate.APPROXIMATED)
]


@pytest.mark.parametrize(("path", "key"), READ)
def test_what_the_table_reads_is_in_the_model(path: str, key: str, tmp_path: Path) -> None:
    """Another value is another model, or an error that says why not: nothing that is read has no effect."""
    from lxml import etree

    from anysim_urdf.load import import_urdf

    corners = ("0 0 0", "1 0 0", "0 1 0", "0 0 1")
    for name, size in (("thing.obj", 1), ("other.obj", 3)):
        lines = [*(f"v {c.replace('1', str(size))}" for c in corners), "f 1 3 2", "f 1 2 4", "f 2 3 4", "f 1 4 3"]
        (tmp_path / name).write_text("\n".join(lines))

    def read(root: etree._Element) -> str:
        (tmp_path / "r.urdf").write_bytes(etree.tostring(root))
        try:
            model = import_urdf(tmp_path / "r.urdf", root=tmp_path)
        except AssetError as error:
            return str(error)
        meshes = [(mesh.name, mesh.hash) for mesh in model.meshes]
        parts = (model.bodies, model.joints, model.geoms, model.sites, dict(model.links))
        return repr((*parts, meshes, model.actuator_hints, model.report))

    root = etree.fromstring(WHOLE)
    before = read(root)
    found = [node for node in root.iterfind(path.removeprefix("robot/")) if node.get(key) is not None]
    assert found, f"the robot of this test has no {path} with {key}"
    old = found[0].get(key) or ""
    found[0].set(key, OTHERWISE[key] if key in OTHERWISE else str(float(old) * 0.7))
    assert read(root) != before


def test_they_are_told_by_check_and_kept_with_what_is_recorded(
    tmp_path: Path, inertial: Callable[[float], str], monkeypatch: pytest.MonkeyPatch, command_line: Typer
) -> None:
    """A line with their count, all with -v, in the manifest; with the thing they go."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "thing.urdf").write_text(f'<robot name="t"><link name="b">{inertial(1)}</link>{GAZEBO}</robot>')
    (tmp_path / "world.yaml").write_text(
        "engine: 'null'\nworld: {objects: {thing: {source: thing.urdf, count: 2}, box: {source: {box: [1, 1, 1]}}}}\n"
    )

    def check(*options: str) -> str:
        return CliRunner().invoke(command_line, ["check", "world.yaml", *options]).output

    short, long = check(), check("-v")
    assert "imported: 1 notes of what sources say and the world does not (thing); `anysim check world.yaml -v`" in short
    assert "imported: thing: <gazebo>: is left out: what it says of friction" in long
    (told,) = json.loads(check("--json"))["world.yaml"]["notes"]
    assert told.startswith("thing: <gazebo>: is left out")
    world = compile_world(load(tmp_path / "world.yaml"))
    assert [thing for thing, _ in world.notes] == ["thing"]
    assert without_entity(world, "box").notes == world.notes
    assert without_entity(world, "thing").notes == ()
    from anysim import make

    with make(tmp_path / "world.yaml", overrides=["task={observations: {policy: [last_action]}}"]) as env:
        assert run_header(env, 0).notes == (told,)

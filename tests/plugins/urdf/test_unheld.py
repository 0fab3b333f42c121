"""Notes of a URDF import: what a file says is read or noted; where they are told."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from typer import Typer
from typer.testing import CliRunner

from anysim import load
from anysim.api import compile_world
from anysim.assets.model import ImportedModel
from anysim.compile.edit import without_entity
from anysim.record.collector import run_header
from anysim_urdf.unheld import READ

Load = Callable[..., ImportedModel]

GAZEBO = '<gazebo reference="b"><mu1>0.2</mu1></gazebo>'
SCHEMA = {  # elements of the URDF of ROS, of URDF 1.2 and of PyBullet, with their attributes
    "robot": "name version xmlns:xacro",
    "robot/material": "name",
    "robot/material/color": "rgba",
    "robot/material/texture": "filename",
    "robot/gazebo": "reference",
    "robot/transmission": "name type",
    "robot/link": "name type",
    "robot/link/inertial": "",
    "robot/link/inertial/origin": "xyz rpy quat_xyzw",
    "robot/link/inertial/mass": "value",
    "robot/link/inertial/inertia": "ixx iyy izz ixy ixz iyz",
    "robot/link/visual": "name",
    "robot/link/visual/origin": "xyz rpy quat_xyzw",
    "robot/link/visual/geometry": "",
    "robot/link/visual/geometry/box": "size",
    "robot/link/visual/geometry/cylinder": "radius length",
    "robot/link/visual/geometry/sphere": "radius",
    "robot/link/visual/geometry/mesh": "filename scale",
    "robot/link/visual/material": "name",
    "robot/link/visual/material/color": "rgba",
    "robot/link/visual/material/texture": "filename",
    "robot/link/collision": "name group concave",
    "robot/link/collision/origin": "xyz rpy quat_xyzw",
    "robot/link/collision/geometry": "",
    "robot/link/collision/geometry/mesh": "filename scale",
    "robot/link/collision/verbose": "value",
    "robot/link/collision_checking": "",
    "robot/link/contact": "",
    "robot/link/contact/lateral_friction": "value",
    "robot/joint": "name type",
    "robot/joint/origin": "xyz rpy quat_xyzw",
    "robot/joint/parent": "link",
    "robot/joint/child": "link",
    "robot/joint/axis": "xyz",
    "robot/joint/calibration": "rising falling reference_position",
    "robot/joint/limit": "lower upper effort velocity acceleration deceleration jerk",
    "robot/joint/dynamics": "damping friction",
    "robot/joint/mimic": "joint multiplier offset",
    "robot/joint/safety_controller": "soft_lower_limit soft_upper_limit k_position k_velocity",
    "robot/sensor": "name type update_rate",
}


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
        ("limit", 'jerk="3"', "<limit jerk>: is left out (1: joint 'j')"),
        ("link", '<inertial><mass value="9"/></inertial>', "<inertial>: of several in one <link> the first is read (1"),
        ("joint", '<axis xyz="1 0 0"/><axis xyz="0 1 0"/>', "<axis>: of several in one <joint> the first is read"),
    ],
)
def test_what_is_left_out_is_named(pair: Load, part: str, text: str, note: str) -> None:
    found = words(pair(**{part: text}))
    assert any(one.startswith(note) for one in found), found


@pytest.mark.parametrize("path", [path for path in SCHEMA if path != "robot"])
def test_every_element_of_the_format_is_read_or_noted(path: str, urdf: Load) -> None:
    """Each with all its attributes, where it may stand."""
    inner = ""
    for depth, tag in enumerate(reversed(path.split("/")[1:])):
        attributes = "" if depth else "".join(f' {key}="0.5"' for key in SCHEMA[path].split() if key != "name")
        inner = f'<{tag} name="x"{attributes}>{inner}</{tag}>'
    from lxml import etree

    from anysim_urdf.unheld import notes_of

    found = [note.where for note in notes_of(etree.fromstring(f"<robot>{inner}</robot>"))]
    parents = ["/".join(path.split("/")[:n]) for n in range(2, path.count("/") + 2)]
    if missing := next((parent for parent in parents if parent not in READ), ""):
        assert f"<{missing.rpartition('/')[2]}>" in found
        return
    tag = path.rpartition("/")[2]
    wanted = {f"<{tag} {key}>" for key in set(SCHEMA[path].split()) - READ[path] - {"name"}}
    assert wanted <= set(found)


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

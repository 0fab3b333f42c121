"""SDF files: frames that are relative to each other, includes, nested models, and what is said of the rest."""

from pathlib import Path

import numpy as np
import pytest

from anysim.assets.load import import_asset
from anysim.assets.model import Fate, ImportedModel
from anysim.compile.world import compile_world
from anysim.errors import AssetError
from anysim.math import pose as P
from anysim.model.world import BodyKind, Capsule, Cylinder
from anysim_schemas.run import WorldSpec
from anysim_urdf.sdf_coverage import ROWS, WORLD_ROWS

INERTIAL = "<inertial><mass>2</mass><inertia><ixx>0.1</ixx><iyy>0.2</iyy><izz>0.2</izz></inertia></inertial>"


def sdf(body: str, version: str = "1.9") -> str:
    return f'<sdf version="{version}">{body}</sdf>'


ARM = f"""<model name="arm"><frame name="mount"><pose>0 0 0.5 0 0 0</pose></frame>
<link name="base">{INERTIAL}</link>
<link name="upper"><pose relative_to="shoulder">0.1 0 0 0 0 0</pose>{INERTIAL}<gravity>false</gravity>
  <collision name="c"><pose relative_to="mount">0 0 0 0 0 0</pose><geometry><capsule><radius>0.1</radius>
  <length>0.4</length></capsule></geometry></collision>
  <visual name="v"><geometry><cylinder><radius>0.2</radius><length>0.6</length></cylinder></geometry><material>
  <diffuse>1 0 0 1</diffuse></material><transparency>0.5</transparency></visual></link>
<link name="lower"><pose relative_to="upper" degrees="true">0 0 1 0 90 0</pose>{INERTIAL}</link>
<joint name="shoulder" type="revolute"><pose relative_to="mount">0 0.2 0 0 0 0</pose>
  <parent>base</parent><child>upper</child>
  <axis><xyz>0 0 1</xyz><limit><lower>-1</lower><upper>2</upper><effort>5</effort><velocity>-1</velocity></limit>
  <dynamics><damping>0.3</damping><friction>0.1</friction>
  <spring_stiffness>4</spring_stiffness><spring_reference>0.2</spring_reference>
  </dynamics></axis></joint>
<joint name="elbow" type="prismatic"><parent>upper</parent><child>lower</child><axis>
  <xyz expressed_in="mount">0 0 1</xyz>
  <mimic joint="shoulder"><multiplier>2</multiplier><reference>0.5</reference></mimic>
  </axis></joint><plugin name="p" filename="x.so"/></model>"""


def written(folder: Path, text: str, name: str = "arm.sdf") -> str:
    (folder / name).write_text(text)
    return str(folder / name)


def frame(model: ImportedModel, name: str) -> np.ndarray:
    """The pose (7,) of a body at zero in the root's frame."""
    number = next(i for i, body in enumerate(model.bodies) if body.name == name)
    pose = P.pose((0, 0, 0), (0, 0, 0, 1))
    while number > 0:
        pose = P.compose(P.pose(model.bodies[number].position, model.bodies[number].quaternion), pose)
        number = model.bodies[number].parent
    return pose


def test_frames_joints_and_shapes(tmp_path: Path) -> None:
    model = import_asset(written(tmp_path, sdf(ARM)))
    assert model.bodies[0].kind is BodyKind.FREE
    shoulder, elbow = model.joints
    assert frame(model, "upper")[:3] == pytest.approx([0.1, 0.2, 0.5])
    assert shoulder.anchor == pytest.approx((-0.1, 0.0, 0.0))
    assert (shoulder.lower, shoulder.upper, shoulder.effort_limit, shoulder.velocity_limit) == (-1.0, 2.0, 5.0, np.inf)
    assert (shoulder.damping, shoulder.friction, shoulder.stiffness, shoulder.spring_rest) == (0.3, 0.1, 4.0, 0.2)
    assert frame(model, "lower")[:3] == pytest.approx([0.1, 0.2, 1.5])
    assert elbow.axis == pytest.approx((-1.0, 0.0, 0.0))  # up, seen from a link that is turned about y
    assert elbow.mimic == (0, 2.0, -1.0, ())
    collision, visual = (next(g for g in model.geoms if g.collides is on) for on in (True, False))
    assert collision.shape == Capsule(0.1, 0.2)
    assert collision.position == pytest.approx((-0.1, -0.2, 0.0))
    assert visual.shape == Cylinder(0.2, 0.3)
    assert visual.color == (1.0, 0.0, 0.0, 0.5)
    assert [body.gravity_compensation for body in model.bodies] == [False, True, False]
    assert any("<plugin>" in note.where for note in model.report)
    free = compile_world(WorldSpec.model_validate({"objects": {"it": {"source": "arm.sdf"}}}), base=tmp_path)
    assert free.bodies[1].inertial.mass == 2.0


def test_a_world_of_includes_and_nested_models(tmp_path: Path) -> None:
    (tmp_path / "table").mkdir()
    written(tmp_path / "table", sdf(f'<model name="t"><link name="top">{INERTIAL}</link></model>'), "model.sdf")
    text = f"""<world name="kitchen"><include><uri>model://table</uri><name>desk</name><pose>1 2 3 0 0 0</pose>
      <static>true</static></include>
      <model name="pair"><model name="left" placement_frame="top"><pose>1 0 0 0 0 0</pose>
        <link name="leg">{INERTIAL}</link>
        <link name="top"><pose>0 0 1 0 0 0</pose>{INERTIAL}</link>
        <joint name="glue" type="fixed"><parent>leg</parent><child>top</child></joint></model>
      <include><uri>table/model.sdf</uri><name>right</name></include>
      <joint name="tie" type="fixed"><parent>right::top</parent><child>left::top</child></joint>
      <joint name="ground" type="revolute"><parent>world</parent>
      <child>right</child><axis><xyz>0 0 1</xyz></axis></joint>
      </model></world>"""
    path = written(tmp_path, sdf(text), "kitchen.world")
    desk = import_asset(f"{path}#desk")
    assert desk.bodies[0].kind is BodyKind.STATIC
    with pytest.raises(AssetError, match=r"holds 2 models, desk, pair; name the one.*kitchen\.world#desk"):
        import_asset(path)
    with pytest.raises(AssetError, match="no model 'dsk'; did you mean 'desk'"):
        import_asset(f"{path}#dsk")
    with pytest.raises(AssetError, match="has 2 links that no joint carries, left::leg, world"):
        import_asset(f"{path}#pair")
    path = written(tmp_path, sdf(text.replace("left::top</child>", "left::leg</child>")), "kitchen.world")
    pair = import_asset(f"{path}#pair")
    assert [body.name for body in pair.bodies] == ["world", "right::top"]
    assert pair.bodies[0].kind is BodyKind.STATIC
    leg = next(site for site in pair.sites if site.name == "left::leg")
    assert leg.position == pytest.approx((1.0, 0.0, -1.0))  # its top is at (1, 0, 0)
    two = written(
        tmp_path, sdf(f'<model name="m"><link name="a">{INERTIAL}</link><link name="b">{INERTIAL}</link></model>')
    )
    with pytest.raises(AssetError, match=r"has 2 links that no joint carries, a, b; name the one.*arm\.sdf#m::a"):
        import_asset(two)
    assert import_asset(f"{two}#m::b").bodies[0].name == "b"


REFUSED = {
    "screw": (ARM.replace('"revolute"', '"screw"'), "is of type 'screw'"),
    "number": (ARM.replace("<mass>2", "<mass>two"), r"arm.sdf:2: <mass> is 'two'; expected 1 finite numbers"),
    "frame": (ARM.replace('relative_to="mount"', 'relative_to="mont"'), "no frame 'mont'; did you mean 'mount'"),
    "cycle": (ARM.replace('name="mount">', 'name="mount" attached_to="upper">'), "is relative to itself"),
    "link": (ARM.replace("<child>lower", "<child>lowr"), "refers to the link 'lowr', which does not exist"),
    "twice": (ARM.replace('"lower"', '"upper"'), "two parts have the name 'upper'"),
    "auto": (ARM.replace("<inertial>", '<inertial auto="true">'), "masses are not computed of shapes"),
    "include out": ("<include><uri>../../../etc/passwd</uri></include>", "leaves its folder"),
    "include scheme": ("<include><uri>https://fuel.example/arm</uri></include>", "expected model://NAME"),
    "include none": ("<include><uri>model://nothing</uri></include>", "which does not exist"),
    "include self": ("<include><uri>arm.sdf</uri></include>", "levels of inclusion"),
    "mesh out": (
        ARM.replace(
            "<cylinder><radius>0.2</radius><length>0.6</length></cylinder>", "<mesh><uri>/etc/passwd</uri></mesh>"
        ),
        "leaves the asset's root",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_said_is_refused_in_a_sentence(name: str, tmp_path: Path) -> None:
    folder = tmp_path / "a" / "b"
    folder.mkdir(parents=True)
    (tmp_path / "etc").mkdir()
    (tmp_path / "etc" / "passwd").write_text("x")
    text, message = REFUSED[name]
    text = text.replace("../../../etc", "../../etc")
    with pytest.raises(AssetError, match=message):
        import_asset(written(folder, sdf(text)))


def test_entities_and_links_are_refused(tmp_path: Path) -> None:
    folder = tmp_path / "robot"
    folder.mkdir()
    with pytest.raises(AssetError, match="document type declaration"):
        import_asset(written(folder, f"<!DOCTYPE r [<!ENTITY a 'b'>]>{sdf(ARM)}"))
    written(tmp_path, sdf(ARM), "secret.sdf")
    (folder / "arm.sdf").unlink()
    (folder / "link.sdf").symlink_to(tmp_path / "secret.sdf")
    with pytest.raises(AssetError, match="which leaves its folder"):
        import_asset(written(folder, sdf("<include><uri>link.sdf</uri></include>")))


def test_each_element_that_is_left_out_is_in_the_report(tmp_path: Path) -> None:
    from lxml import etree

    from anysim_urdf.sdf_coverage import notes_of

    for row in (*ROWS, *WORLD_ROWS):
        if row.fate is not Fate.LEFT_OUT:
            continue
        root = etree.Element(row.path.partition("/")[0], name="m")
        node = root
        for tag in row.path.split("/")[1:]:
            node = etree.SubElement(node, tag)
        if row.attributes:
            node.set(row.attributes.split()[0], "x")
        told = "\n".join(map(str, notes_of(root)))
        assert row.text in told, row


def _whole() -> str:
    """A model with each element and attribute of links, joints and frames that the table says are read."""
    turned = '<pose relative_to="f" rotation_format="euler_rpy" degrees="true">0.1 0.2 0.3 10 20 30</pose>'
    placed = turned.replace(' relative_to="f"', "")
    size = "<radius>0.1</radius><length>0.4</length>"
    shapes = (
        "<box><size>1 2 3</size></box>",
        "<sphere><radius>0.1</radius></sphere>",
        f"<cylinder>{size}</cylinder>",
        f"<capsule>{size}</capsule>",
        "<mesh><uri>thing.obj</uri><scale>1 1 1</scale></mesh>",
    )
    looks = "<material><diffuse>1 0 0 1</diffuse></material><transparency>0.5</transparency>"
    geometry = "".join(
        f'<{tag} name="{tag}{i}">{turned}<geometry>{shape}</geometry>{looks if tag == "visual" else ""}</{tag}>'
        for tag in ("visual", "collision")
        for i, shape in enumerate(shapes)
    )
    values = {key: 0.2 if key[1] == key[2] else 0.01 for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")}
    tensor = "".join(f"<{key}>{value}</{key}>" for key, value in values.items())
    inertial = f"<inertial>{placed}<mass>2</mass><inertia>{tensor}</inertia></inertial>"
    above = turned.replace(' relative_to="f"', ' relative_to="a"')
    return (
        f'<model name="m"><frame name="f" attached_to="b">{above}</frame>'
        f'<link name="b">{turned}<gravity>false</gravity>{inertial}{geometry}</link><link name="a">{INERTIAL}</link>'
        f'<link name="c"><pose>0 0.5 0 0.3 0 0</pose>{INERTIAL}</link><joint name="j" type="revolute">{turned}'
        "<parent>a</parent><child>b</child><axis><xyz>1 0 1</xyz>"
        "<use_parent_model_frame>0</use_parent_model_frame><limit>"
        "<lower>-1</lower><upper>1</upper><effort>5</effort><velocity>4</velocity></limit><dynamics>"
        "<damping>1</damping><friction>1</friction><spring_stiffness>1</spring_stiffness>"
        '<spring_reference>0.1</spring_reference></dynamics></axis></joint><joint name="k" type="revolute">'
        '<parent>f</parent><child>c</child><axis><xyz expressed_in="f">0 0 1</xyz><mimic joint="j">'
        "<multiplier>2</multiplier><offset>0.1</offset><reference>0.1</reference></mimic></axis></joint></model>"
    )


OTHERWISE = {
    "name": "own", "type": "prismatic", "relative_to": "c", "attached_to": "c", "degrees": "false", "joint": "k",
    "rotation_format": "quat_xyzw", "expressed_in": "__model__", "uri": "other.obj", "gravity": "true",
    "parent": "c", "child": "a", "use_parent_model_frame": "1",
}  # fmt: skip
LEAVES = [
    (row.path, key)
    for row in ROWS
    for key in (row.attributes.split() or [""])
    if row.fate in (Fate.EXACT, Fate.APPROXIMATED) and row.path.split("/")[1:2] in (["link"], ["joint"], ["frame"])
]


def test_what_the_table_reads_of_links_joints_and_frames_is_in_the_model(tmp_path: Path) -> None:
    """Another value is another model, or an error that says why not: nothing that is read has no effect."""
    from lxml import etree

    corners = ("0 0 0", "1 0 0", "0 1 0", "0 0 1")
    for name, size in (("thing.obj", 1), ("other.obj", 3)):
        lines = [*(f"v {c.replace('1', str(size))}" for c in corners), "f 1 3 2", "f 1 2 4", "f 2 3 4", "f 1 4 3"]
        (tmp_path / name).write_text("\n".join(lines))

    def read(root: etree._Element) -> str:
        try:
            model = import_asset(written(tmp_path, etree.tostring(root, encoding="unicode")))
        except AssetError as error:
            return str(error)
        meshes = [(mesh.name, mesh.hash) for mesh in model.meshes]
        return repr((model.bodies, model.joints, model.geoms, model.sites, dict(model.links), meshes, model.report))

    text = sdf(_whole())
    before, same, absent = read(etree.fromstring(text)), [], []
    assert before.startswith("((Body("), before
    for path, key in LEAVES:
        root = etree.fromstring(text)
        found = [n for n in root.iterfind(path) if (n.get(key) is not None if key else not len(n))]
        container = not key and root.find(path) is not None and not found
        if container:
            continue  # what it holds has rows of its own
        if not found:
            absent.append((path, key))
            continue
        old = found[0].get(key, "") if key else found[0].text or ""
        own = key or path.rpartition("/")[2]
        new = OTHERWISE[own] if own in OTHERWISE else " ".join(str(0.7 * float(word)) for word in old.split())
        if key:
            found[0].set(key, new)
        else:
            found[0].text = new
        if read(root) == before:
            same.append((path, key))
    assert (absent, same) == ([], [])

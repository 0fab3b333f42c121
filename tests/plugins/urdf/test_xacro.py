"""Xacro files: expanded with their arguments, and kept from all that is not theirs."""

from pathlib import Path

import pytest

from anysim.assets.load import import_asset
from anysim.errors import AssetError

pytest.importorskip("xacro", reason="xacro is an extra of anysim-urdf")

HEAD = '<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">'
ARM = f"""{HEAD}
<xacro:arg name="links" default="2"/><xacro:include filename="$(find parts)/link.xacro"/>
<link name="link0"><visual><geometry><mesh filename="package://parts/tetra.obj"/></geometry></visual></link>
<xacro:macro name="chain" params="n"><xacro:piece number="${{n}}"/>
  <xacro:if value="${{n &lt; int('$(arg links)')}}"><xacro:chain n="${{n+1}}"/></xacro:if></xacro:macro>
<xacro:chain n="1"/></robot>"""
LINK = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro name="piece" params="number">
<link name="link${number}"><inertial><mass value="${1/number}"/><inertia ixx="0.1" iyy="0.1" izz="0.1"/></inertial>
</link><joint name="joint${number}" type="revolute"><parent link="link${number-1}"/><child link="link${number}"/>
<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="5" velocity="1"/></joint></xacro:macro></robot>"""
TETRA = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def test_arguments_macros_and_packages(tmp_path: Path) -> None:
    robot, parts = tmp_path / "robot", tmp_path / "elsewhere"
    robot.mkdir()
    parts.mkdir()
    (robot / "arm.urdf.xacro").write_text(ARM)
    (parts / "link.xacro").write_text(LINK)
    (parts / "tetra.obj").write_text(TETRA)
    packages = {"parts": str(parts)}
    model = import_asset(str(robot / "arm.urdf.xacro"), packages=packages, params={"links": 3})
    assert [joint.name for joint in model.joints] == ["joint1", "joint2", "joint3"]
    assert [body.inertial.mass for body in model.bodies[1:]] == [1.0, 0.5, pytest.approx(1 / 3)]
    assert len(model.meshes) == 1
    with pytest.raises(
        AssetError, match=r"refers to \$\(find parts\), and there is no package 'parts'.*--package parts"
    ):
        import_asset(str(robot / "arm.urdf.xacro"))
    with pytest.raises(AssetError, match="arguments of a xacro are words, numbers and booleans"):
        import_asset(str(robot / "arm.urdf.xacro"), packages=packages, params={"links": [1]})
    (robot / "arm.urdf").write_text("<robot name='a'><link name='l'/></robot>")
    with pytest.raises(AssetError, match="`params` are for xacro files and builders; this is a urdf file"):
        import_asset(str(robot / "arm.urdf"), params={"links": 3})


SYSTEM = (
    "(lambda: [c for c in ().__class__.__base__.__subclasses__() if 'wrap_close' in str(c)][0]"
    ".__init__.__globals__['system']('touch pwned'))()"
)
REFUSED = {
    '<xacro:include filename="/etc/passwd"/>': "'/etc/passwd', which leaves its folders",
    '<xacro:include filename="../../../../etc/*"/>': "which leaves its folders",
    "<link name=\"${xacro.load_yaml('/etc/hostname')}\"/>": "leaves its folders",
    f'<link name="${{{SYSTEM}}}"/>': "would do what no model needs",
    '<link name="$(env HOME)"/>': "'HOME' is not set",
    '<link name="${len(list(range(10**9)))}"/>': "cannot expand it",
    '<xacro:macro name="m" params=""><xacro:m/></xacro:macro><xacro:m/>': "its macros end in a RecursionError",
    '<link name="$(arg nothing)"/>': "Undefined substitution argument nothing",
    "<xacro:nothing/>": "unknown macro name: xacro:nothing",
    "<link": "not well-formed",
}


@pytest.mark.parametrize("text", REFUSED, ids=range(len(REFUSED)))
def test_what_a_file_may_not_do_is_refused_in_a_sentence(text: str, tmp_path: Path) -> None:
    folder = tmp_path / "robot"
    folder.mkdir()
    (folder / "bad.xacro").write_text(f"{HEAD}{text}<link name='l'/></robot>")
    with pytest.raises(AssetError) as error:
        import_asset(str(folder / "bad.xacro"))
    assert REFUSED[text] in str(error.value)
    assert not list(tmp_path.rglob("pwned"))


def test_a_link_out_of_the_folder_and_entities_are_refused(tmp_path: Path) -> None:
    folder = tmp_path / "robot"
    folder.mkdir()
    (tmp_path / "secret.xacro").write_text(LINK)
    (folder / "link.xacro").symlink_to(tmp_path / "secret.xacro")
    (folder / "bad.xacro").write_text(f"{HEAD}<xacro:include filename='link.xacro'/><link name='l'/></robot>")
    with pytest.raises(AssetError, match=r"refers to .*link.xacro.*which leaves its folders"):
        import_asset(str(folder / "bad.xacro"))
    (folder / "bad.xacro").write_text(f"<!DOCTYPE r [<!ENTITY a 'b'>]>{HEAD}<link name='&a;'/></robot>")
    with pytest.raises(AssetError, match="document type declaration"):
        import_asset(str(folder / "bad.xacro"))


@pytest.mark.slow
def test_an_endless_expression_ends(tmp_path: Path) -> None:
    folder = tmp_path / "robot"
    folder.mkdir()
    (folder / "bad.xacro").write_text(f"{HEAD}<link name='${{9**9**9}}'/></robot>")
    with pytest.raises(AssetError, match="its expressions need more than 5 s"):
        import_asset(str(folder / "bad.xacro"))

"""Asset URIs: what they find, what they refuse, and what they say."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from anysim import api
from anysim.assets.catalogue import load_robot
from anysim.assets.uri import example_robot_data, locate, locate_folder, resolve_reference
from anysim.compile.robot import import_robot
from anysim.compile.world import compile_world
from anysim.errors import AnysimError, AssetError, PluginError, SpecError
from anysim_inspect.cli.check import report_on
from anysim_schemas.run import WorldSpec


def test_example_robot_data_is_found_without_importing() -> None:
    file = locate("example-robot-data:panda_description/urdf/panda.urdf")
    assert file.path.is_file()
    assert file.root == example_robot_data()


def test_files_of_python_packages_are_found() -> None:
    assert locate("package:anysim_robots/franka_panda.yaml").path.name == "franka_panda.yaml"


def test_relative_paths_are_relative_to_the_base(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes/cup.stl").write_text("solid")
    for uri in ("meshes/cup.stl", "file:meshes/cup.stl"):
        assert locate(uri, base=tmp_path) == (tmp_path / "meshes/cup.stl", tmp_path)
    with pytest.raises(AssetError, match="needs the YAML file"):
        locate("meshes/cup.stl")


def test_absolute_paths_have_the_package_as_root(tmp_path: Path) -> None:
    (tmp_path / "pkg/urdf").mkdir(parents=True)
    (tmp_path / "pkg/urdf/a.urdf").write_text("x")
    assert locate(f"file:{tmp_path}/pkg/urdf/a.urdf").root == tmp_path / "pkg"
    (tmp_path / "package.xml").write_text("x")
    assert locate(f"{tmp_path}/pkg/urdf/a.urdf").root == tmp_path


@pytest.mark.parametrize("uri", ["../secret.stl", "sub/../../secret.stl", "file:../secret.stl"])
def test_a_path_cannot_leave_its_root_by_dots(tmp_path: Path, uri: str) -> None:
    (tmp_path / "base/sub").mkdir(parents=True)
    (tmp_path / "secret.stl").write_text("x")
    with pytest.raises(AssetError, match=r"leaves its root .*through '\.\.'"):
        locate(uri, base=tmp_path / "base")


def test_a_path_cannot_leave_its_root_by_a_link(tmp_path: Path) -> None:
    base = tmp_path / "base"
    base.mkdir()
    (tmp_path / "secret.stl").write_text("x")
    (base / "cup.stl").symlink_to(tmp_path / "secret.stl")
    with pytest.raises(AssetError, match="symbolic link"):
        locate("cup.stl", base=base)


def test_a_loop_of_links_is_refused_in_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "loop.urdf").symlink_to(tmp_path / "loop.urdf")
    for uri in ("loop.urdf", f"{tmp_path}/loop.urdf"):
        with pytest.raises(AssetError, match="loop"):
            locate(uri, base=tmp_path)
    with pytest.raises(AssetError, match="loop"):
        locate_folder("loop.urdf", base=tmp_path)


def test_packages_cannot_be_left() -> None:
    with pytest.raises(AssetError, match="leaves its root"):
        locate("example-robot-data:../../../../etc/passwd")
    with pytest.raises(AssetError, match="leaves its root"):
        locate("package:anysim_robots/../pyproject.toml")
    with pytest.raises(AssetError, match="leaves its root"):
        locate(f"example-robot-data:{os.sep}etc/passwd")


@pytest.mark.parametrize(
    ("uri", "message"),
    [
        ("exampl-robot-data:x", "no scheme 'exampl-robot-data'; did you mean 'example-robot-data'?"),
        ("example-robot-data:panda_description", "is a folder; name a file in it (URDF files: urdf/panda.urdf"),
        ("example-robot-data:panda_description/urdf/pandas.urdf", "did you mean 'panda.urdf' in the same folder?"),
        ("example-robot-data:panda/urdf/panda.urdf", "the nearest file is "),
        ("package:no_such_package/a.urdf", "no Python package 'no_such_package' is installed"),
        ("package:anysim_robots", "expected package:<python package>/<path>"),
        ("robot_descriptions:panda_description", "pip install robot_descriptions"),
    ],
)
def test_errors_say_what_there_is(uri: str, message: str) -> None:
    with pytest.raises(AssetError) as caught:
        locate(uri)
    assert message in str(caught.value)
    assert uri in str(caught.value)


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """outer/arm_description/{urdf/arm.urdf, meshes/link.STL} and outer/hand_description/meshes/hand.stl."""
    for name in (
        "outer/arm_description/urdf/arm.urdf",
        "outer/arm_description/meshes/link.STL",
        "outer/hand_description/meshes/hand.stl",
        "stray.stl",
    ):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("x")
    return tmp_path


@pytest.mark.parametrize(
    ("reference", "found"),
    [
        ("package://arm_description/meshes/link.STL", "arm_description/meshes/link.STL"),
        ("package://hand_description/meshes/hand.stl", "hand_description/meshes/hand.stl"),
        ("package:///arm_description/meshes/link.STL", "arm_description/meshes/link.STL"),
        ("../meshes/link.STL", "arm_description/meshes/link.STL"),
    ],
)
def test_references_are_searched_up_to_the_root(package: Path, reference: str, found: str) -> None:
    root = package / "outer"
    file = root / "arm_description/urdf/arm.urdf"
    assert resolve_reference(reference, file=file, root=root, asked_by="link 'a'") == root / found


def test_a_package_is_never_another_one(package: Path) -> None:
    """The file's own package has a `meshes/link.STL`, which is not what `other` has, whether that is there or not."""
    file = package / "outer/arm_description/urdf/arm.urdf"
    for root in (package / "outer", package / "outer/arm_description"):
        with pytest.raises(AssetError) as caught:
            resolve_reference("package://other/meshes/link.STL", file=file, root=root, asked_by="link 'a'")
        assert "there is no package 'other' (looked for: " in str(caught.value)
        assert "`packages: {other: FOLDER}`" in str(caught.value)
        with pytest.raises(AssetError, match=r"hand_description/meshes/link\.STL"):  # it is there, without that file
            resolve_reference("package://hand_description/meshes/link.STL", file=file, root=root, asked_by="link 'a'")


@pytest.mark.parametrize("way", ["beside", "package.xml", "mapping", "ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH", "python"])
def test_packages_are_found_by_name(package: Path, monkeypatch: pytest.MonkeyPatch, way: str) -> None:
    root = package / "outer/arm_description"
    found, packages = package / "outer/other/meshes/link.STL", {}
    if way == "package.xml":
        found = root / "meshes/link.STL"
        (root / "package.xml").write_text("<package><name> other </name></package>")
    elif way != "beside":
        found = package / "elsewhere/share/other/meshes/link.STL"
        folder, packages = found.parents[1], {"other": found.parents[1]} if way == "mapping" else {}
        if way == "python":
            monkeypatch.syspath_prepend(folder.parent)
        elif way != "mapping":
            monkeypatch.setenv(way, f"/nowhere:{folder.parent if way.startswith('ROS') else folder.parents[1]}")
    found.parent.mkdir(parents=True, exist_ok=True)
    found.write_text("x")
    file = root / "urdf/arm.urdf"
    reference = "package://other/meshes/link.STL"
    assert resolve_reference(reference, file=file, root=root, asked_by="link 'a'", packages=packages) == found
    (found.parent / "link.STL").unlink()
    (found.parent / "link.STL").symlink_to(package / "stray.stl")
    with pytest.raises(AssetError, match="leaves the asset's root"):
        resolve_reference(reference, file=file, root=root, asked_by="link 'a'", packages=packages)


def test_a_world_and_an_entry_say_where_packages_are(tmp_path: Path, inertial: Callable[[float], str]) -> None:
    """Relative to the file that says so."""
    (tmp_path / "parts/meshes").mkdir(parents=True)
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    (tmp_path / "parts/meshes/part.obj").write_text(corners, encoding="ascii")
    mesh = '<geometry><mesh filename="package://other/meshes/part.obj"/></geometry>'
    (tmp_path / "model").mkdir()
    (tmp_path / "model/thing.urdf").write_text(
        f'<robot name="t"><link name="a">{inertial(1)}<collision>{mesh}</collision></link></robot>', encoding="utf-8"
    )
    source = {"asset": "model/thing.urdf", "packages": {"other": "parts"}}
    spec = WorldSpec.model_validate({"objects": {"thing": {"source": source}}})
    assert len(compile_world(spec, base=tmp_path).meshes) == 1
    with pytest.raises(AssetError, match="no package 'other'"):
        compile_world(WorldSpec.model_validate({"objects": {"thing": {"source": "model/thing.urdf"}}}), base=tmp_path)
    entry = "name: thing\ndescription: t\nsource: model/thing.urdf\nlicense: MIT\nlicense_source: me\ncategory: arm\n"
    (tmp_path / "thing.yaml").write_text(f"{entry}packages: {{other: parts}}\nbase: fixed\nchannels: {{}}\n")
    assert len(import_robot(load_robot(str(tmp_path / "thing.yaml"))).meshes) == 1


def test_references_cannot_leave_the_root(package: Path) -> None:
    root = package / "outer"
    file = root / "arm_description/urdf/arm.urdf"
    for reference in ("../../../stray.stl", f"file://{package}/stray.stl", "package://../../stray.stl"):
        with pytest.raises(AssetError, match=r"link 'a' of arm\.urdf refers to"):
            resolve_reference(reference, file=file, root=root, asked_by="link 'a' of arm.urdf")


def test_a_missing_reference_names_link_places_and_the_nearest_file(package: Path) -> None:
    root = package / "outer"
    file = root / "arm_description/urdf/arm.urdf"
    with pytest.raises(AssetError) as caught:
        resolve_reference(
            "package://arm_description/meshes/link.stl", file=file, root=root, asked_by="link 'a' (arm.urdf:3)"
        )
    text = str(caught.value)
    assert text.startswith(
        "link 'a' (arm.urdf:3) refers to 'package://arm_description/meshes/link.stl', which does not exist"
    )
    assert "did you mean 'link.STL' in the same folder?" in text
    assert str(root / "arm_description/meshes/link.stl") in text


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("a" * 300, "longer than a file name can be"),
        ("x/" * 3000, "longer"),
        ("a\0b", "holds a NUL"),
        ("\ud800", "holds a"),
    ],
    ids=["name", "path", "nul", "surrogate"],
)
def test_what_no_file_can_be_called_is_refused_wherever_a_file_is_named(
    name: str, problem: str, tmp_path: Path
) -> None:
    with pytest.raises(AssetError, match=problem):
        locate(f"{name}.obj", base=tmp_path)
    with pytest.raises(AssetError, match=problem):
        locate_folder(name, base=tmp_path)
    with pytest.raises(AssetError, match=problem):
        resolve_reference(name, file=tmp_path / "arm.urdf", root=tmp_path, asked_by="link 'a'")
    with pytest.raises(PluginError, match="there is no file"):
        load_robot(f"{name}.yaml")
    assert report_on(name, None, False, []).faults
    box = {"box": [0.1, 0.1, 0.1]}
    for world in (
        {"objects": {"a": {"source": {"mesh": f"{name}.obj"}}}},
        {"objects": {"a": {"source": {"folder": name}}}},
        {"objects": {"a": {"source": box, "texture": f"{name}.png"}}},
        {"robots": {"a": {"robot": f"{name}.yaml"}}},
        {"terrain": {"kind": "heightfield", "file": f"{name}.npy"}},
    ):
        with pytest.raises(AnysimError):
            api.compile_world(api.load({"world": world}), base=tmp_path)


def test_a_layout_of_nothing_is_refused() -> None:
    for objects in ({}, {"a": {"source": {"sphere": 0.1}}}):
        with pytest.raises(SpecError, match=r"world.layout.b: there is no object 'b'"):
            api.compile_world({"world": {"objects": objects, "layout": {"b": {"position": [0, 0, 0]}}}})

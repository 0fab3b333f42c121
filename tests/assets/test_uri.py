"""Asset URIs: what they find, what they refuse, and what they say."""

import os
from pathlib import Path

import pytest

from anysim.assets.uri import example_robot_data, locate, resolve_reference
from anysim.errors import AssetError


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
        ("package://renamed/meshes/link.STL", "arm_description/meshes/link.STL"),
        ("../meshes/link.STL", "arm_description/meshes/link.STL"),
    ],
)
def test_references_are_searched_up_to_the_root(package: Path, reference: str, found: str) -> None:
    root = package / "outer"
    file = root / "arm_description/urdf/arm.urdf"
    assert resolve_reference(reference, file=file, root=root, asked_by="link 'a'") == root / found


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

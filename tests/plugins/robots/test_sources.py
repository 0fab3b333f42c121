"""Sources of drafts: folders, names of robot_descriptions, and the SRDF beside a model."""

import sys
from pathlib import Path

import pytest

from anysim.api import compile_world, load
from anysim.assets.catalogue import load_robot
from anysim.errors import AssetError
from anysim_robots.drafting.draft import draft
from anysim_robots.drafting.sources import source_of
from anysim_robots.qualify.stage import stage

INERTIAL = '<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1"/></inertial>'
URDF = f"""<robot name="two"><link name="base"/><link name="upper">{INERTIAL}</link><link name="lower">{INERTIAL}</link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="5" velocity="1"/></joint><joint name="elbow" type="revolute"><parent link="upper"/>
<child link="lower"/><axis xyz="0 1 0"/><origin xyz="0 0 0.3"/><limit lower="-1" upper="1" effort="5" velocity="1"/>
</joint></robot>"""
SRDF = """<robot name="two"><group name="upper_arm"><chain base_link="base" tip_link="upper"/></group>
<group name="all"><group name="upper_arm"/><joint name="elbow"/><joint name="wrist"/></group>
<group_state name="home" group="all"><joint name="shoulder" value="0.5"/><joint name="elbow" value="-2"/></group_state>
<group_state name="folded" group="all"><joint name="shoulder" value="1"/></group_state>
<virtual_joint name="world" type="fixed" parent_frame="world" child_link="base"/>
<disable_collisions link1="base" link2="lower"/><disable_collisions link1="base" link2="hand"/></robot>"""


@pytest.fixture
def package(tmp_path: Path) -> Path:
    folder = tmp_path / "two_description"
    (folder / "urdf").mkdir(parents=True)
    (folder / "srdf").mkdir()
    (folder / "urdf" / "two.urdf").write_text(URDF)
    (folder / "srdf" / "two.srdf").write_text(SRDF)
    return folder


def test_an_srdf_beside_a_model_fills_the_draft(package: Path, tmp_path: Path) -> None:
    made = draft(package)
    assert made.file.name == "two.urdf"
    text = made.text(tmp_path)
    (tmp_path / "two.yaml").write_text(text)
    spec = load_robot(str(tmp_path / "two.yaml")).spec
    assert spec.home == {"shoulder": 0.5, "elbow": -1.0}  # within the limits
    assert spec.channels["arm"].groups == {"upper_arm": ("shoulder",)}
    assert spec.self_collision_exclusions == (("base", "lower"),)
    assert "# Pose 'folded' of the SRDF: {shoulder: 1}" in text
    told = "\n".join(made.notes)
    assert "<joint> of a group of two.srdf: is left out: the model has no such part (1: wrist)" not in told
    assert "<disable_collisions> of two.srdf: is left out: the model has no such part (1: base and hand)" in told
    assert "<virtual_joint> of two.srdf: is left out: the base is that of the draft" in told
    assert compile_world(load(stage(load_robot(str(tmp_path / "two.yaml"))))).joints[1].initial == -1.0


def test_a_damaged_srdf_is_refused_in_a_sentence(package: Path) -> None:
    file = package / "srdf" / "two.srdf"
    file.write_text(SRDF.replace('value="0.5"', 'value="half"'))
    with pytest.raises(AssetError, match=r"two.srdf:3: the position of 'shoulder' is 'half'"):
        draft(package)
    file.write_text(SRDF.replace('<chain base_link="base" tip_link="upper"/>', '<group name="all"/>'))
    with pytest.raises(AssetError, match="contains itself"):
        draft(package)


def test_a_folder_with_none_or_several_models_is_refused(package: Path, tmp_path: Path) -> None:
    (package / "urdf" / "three.urdf").write_text(URDF)
    with pytest.raises(AssetError, match=r"has 2 models; name one: .*three.urdf"):
        source_of(str(package))
    with pytest.raises(AssetError, match="has no model"):
        source_of(str(package / "srdf"))
    with pytest.raises(AssetError, match="there is no file"):
        source_of(str(tmp_path / "no_such.urdf"))


def test_a_description_comes_from_the_cache_and_never_from_a_network(
    package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    library = tmp_path / "site" / "robot_descriptions"
    library.mkdir(parents=True)
    (library / "__init__.py").write_text("")
    (library / "_repositories.py").write_text(
        "from types import SimpleNamespace as N\nREPOSITORIES = {'two': N(cache_path='twos')}\n"
    )
    (library / "_cache.py").write_text(
        "import os\ndef clone_to_cache(name):\n    return os.environ['ROBOT_DESCRIPTIONS_CACHE'] + '/twos'\n"
    )
    (library / "two_description.py").write_text(
        "from ._cache import clone_to_cache as _clone_to_cache\nREPOSITORY_PATH = _clone_to_cache(\n    'two')\n"
        "PACKAGE_PATH = REPOSITORY_PATH + '/two_description'\nURDF_PATH = PACKAGE_PATH + '/urdf/two.urdf'\n"
    )
    monkeypatch.syspath_prepend(str(library.parent))
    monkeypatch.setenv("ROBOT_DESCRIPTIONS_CACHE", str(tmp_path / "cache"))
    for name in [name for name in sys.modules if name.partition(".")[0] == "robot_descriptions"]:
        monkeypatch.delitem(sys.modules, name)
    with pytest.raises(AssetError, match="python -m robot_descriptions pull two_description` fetches it"):
        source_of("two_description")
    with pytest.raises(AssetError, match="has no module 'one_description'"):
        source_of("robot_descriptions:one_description")
    (tmp_path / "cache").mkdir()
    package.parent.joinpath("cache", "twos").mkdir()
    package.rename(tmp_path / "cache" / "twos" / "two_description")
    made = draft("two_description")
    assert made.name == "two_description"
    assert 'source: "robot_descriptions:two_description"' in made.text(tmp_path)
    for name in [name for name in sys.modules if name.partition(".")[0] == "robot_descriptions"]:
        del sys.modules[name]


def test_a_uri_names_a_file_of_a_package_and_stays_in_the_draft(tmp_path: Path) -> None:
    """The whole package is then what references may not leave."""
    made = draft("example-robot-data:z1_description/urdf/z1.urdf")
    assert made.name == "z1"
    assert 'source: "example-robot-data:z1_description/urdf/z1.urdf"' in made.text(tmp_path)
    with pytest.raises(AssetError, match=r"a URI such as package:NAME/arm.urdf"):
        draft("nothing:z1.urdf")

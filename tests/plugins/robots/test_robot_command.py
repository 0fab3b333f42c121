"""`anysim robot` and `anysim gallery`."""

import json
import re
import shutil
from pathlib import Path

import pytest

from anysim.assets.catalogue import load_robot
from anysim.assets.load import import_asset
from anysim_robots.drafting.draft import draft
from tests.cli.test_cli import anysim

ARM = Path(__file__).parents[2] / "external" / "anysim-thirdarm" / "anysim_thirdarm"


def test_a_robot_is_shown_with_its_joints() -> None:
    found = json.loads(anysim("robot", "franka_panda", "--json").stdout)
    assert (found["category"], found["joints"], found["drives"], found["available"]) == ("arm", 9, 9, True)
    assert found["license"] == "Apache-2.0"
    first = found["joint_table"][0]
    assert (first["joint"], first["channel"], first["kp"], first["effort_limit"]) == ("panda_joint1", "arm", 1000, 87)
    told = anysim("robot", "franka_panda").stdout
    assert "panda_finger_joint2" in told
    assert "tool tool: panda_hand_tcp" in told


def test_a_wrong_name_lists_what_there_is() -> None:
    found = anysim("robot", "franka_pand")
    assert found.returncode == 2
    assert "did you mean 'franka_panda'" in found.stderr


def test_help_teaches() -> None:
    assert "anysim robot import my_arm.urdf" in anysim("robot", "--help").stdout
    assert "--picture panda.png" in anysim("robot", "show", "--help").stdout
    assert "anysim gallery --hold 1" in anysim("gallery", "--help").stdout


@pytest.mark.slow
def test_a_draft_is_written_read_back_checked_and_drawn(tmp_path: Path) -> None:
    shutil.copy(ARM / "third_arm.urdf", tmp_path / "new_arm.urdf")
    made = anysim("robot", "import", "new_arm.urdf", cwd=tmp_path)
    assert made.returncode == 0, made.stderr
    assert "TODO license" in made.stdout
    table = [line.split("\t") for line in made.stdout.splitlines() if "\t" in line]
    assert table[0] == ["engine", "", "build", "source", "audit", "kinematics", "hold"]
    assert [row[0].split()[0] for row in table[1:]] == ["mujoco", "pybullet", "sapien"]
    assert all(row[1:] == ["qualified", "yes", "yes", "yes", "yes", "yes"] for row in table[1:]), made.stdout
    assert "guessed base: fixed; it has neither legs nor wheels" in made.stdout
    again = anysim("robot", "import", "new_arm.urdf", cwd=tmp_path)
    assert again.returncode == 2
    assert "--force" in again.stderr
    words = ("--check", "-e", "mujoco", "--hold", "0.2", "--random", "0.1", "--picture", "new.png")
    checked = anysim("robot", "new_arm.yaml", *words, cwd=tmp_path)
    assert checked.returncode == 0, checked.stdout + checked.stderr
    assert "replay: passed" in checked.stdout
    assert (tmp_path / "new.png").read_bytes()[:4] == b"\x89PNG"


def test_a_draft_is_written_into_the_current_folder_and_not_beside_the_model(tmp_path: Path) -> None:
    theirs, mine = tmp_path / "site-packages", tmp_path / "mine"
    theirs.mkdir()
    mine.mkdir()
    shutil.copy(ARM / "third_arm.urdf", theirs / "new_arm.urdf")
    made = anysim("robot", "import", str(theirs / "new_arm.urdf"), "--json", "--engine", "none", cwd=mine)
    assert made.returncode == 0, made.stderr
    assert json.loads(made.stdout)["file"] == "new_arm.yaml"
    assert [path.name for path in theirs.iterdir()] == ["new_arm.urdf"]
    assert f"source: {theirs / 'new_arm.urdf'}" in (mine / "new_arm.yaml").read_text()


@pytest.mark.slow
def test_a_draft_that_falls_over_is_written_and_ends_with_1(tmp_path: Path) -> None:
    """Two wheels and no castor: it builds, and does not stay upright."""
    wheel = (
        '<body name="{0}" pos="0 {1} 0"><joint name="{0}_joint" axis="0 1 0"/>'
        '<geom type="cylinder" size="0.1 0.02" euler="90 0 0" mass="1"/></body>'
    )
    sides = wheel.format("left_wheel", 0.2) + wheel.format("right_wheel", -0.2)
    (tmp_path / "cart.xml").write_text(
        '<mujoco><worldbody><body name="cart" pos="0 0 0.1"><freejoint/>'
        f'<geom type="box" size="0.02 0.15 0.3" pos="0.05 0 0.3" mass="5"/>{sides}</body></worldbody></mujoco>'
    )
    made = anysim("robot", "import", "cart.xml", "--engine", "mujoco", "--hold", "1", cwd=tmp_path)
    assert made.returncode == 1, made.stdout
    assert "name: cart" in (tmp_path / "cart.yaml").read_text()
    row = next(line for line in made.stdout.splitlines() if line.startswith("mujoco"))
    assert row.split("\t")[1:3] + row.split("\t")[-1:] == ["failed", "yes", "no"]
    assert "mujoco: hold: FAILED" in made.stdout


TETRAHEDRON = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@pytest.fixture
def elsewhere(tmp_path: Path) -> Path:
    """A folder with an arm, one of whose meshes is in a package in another folder."""
    text = (ARM / "third_arm.urdf").read_text()
    shape = re.search(r"<(?:box|cylinder|sphere) [^>]*/>", text)
    assert shape is not None
    (tmp_path / "mine").mkdir()
    (tmp_path / "far" / "away").mkdir(parents=True)
    (tmp_path / "far" / "away" / "tetra.obj").write_text(TETRAHEDRON)
    mesh = '<mesh filename="package://nice_meshes/tetra.obj"/>'
    (tmp_path / "mine" / "new_arm.urdf").write_text(text.replace(shape[0], mesh))
    return tmp_path / "mine"


def test_a_package_that_is_elsewhere_can_be_named(elsewhere: Path) -> None:
    """The error says how, and the draft has it."""
    lost = anysim("robot", "import", "new_arm.urdf", cwd=elsewhere)
    assert lost.returncode == 2
    assert "--package nice_meshes=FOLDER" in lost.stderr
    words = ("--package", "nice_meshes=../far/away", "--json", "--engine", "mujoco", "--hold", "0.1")
    made = anysim("robot", "import", "new_arm.urdf", *words, cwd=elsewhere)
    assert made.returncode == 0, made.stderr
    (tried,) = json.loads(made.stdout)["engines"].values()
    assert {"build", "audit", "hold"} <= {check["name"] for check in tried["checks"] if check["passed"]}
    assert load_robot(str(elsewhere / "new_arm.yaml")).spec.packages == {
        "nice_meshes": str(elsewhere.parent / "far" / "away")
    }
    assert "source: new_arm.urdf\n" in (elsewhere / "new_arm.yaml").read_text()


def test_a_package_below_the_draft_is_named_as_it_lies(elsewhere: Path) -> None:
    below = (elsewhere.parent / "far").rename(elsewhere / "far") / "away"
    made = draft(elsewhere / "new_arm.urdf", packages={"nice_meshes": below, "unused": elsewhere.parent})
    assert f"packages:\n  nice_meshes: far/away\n  unused: {elsewhere.parent}\n" in made.text(elsewhere)
    (elsewhere / "new_arm.yaml").write_text(made.text(elsewhere))
    entry = load_robot(str(elsewhere / "new_arm.yaml"))
    assert import_asset(entry.spec.source, base=entry.file.parent, packages=entry.spec.packages).meshes


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (["nice_meshes"], "expected NAME=FOLDER"),
        (["=far"], "expected NAME=FOLDER"),
        (["nice_meshes=nowhere"], "there is no folder nowhere"),
        (["a=.", "a=.."], "a is . already"),
    ],
)
def test_a_package_that_is_none_ends_in_a_sentence(elsewhere: Path, given: list[str], words: str) -> None:
    options = [word for one in given for word in ("--package", one)]
    refused = anysim("robot", "import", "new_arm.urdf", *options, cwd=elsewhere)
    assert refused.returncode == 2
    assert words in " ".join(refused.stderr.split())
    assert not (elsewhere / "new_arm.yaml").exists()


@pytest.mark.slow
def test_the_gallery_is_a_page_without_a_network(tmp_path: Path) -> None:
    out = tmp_path / "gallery"
    words = ("--robots", "franka_panda", "-e", "mujoco", "--hold", "0.1", "--random", "0.1", "--out", str(out))
    made = anysim("gallery", *words)
    assert made.returncode == 0, made.stderr
    html = (out / "index.html").read_text()
    assert "pictures/franka_panda-mujoco.png" in html
    assert "qualified" in html
    assert "://" not in html
    assert (out / "arm.png").stat().st_size < 1_000_000
    assert anysim("gallery", "--robots", "franka_pand").stderr.count("did you mean") == 1
    assert "0 to measure" in anysim("gallery", *words).stderr

"""A robot of somebody else: one YAML file, one URDF and an entry point, and everything works."""

import json
from pathlib import Path

import pytest

from tests.external_packages import EXTERNAL, install, run

PACKAGE = EXTERNAL / "anysim-thirdarm"


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder on the path, as an installer leaves it: the package, and its metadata with the entry points."""
    return install("anysim-thirdarm", tmp_path_factory.mktemp("site"))


def test_there_is_no_python_in_it() -> None:
    assert not list(PACKAGE.rglob("*.py"))
    assert sorted(path.name for path in (PACKAGE / "anysim_thirdarm").iterdir()) == ["third_arm.urdf", "third_arm.yaml"]


def listed(folder: Path) -> dict[str, dict[str, object]]:
    rows = json.loads(run(folder, "-m", "anysim.cli", "list", "robots", "--json").stdout)
    return {row["name"]: row for row in rows}


def test_it_is_in_the_catalogue(installed: Path) -> None:
    row = listed(installed)["third_arm"]
    assert (row["from"], row["category"], row["dof"], row["available"]) == ("anysim-thirdarm", "arm", 4, True)
    assert "third_arm" not in listed(installed.parent)


def test_a_world_moves_it(installed: Path) -> None:
    code = (
        "import anysim, numpy as np\n"
        "world = {'robots': {'arm': {'robot': 'third_arm', 'actions': {'arm': 'default', 'eef': 'default'}}}}\n"
        "task = {'horizon': 50, 'observations': {'policy': ['joint_pos']}}\n"
        "with anysim.make({'world': world, 'task': task}, engine='mujoco') as env:\n"
        "    env.reset(seed=0)\n"
        "    for _ in range(50):\n"
        "        env.step(np.array([[0.3, 0.5, -1.0, -1.0]]))\n"
        "    print(*env.engine.get_state().joint_pos[0].round(3).tolist())\n"
    )
    done = run(installed, "-c", code)
    assert done.returncode == 0, done.stderr
    assert [float(v) for v in done.stdout.split()] == pytest.approx([0.3, 0.5, -1.0, 0.0, 0.0], abs=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "sapien"])
def test_it_qualifies_on_every_engine(installed: Path, engine: str) -> None:
    words = ("robot", "third_arm", "--check", "-e", engine, "--hold", "0.5", "--random", "0.2", "--json")
    done = run(installed, "-m", "anysim.cli", *words)
    assert done.returncode == 0, done.stdout + done.stderr
    (found,) = json.loads(done.stdout)["checks"]
    assert (found["robot"], found["status"]) == ("third_arm", "qualified")

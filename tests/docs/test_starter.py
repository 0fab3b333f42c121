"""The package of the guides: everything in it is found, and its task is solved, recorded and replayed."""

import json
import re
from pathlib import Path

import pytest

from tests.external_packages import EXTERNAL, install, run

KINDS = {
    "tasks": "touch_shelf",
    "skills": "starter_reach",
    "planners": "starter_hop",
    "controllers": "starter_eased_position",
    "assets": "starter_shelf",
    "terms": "starter",
    "writers": "starter_npz",
    "readers": "starter_npz",
}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with anysim-starter in it."""
    return install("anysim-starter", tmp_path_factory.mktemp("site"))


def anysim(site: Path, *words: str) -> dict:
    done = run(site, "-m", "anysim.cli", *words, "--json")
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_its_parts_are_listed(site: Path, kind: str) -> None:
    rows = {row["name"]: row for row in anysim(site, "list", kind)}
    assert rows[KINDS[kind]]["from"] == "anysim-starter"


@pytest.mark.parametrize(
    "engine", ["mujoco", *(pytest.param(e, marks=pytest.mark.slow) for e in ("pybullet", "sapien"))]
)
def test_its_task_is_solved_and_replays_to_the_bit(site: Path, engine: str, tmp_path: Path) -> None:
    found = anysim(
        site,
        "run",
        "touch_shelf",
        "-e",
        engine,
        "-n",
        "4",
        "-k",
        "8",
        "-o",
        "record.cameras=[]",
        "--out",
        str(tmp_path),
    )
    assert found["successes"] == found["attempts"] == 8
    again = anysim(site, "replay", str(tmp_path))
    assert again["identical"] == again["replayed"] == 8


@pytest.mark.parametrize(
    "engine", ["mujoco", *(pytest.param(e, marks=pytest.mark.slow) for e in ("pybullet", "sapien"))]
)
def test_its_commands_are_planned_by_two_planners_and_replay(site: Path, engine: str, tmp_path: Path) -> None:
    words = ("-e", engine, "-n", "4", "-k", "8", "-o", "record.cameras=[]", "--out", str(tmp_path))
    found = anysim(site, "run", "touch_twice", *words)
    assert found["successes"] == found["attempts"] == 8
    again = anysim(site, "replay", str(tmp_path))
    assert again["identical"] == again["replayed"] == 8


@pytest.mark.slow
def test_its_planner_passes_the_suite(site: Path, tmp_path: Path) -> None:
    words = ("-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", "--pyargs", "anysim.testing.planners")
    done = run(site, *words, "--planner", "starter_hop", cwd=tmp_path)
    assert done.returncode == 0, done.stdout[-4000:]
    page = (Path(__file__).parents[2] / "docs" / "write_a_planner.md").read_text()
    line = re.search(r"anysim contract: planner starter_hop .*\)", done.stdout)
    assert line, done.stdout[-400:]
    assert f"`{line[0]}`" in page


CODE = """
import sys
import numpy as np
import anysim
from anysim_starter.tally import tally

with anysim.make("touch_shelf", engine="mujoco", num_envs=2) as env:
    env.reset(seed=0)
    first = env.snapshot()
    rng = np.random.default_rng(0)
    actions = [rng.uniform(*env.action_bounds, (2, env.action_dim)) for _ in range(20)]

    def ends():
        for action in actions:
            env.step(action)
        return env.engine.get_state().joint_pos.copy()

    wanted = ends()
    env.reset_to(first)
    assert (ends() == wanted).all(), "the controller's snapshot lacks something"
    assert not tally(env)
    while env.running.any():
        env.step(np.zeros((2, env.action_dim)), env.running)
    assert sum(tally(env).values()) == 2, tally(env)
"""


def test_its_writer_and_reader_keep_what_the_standard_ones_keep(site: Path, tmp_path: Path) -> None:
    code = """
import sys
import numpy as np
from anysim.record.reader import open_trajectory
first, second = map(open_trajectory, sys.argv[1:])
assert (first.times == second.times).all() and (first.actions == second.actions).all()
assert first.statuses == second.statuses and first.language == second.language
assert list(first.annotations) == list(second.annotations)
for mine, other in ((first.states, second.states), (first.obs, second.obs)):
    assert mine.keys() == other.keys() and all((mine[name] == other[name]).all() for name in mine)
assert all((first.initial_state[name] == rows).all() for name, rows in second.initial_state.items())
assert first.faults() == []
"""
    episodes: list[str] = []
    for writer in ("starter_npz", "mcap"):
        out = tmp_path / writer
        words = ("-k", "1", "-o", "record.cameras=[]", "-o", f"record.writer={writer}", "--out", str(out))
        assert anysim(site, "run", "touch_shelf", *words)["successes"] == 1
        assert anysim(site, "replay", str(out))["identical"] == 1
        episodes += [str(path.parent) for path in out.rglob("manifest.json")]
    done = run(site, "-c", code, *episodes)
    assert done.returncode == 0, done.stderr


def test_its_controller_is_restored_and_its_observer_counts(site: Path) -> None:
    done = run(site, "-c", CODE)
    assert done.returncode == 0, done.stderr


def test_every_entry_point_has_a_guide() -> None:
    """A group that the package uses and no page explains is a guide that is missing."""
    text = (EXTERNAL / "anysim-starter" / "pyproject.toml").read_text()
    groups = re.findall(r"^\[project\.entry-points\.(.+)\]$", text, re.MULTILINE)
    pages = "".join(page.read_text() for page in (Path(__file__).parents[2] / "docs").glob("*.md"))
    assert len(groups) >= 6
    assert not [group for group in groups if f"[project.entry-points.{group}]" not in pages]

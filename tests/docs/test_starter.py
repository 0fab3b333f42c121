"""The package of the guides: everything in it is found, and its task is solved, recorded and replayed."""

import json
import re
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from anysim import registry
from anysim.record.names import trajectories
from anysim.record.reader import open_trajectory
from tests.external_packages import EXTERNAL, FOUND, install, offered, run

OTHER_GUIDES = ("evaluate.md", "export.md", "families.md", "language.md", "teleop.md")
"""Pages that say what a user does and, at their ends, how others add to it."""
PAGES = sorted((Path(__file__).parents[2] / "docs").rglob("*.md"))


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with anysim-starter in it."""
    return install("anysim-starter", tmp_path_factory.mktemp("site"))


def anysim(site: Path, *words: str) -> dict:
    done = run(site, "-m", "anysim.cli", *words, "--json")
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr
    return json.loads(done.stdout)


def test_all_that_it_offers_is_found_and_loads(site: Path) -> None:
    done = run(site, "-c", FOUND, "anysim-starter")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == offered("anysim-starter")


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
        "-o",
        "record.streams.starter_energy.scale=0.5",
        "--out",
        str(tmp_path),
    )
    reader = open_trajectory(trajectories(tmp_path)[0])
    energy = reader.stream("energy/joints")
    assert np.array_equal(energy.values, 0.5 * reader.states_from_reset("joint_vel") ** 2)
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


ROW = """
import sys
import numpy as np
import anysim
from anysim import registry
from anysim.record.names import trajectories
from anysim.record.reader import open_trajectory
from anysim.assets.load import import_asset, model_file
from anysim.errors import AssetError

file = "package:anysim_starter/crate.boards"
model, found = import_asset(file), model_file(file)
oracle = registry.load("oracles", found.kind)(found.path, found.root, found.body)
assert len(model.geoms) == 5 and len(model.joints) == oracle.joints
assert np.isclose(sum(body.inertial.mass for body in model.bodies), oracle.mass, rtol=1e-9)
assert np.isclose(import_asset(file, scale=2.0).bodies[0].inertial.mass, 8 * oracle.mass, rtol=1e-9)

with anysim.make(str(found.path.with_name("row.yaml")), engine="mujoco", num_envs=2, seed=1) as env:
    (texture,) = env.engine.world.textures
    assert texture.name.startswith("starter_crosses") and 0.05 < (texture.pixels[..., 0] < 128).mean() < 0.5
    env.reset(seed=1)
    poses = [env.streams.draws[i]["layout/proposal"]["poses"] for i in range(2)]
    for pose in poses:
        assert set(pose) == {"crate", "cube", "can"}
        assert all(abs(p["position"][0] - 0.3) < 1e-9 and p["position"][2] >= 0.4 for p in pose.values())
    names = [joint.name for joint in env.engine.world.joints]
    arm = [number for number, name in enumerate(names) if "joint" in name and "finger" not in name]
    assert len(arm) == 7, names
    action = np.zeros((2, env.action_dim))
    action[1, 0] = 0.2  # the second arm is told to sway
    home, far = env.engine.get_state().joint_pos[:, arm].copy(), np.zeros((2, 7))
    for _ in range(50):
        env.step(action)
        far = np.maximum(far, np.abs(env.engine.get_state().joint_pos[:, arm] - home))
    assert (far[0] < 0.02).all() and (far[1] > 0.1).all() and (far[1] < 0.25).all(), far

bad = found.path.with_name("bad.boards")
bad.write_text("top 0 0 0 1 1\\n")
try:
    import_asset(str(bad))
except AssetError as error:
    assert "bad.boards:1: expected a name and six numbers" in str(error), error
else:
    raise SystemExit("a line that is no board was read")
"""


def test_its_model_texture_layout_and_policy_make_a_world(site: Path) -> None:
    done = run(site, "-c", ROW)
    assert done.returncode == 0, done.stderr


GROUND = """
from importlib import metadata
import numpy as np
every = [entry for distribution in metadata.distributions() for entry in distribution.entry_points]
found = [entry for entry in every if entry.group not in ("anysim.rooms", "anysim.terrains")]
found += [
    metadata.EntryPoint("generated", "anysim_starter.ground:waves", "anysim.terrains"),
    metadata.EntryPoint("furnished", "anysim_starter.ground:bare", "anysim.rooms"),
]
# as if anysim-assets did not offer them
metadata.entry_points = lambda **wanted: metadata.EntryPoints(found).select(**wanted)

import anysim
from anysim.errors import SpecError
world = anysim.compile_world({"world": {"terrain": {"kind": "rough", "size": [4.0, 3.0], "difficulty": 1.0}}})
(field,) = world.heightfields
assert field.heights.shape == (31, 41) and np.isclose(field.heights.max(), 0.1) and field.heights.min() == 0.0
world = anysim.compile_world({"world": {"room": {"size": [3.0, 2.0]}}})
assert [geom.name for geom in world.geoms if "room" in geom.name] == ["room.floor"], world.geoms
for spec in ({"room": {"style": "kitchen"}}, {"terrain": {"kind": "tiles", "tiles": {"columns": ["rough"]}}}):
    try:
        anysim.compile_world({"world": spec})
    except SpecError as error:
        assert "bare rectangles" in str(error) or "makes no tiles" in str(error), error
    else:
        raise SystemExit(f"{spec} was built")
"""


def test_its_builders_of_surroundings_take_the_place_of_others(site: Path) -> None:
    done = run(site, "-c", GROUND)
    assert done.returncode == 0, done.stderr


@pytest.mark.full
@pytest.mark.skipif(find_spec("torch") is None, reason="learners need torch: make test-learning")
def test_its_learner_trains_stops_and_goes_on(site: Path, tmp_path: Path) -> None:
    words = ("train", "touch_shelf", "--learner", "starter_search", "--exams", "1", "-n", "8", "--out", str(tmp_path))
    assert np.isfinite(anysim(site, *words, "--steps", "800")["earned"])
    assert anysim(site, *words, "--steps", "1600")["steps"] == 1600
    rows = [json.loads(line) for line in (tmp_path / "curve.jsonl").read_text().splitlines()]
    assert [row["steps"] for row in rows] == [800, 1600]
    judged = ("evaluate", "touch_shelf", "--policy", str(tmp_path / "policy.onnx"), "--episodes", "2")
    assert anysim(site, *judged, "--out", str(tmp_path / "judged"))


def test_every_entry_point_has_a_guide() -> None:
    """A group that the package uses and no page explains is a guide that is missing; so is a kind without one."""
    text = (EXTERNAL / "anysim-starter" / "pyproject.toml").read_text()
    groups = re.findall(r"^\[project\.entry-points\.(.+)\]$", text, re.MULTILINE)
    pages = "".join(page.read_text() for page in PAGES)
    assert len(groups) >= 15
    assert not [group for group in groups if f"[project.entry-points.{group}]" not in pages]
    guides = "".join(page.read_text() for page in PAGES if page.name.startswith("write_") or page.name in OTHER_GUIDES)
    assert not [kind for kind in registry.KINDS if f"anysim.{kind}" not in guides]

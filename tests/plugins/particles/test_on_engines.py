"""Matter on engines: images that see it, recordings that replay and stream it, the suite, refusals at their lines."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

import anysim
from anysim.errors import EngineError, SpecError
from anysim.record.film import film_mode
from anysim.record.reader import open_trajectory
from anysim.record.replay import replay
from anysim.testing.engines import require_drawing, require_engine
from anysim_particles.blocks import scattered
from anysim_particles.spec import SandSpec
from anysim_recording.collector import Collector
from tests.contract.suite_runs import run
from tests.plugins.particles.matters import ENGINES, begun, in_tank, run_of, wait
from tests.schemas.test_every_key import Still

EACH = pytest.mark.parametrize("engine", ["mujoco", *(pytest.param(e, marks=pytest.mark.slow) for e in ENGINES[1:])])
WATER = {"kind": "fluid", "box": [0.05, 0.05, 0.04], "fill": {"range": [0.7, 1.0]}}
CAMERA = {"front": {"look_at": [0, 0, 0.03], "from": [0.0, -0.2, 0.1], "size": [128, 96]}}
CAMERA["front"]["channels"] = ["rgb", "depth", "segmentation"]


@EACH
def test_images_see_matter_and_what_hides_it(engine):
    require_drawing(engine)
    post = {"source": {"box": [0.006, 0.006, 0.3]}, "fixed": True}
    world = {"objects": {"post": post}, "layout": {"post": {"position": [0.0, -0.06, 0.15]}}, "cameras": CAMERA}
    with begun(run_of(WATER, engine, world)) as (env, it):
        seen = env.engine.render("front", channels=("rgb", "depth", "segmentation"))
        ids, mine = seen["segmentation"][0], it.setting.entities[0] + 1
        post_id = 1 + [entity.name for entity in env.engine.world.entities].index("post")
        assert (ids == mine).sum() > 60
        middle = ids[20:70, 63:65]
        assert (middle == post_id).mean() > 0.9
        view = env.engine.camera_view("front")
        away = np.linalg.norm(it.x[0] - view.pose[0, :3], axis=1)
        depth = seen["depth"][0][ids == mine]
        assert depth.min() > 0.7 * away.min()
        assert depth.max() < away.max()
        blue = seen["rgb"][0][ids == mine].mean(axis=0)
        assert blue[2] > 1.3 * blue[0]
        with pytest.raises(EngineError, match="matter that families draw is where it is now"):
            env.engine.render("front", body_pose=env.engine.get_state().body_pose)


@EACH
def test_recordings_replay_and_stream_points(engine, tmp_path: Path):
    require_engine(engine)
    box = {"source": {"box": [0.03, 0.03, 0.03]}, "density": 400.0}
    made = run_of(WATER, engine, in_tank(0.05, 0.15, box=(box, [0.0, 0.0, 0.1])))
    made |= {"record": {"keep": "all", "streams": {"matter": {"fps": 25}}}}
    made["task"]["horizon"] = 10
    with anysim.make(made, num_envs=2) as env:
        assert film_mode(env.spec) == "live"
        list(Collector(env, Still(env), tmp_path, 2, seed=1).run())
    for folder in sorted((tmp_path / "episodes").iterdir()):
        reader = open_trajectory(folder)
        rows = reader.stream("matter/it")
        assert rows.steps.tolist() == [0, 2, 4, 6, 8, 10]
        assert all(points.dtype == np.float32 and points.shape[1] == 3 for points in rows.values)
        middle = reader.states_from_reset("family_it_middle")
        np.testing.assert_allclose([p.mean(axis=0) for p in rows.values], middle[rows.steps], atol=1e-6)
        assert replay(folder).identical


@pytest.mark.parametrize(
    ("engine", "kind"),
    [
        *(pytest.param(*row, marks=pytest.mark.slow) for row in (("mujoco", "fluid"), ("sapien", "sand"))),
        *(
            pytest.param(*row, marks=pytest.mark.full)
            for row in (("mujoco", "sand"), ("pybullet", "fluid"), ("pybullet", "sand"), ("sapien", "fluid"))
        ),
    ],
)
def test_the_suite_clears_it(engine, kind, tmp_path: Path):
    """Matter that falls onto a ball: snapshots, partial resets and steps, and what is lost, as the suite has it."""
    require_engine(engine)
    options = ["box=[0.05,0.05,0.04]", "position=[0.65,0.0,0.22]", 'density={"range": [900.0, 1100.0]}']
    words = ["-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", "--pyargs", "anysim.testing.families"]
    words += ["--family", kind, "--engine", engine, *(w for o in options for w in ("--family-option", o))]
    done = run(*words, folder=tmp_path)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]
    assert re.search(r"9 passed, 1 skipped", done.stdout), sys.version


def test_parameters_differ_by_env_and_are_the_same_by_seed():
    matter = {**WATER, "density": {"range": [800.0, 1200.0]}, "position": {"range": [[0, 0, 0], [0.1, 0.1, 0]]}}
    with begun(run_of(matter), num_envs=3, seed=4) as (env, it):
        density, count, x = it.density.copy(), it.count.copy(), it.x.copy()
        assert len(set(density)) == 3
        assert len(set(count.tolist())) > 1
        env.reset(seed=4)
        assert np.array_equal(density, it.density)
        assert np.array_equal(x, it.x)
        state = env.families.state("it")
        assert np.array_equal(state.fields["there"].sum(axis=1), count)
        facts = env.families.facts(1)["it"]
        assert facts["particles"] == count[1]
        assert facts["mass"] == pytest.approx(count[1] * density[1] * 1e-6)


def test_matter_begins_in_a_container_wherever_that_is():
    """`at` follows the body as it was placed at the reset."""
    cup = {"source": {"procedural": "bowl"}}
    pytest.importorskip("anysim_assets")
    world = {"objects": {"cup": cup}, "layout": {"cup": {"position": {"range": [[0.2, 0, 0.1], [0.4, 0.3, 0.1]]}}}}
    matter = {"kind": "fluid", "cylinder": [0.02, 0.03], "at": "cup", "position": [0, 0, 0.02]}
    with begun(run_of(matter, world=world), num_envs=2, seed=1) as (env, it):
        place = env.engine.get_state().body_pose[:, it.body("cup.base"), :2]
        assert np.abs(place[0] - place[1]).max() > 0.01
        np.testing.assert_allclose(it.x[:, :, :2].mean(axis=1), place, atol=1e-3)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"spacng": 0.01}, r"families\.it\.spacng.*did you mean 'spacing'"),
        ({"box": None}, r"families\.it.*needs a block"),
        ({"spacing": 0.001}, r"families\.it\.box: the block holds 100,000 particles; 1 to 50,000"),
        ({"density": -1.0}, r"families\.it\.density"),
        ({"at": "cup"}, r"families\.it\.at: there is no body or object 'cup'"),
    ],
)
def test_what_cannot_be_is_refused(change, words):
    matter = {key: value for key, value in {**WATER, **change}.items() if value is not None}
    with pytest.raises(anysim.errors.AnysimError, match=words), anysim.make(run_of(matter)) as env:
        env.reset(seed=0)


@pytest.mark.parametrize("block", [{"cylinder": (0.003, 0.05)}, {"box": (0.006, 0.006, 0.05)}])
def test_grains_in_a_block_that_is_narrower_than_one_stand_in_a_column(block):
    points = scattered(SandSpec(**block), 0.004, 5, np.random.default_rng(0))
    assert not points[:, :2].any()
    assert (np.diff(points[:, 2]) >= 0.008).all()


def test_a_grain_of_rice_is_long():
    with pytest.raises(SpecError, match=r"families\.it\.length: a grain is 1\.5 to 6 times"):
        anysim.make(run_of({"kind": "rice", "box": [0.1, 0.1, 0.1], "length": 0.05}))


def test_matter_that_is_not_finite_is_a_fault():
    with begun(run_of(WATER), num_envs=2) as (env, it):
        wait(env)
        it.v[1, 0] = np.nan
        wait(env)
        assert env.info["fault"].tolist() == [False, True]
        assert env.status.tolist() == ["running", "failed"]

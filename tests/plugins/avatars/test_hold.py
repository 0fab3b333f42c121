"""Hands that hold, take and let go; how an episode begins; frames of skin."""

import numpy as np
import pytest

import anysim
from anysim.errors import SpecError
from anysim.math import pose as P
from anysim.record.reader import open_trajectory
from anysim.record.replay import replay
from anysim.testing.engines import require_engine
from anysim_avatars.hold import FREE, GIVEN, HELD, Hold
from anysim_avatars.terms import AvatarView
from anysim_avatars.waits import AwaitClear
from anysim_recording.collector import Collector
from tests.plugins.avatars.people import avatars, joints, run_of, wait
from tests.schemas.test_every_key import Still
from tests.tasks.states import blind

ENGINES = ("mujoco", "pybullet", "sapien")
EACH = pytest.mark.parametrize("engine", ["mujoco", *(pytest.param(e, marks=pytest.mark.slow) for e in ENGINES[1:])])
OUT = {"clip": "idle", "reach": [0.4, -0.2, 1.1]}


def with_bar(engine, do, **hold):
    run = run_of(
        do,
        engine,
        num_envs=2,
        dt=0.002,
        world={
            "objects": {"bar": {"source": {"box": [0.2, 0.03, 0.03]}, "mass": 0.1}},
            "layout": {"bar": {"position": [1.5, 0.0, 0.1]}},
        },
    )
    run["world"]["families"]["grip"] = {"kind": "avatar_hold", "avatar": "ann", "object": "bar", **hold}
    return run


def grip(env) -> Hold:
    family = env.families.family("grip")
    assert isinstance(family, Hold)
    return family


def pull(env, force):
    wrench = np.zeros((2, 1, 6))
    wrench[:, 0, 0] = force
    env.engine.apply_wrench(wrench, [env.scene.index.body("bar")])
    wait(env)


@EACH
def test_a_hand_holds_on_to_what_is_pulled_with_less_than_its_force(engine):
    require_engine(engine)
    do = [{"clip": "idle", "reach": [0.3, -0.2, 1.0], "seconds": 0.2}, {**OUT, "ease": 0.5}]
    with anysim.make(with_bar(engine, do, begins=True, at=[0.1, 0.0, 0.02], force=8.0)) as env:
        env.reset(seed=0)
        palm, bar = env.scene.frame("ann.right_palm"), env.scene.frame("bar")
        for _ in range(40):  # carried out to the point, where it hangs in the palm
            wait(env)
        held = P.rotate_inverse(palm.quaternion, bar.position - palm.position)
        assert np.abs(held - (0.1, 0.0, 0.02)).max() < 0.004
        for _ in range(10):
            pull(env, [5.0, 12.0])
        assert grip(env).holding.tolist() == [HELD, GIVEN]
        assert P.norm(bar.position - palm.position)[0] < 0.13
        assert env.families.facts(1)["grip"] == {
            "kind": "hold",
            "hand": "ann.right_hand",
            "object": "bar",
            "is": "let go",
        }


def test_what_is_held_turns_about_its_own_centre_of_mass():
    """One centre is where the drawing of an episode has put it: a spin is damped, and moves it nowhere."""
    centre, spin = np.array([[0.0, 0.0, 0.0], [0.08, 0.0, 0.0]]), np.array([0.0, 0.0, 3.0])
    with anysim.make(with_bar("mujoco", [{"clip": "idle"}], begins=True)) as env:
        env.reset(seed=0)
        only = [env.scene.index.body("bar")]
        env.engine.set_parameters("body.com", centre[:, None], indices=only)
        grip(env).reset(np.arange(2))
        bar = env.scene.frame("bar")
        arm = P.rotate(bar.quaternion, centre)
        pose = np.concatenate([bar.position, bar.quaternion], axis=-1)
        twist = np.concatenate([-np.cross(spin, arm), np.tile(spin, (2, 1))], axis=-1)
        begun = bar.position + arm
        env.engine.set_body_state(pose[:, None], twist[:, None], bodies=only)
        wait(env)
        assert np.abs(bar.position + P.rotate(bar.quaternion, centre) - begun).max() < 1e-4  # the hand breathes


def test_a_hand_closes_on_what_is_near_and_still():
    with anysim.make(with_bar("mujoco", [OUT], near=0.08, closing=0.2)) as env:
        env.reset(seed=0)
        palm, bar = env.scene.frame("ann.right_over_palm"), [env.scene.index.body("bar")]
        for step in range(15):  # brought to the palm in the first env, and past it in the second
            pose = palm.pose[:, None].copy()
            pose[1, 0, 0] += 0.02 * step - 0.15
            twist = np.zeros((2, 1, 6))
            twist[1, 0, 0] = 1.0
            env.engine.set_body_state(pose, twist, bodies=bar)
            env.engine.apply_wrench(np.tile([0.0, 0.0, 0.981, 0.0, 0.0, 0.0], (2, 1, 1)), bar)  # its weight is carried
            wait(env)
        assert grip(env).holding.tolist() == [HELD, FREE]
        for _ in range(50):
            wait(env)
        gap = P.norm(env.scene.frame("bar").position - palm.position)
        assert gap[0] < 0.03 < 0.5 < gap[1]


@pytest.mark.parametrize(
    ("hold", "words"),
    [
        ({"avatar": "bob"}, r"families\.grip\.avatar.*there is no avatar 'bob'"),
        ({"object": "baar"}, r"families\.grip\.object.*there is no object 'baar'; did you mean 'bar'"),
    ],
)
def test_whose_hand_and_what_are_told_at_their_place(hold, words):
    run = with_bar("mujoco", [OUT])
    run["world"]["families"]["grip"] |= hold
    with pytest.raises(SpecError, match=words):
        anysim.make(run)


def test_an_episode_begins_as_the_first_action_has_it():
    first = {"clip": "sit", "reach": {"range": [[0.2, -0.3, 0.8], [0.3, -0.1, 0.9]]}, "bend": 0.2}
    with anysim.make(run_of([first], num_envs=2)) as env:
        env.reset(seed=3)
        ann = avatars(env)
        begun = ann.state(np.arange(2)).points[:, :9].copy()
        wanted = ann.memory["queue"][:, 0, 0, 19:22]
        assert np.abs(np.diff(wanted, axis=0)).max() > 0.01  # drawn for each env
        palms = env.scene.frame("ann.right_hand").position
        assert np.abs(palms - wanted).max() < 1e-9
        wait(env)
        assert np.abs(ann.state(np.arange(2)).points[:, :9] - begun).max() < 0.002  # nothing jumps


def test_a_palm_goes_from_point_to_point():
    do = [{"clip": "idle", "reach": [0.3, -0.3, 1.0], "seconds": 0.1}, {**OUT, "ease": 0.5}]
    with anysim.make(run_of(do)) as env:
        env.reset(seed=0)
        before, steps = joints(avatars(env))["right_hand"], []
        for _ in range(40):
            wait(env)
            now = joints(avatars(env))["right_hand"]
            steps.append(np.linalg.norm(now - before))
            before = now
        assert 0.01 < max(steps) < 0.035  # [m] in 20 ms
        assert np.allclose(env.scene.frame("ann.right_hand").position[0], OUT["reach"], atol=1e-9)


def test_distances_are_to_the_skin_and_mouths_are_in_front_of_faces():
    with anysim.make(run_of([], num_envs=2)) as env:
        env.reset(seed=0)
        ann = avatars(env)
        poses = env.engine.get_state().body_pose
        mouth, bite = env.scene.frame("ann.mouth"), env.scene.frame("ann.bite")
        assert np.abs(ann.gap(poses, 0, mouth.position)).max() < 0.002
        assert np.abs(ann.gap(poses, 0, bite.position) - 0.045).max() < 0.008
        assert (bite.position[:, 0] > mouth.position[:, 0] + 0.04).all()
        palm = env.scene.frame("ann.left_palm")
        assert np.abs(ann.gap(poses, 0, palm.position)).max() < 1e-6


def test_clear_is_what_somebody_has_left():
    """Waits while the hand is there, and before it has come; then goes on."""
    do = [{"clip": "idle", "seconds": 0.2}, {**OUT, "seconds": 0.6}, {"clip": "idle"}]
    run = run_of(do)
    run["task"]["command"] = {"spot": {"term": "goal_at", "position": OUT["reach"]}}
    with anysim.make(run) as env:
        env.reset(seed=0)
        ann = AvatarView(env.scene, "ann")
        waits = AwaitClear(env, avatar=ann, frame=env.scene.frame("spot"), distance=0.1, steps=3)
        waits.begin(np.array([0]))
        when = None
        for step in range(80):
            waits.act(np.array([0]), np.zeros((1, 0)))
            if waits.outcome[0] == 1 and when is None:
                when = step
            wait(env)
        assert when is not None
        assert 40 < when < 60


@EACH
def test_a_task_with_a_person_goes_on_and_replays_with_the_same_bits(engine, tmp_path):
    """The bar is in the hand: a moment goes on in two envs alike, then apart; a recording replays."""
    require_engine(engine)
    with blind("take_from_human", engine, 2, "task.horizon=25", "record.keep=all") as env:
        env.reset(seed=4)
        action = np.full((2, env.action_dim), 0.3)
        for _ in range(8):
            env.step(action)
        moment = env.snapshot(np.array([True, False]))
        env.reset_to(moment, [0])
        env.reset_to(moment, [1])
        for _ in range(8):
            env.step(action)
        state = env.engine.get_state()
        assert state.body_pose[0].tobytes() == state.body_pose[1].tobytes()
        action[1] = -0.3
        for _ in range(3):
            env.step(action)
        assert np.abs(np.diff(env.engine.get_state().joint_pos, axis=0)).max() > 0.01
        list(Collector(env, Still(env), tmp_path, 1, seed=1).run())
    (folder,) = (tmp_path / "episodes").iterdir()
    assert open_trajectory(folder).states["family_offer_holding"].all()
    assert replay(folder).identical

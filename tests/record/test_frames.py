import numpy as np
import pytest

from anysim.conventions import xyzw_from_wxyz
from anysim.engine.control import Control
from anysim.engine.state import State
from anysim.errors import RecordError
from anysim.managers.camera import interval
from anysim.model.world import Actuator, Body, BodyKind, Camera, ControlMode, Joint, JointType, World
from anysim.record.frame import FrameBatch, state_digest, state_rows
from anysim.record.header import CameraInfo, EpisodeHeader, camera_info, state_layout
from anysim.record.manifest import read_manifest
from anysim_recording.recorder import Recorder


@pytest.fixture
def episode(tmp_path, writer, run_header):
    """A recorder in which episode 2 of env 3 is open, with a camera."""
    with Recorder(tmp_path, writer, run_header) as recorder:
        restart(recorder)
        yield recorder


def restart(recorder):
    cameras = {"front": CameraInfo(width=4, height=3, every=2)}
    recorder.start(EpisodeHeader(env=3, episode=2, episode_seed=0, cameras=cameras))


def image(step):
    return {"front": np.zeros((3, 4, 3), np.uint8)} if step % 2 == 0 else {}


def test_steps_follow_one_by_one(episode, make_frame):
    with pytest.raises(RecordError, match="env 3, episode 2: frame of step 2, but step 0 or 1 is next"):
        episode.append(3, make_frame(2))
    for wrong in (0, 1, 3):
        restart(episode)
        episode.append(3, make_frame(1))
        with pytest.raises(RecordError, match=f"frame of step {wrong}, but step 2 is next"):
            episode.append(3, make_frame(wrong))
    restart(episode)
    episode.append(3, make_frame(1))
    episode.append(3, make_frame(2, images=image(2)))
    assert read_manifest(episode.commit(3, "success").wait()).steps == 2


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"action": None}, "step 0 has no action"),
        ({"action": np.zeros(3)}, r"action has shape \(3,\) of float64; the layout says \(2,\)"),
        ({"state": {"joint_pos": np.zeros(2)}}, "state has joint_pos; the layout says body_pose, joint_pos"),
        (
            {"state": {"joint_pos": np.zeros(2), "body_pose": np.full((1, 7), np.nan)}},
            r"body_pose\[0, 0\] is nan; .* finite",
        ),
        ({"state": {"joint_pos": np.array([0, np.inf]), "body_pose": np.zeros((1, 7))}}, r"joint_pos\[1\] is inf"),
        ({"action": np.array([0.0, np.nan])}, r"action\[1\] is nan"),
        ({"reward": float("nan")}, "the reward is nan"),
        ({"time": -1.0}, "time -1.0 s; 0.0 s or later expected"),
        ({"time": float("nan")}, "time nan"),
        ({"obs": {}}, "obs has none; the layout says policy"),
        ({"obs": {"policy": np.zeros(3)}}, "obs.policy has shape .* of float64; the layout says .* of float32"),
        ({"images": {"front": np.zeros((3, 4, 3), np.uint8)}}, "images of front; due are none"),
    ],
)
def test_a_frame_that_does_not_fit_is_refused(episode, make_frame, changes, message):
    """Names, shapes and turns at once, numbers when the episode is committed."""

    def record():
        episode.append(3, make_frame(1, **changes))
        episode.append(3, make_frame(2, images=image(2)))
        episode.commit(3, "success")

    with pytest.raises(RecordError, match=message):
        record()
    assert episode.open_envs == ()
    episode.flush()
    assert episode.committed() == set()


def test_a_number_is_refused_by_the_step_where_it_is(episode, make_frame):
    for step in range(300):  # beyond the rows that were made ready
        wrong = {"joint_pos": np.array([0.0, np.nan if step == 257 else 1.0]), "body_pose": np.zeros((1, 7))}
        episode.append(3, make_frame(step, state=wrong, images=image(step)))
    with pytest.raises(RecordError, match=r"env 3, episode 2, step 257: joint_pos\[1\] is nan"):
        episode.commit(3, "success")


def test_images_belong_to_every_nth_step(episode, make_frame):
    assert episode.cameras_due(3, 0) == ("front",)
    assert episode.cameras_due(3, 1) == ()
    with pytest.raises(RecordError, match="images of none; due are front"):
        episode.append(3, make_frame(0))
    restart(episode)
    with pytest.raises(RecordError, match=r"camera 'front' has shape \(2, 4, 3\) of uint8; \(3, 4, 3\) of uint8"):
        episode.append(3, make_frame(0, images={"front": np.zeros((2, 4, 3), np.uint8)}))
    restart(episode)
    episode.append(3, make_frame(0, images=image(0)))
    episode.append(3, make_frame(1))
    manifest = read_manifest(episode.commit(3, "success").wait())
    assert (manifest.cameras["front"].first_step, manifest.cameras["front"].frames) == (0, 1)


def test_images_among_the_observations_are_ignored(episode, make_frame):
    frame = make_frame(1)
    episode.append(3, frame._replace(obs={**frame.obs, "images/front": np.zeros((3, 4, 3), np.uint8)}))
    assert episode.commit(3, "success").wait().is_dir()


def test_envs_at_different_steps_are_appended_together(tmp_path, writer, run_header, make_frame, monkeypatch):
    seen = {}
    write = writer.write
    monkeypatch.setattr(
        writer,
        "write",
        lambda directory, columns, status: (
            seen.update({columns.header.episode.env: columns}) or write(directory, columns, status)
        ),
    )
    with Recorder(tmp_path, writer, run_header, horizon=4) as recorder:
        for env, first in ((7, 0), (3, 1), (5, 1)):
            recorder.start(EpisodeHeader(env=env, episode=0, episode_seed=0, instruction="go"))
            recorder.append(env, make_frame(first))
        words = [{"phase": "a"}, {"phase": "b"}]
        for k in range(12):  # more than there is room for at first
            frames = [make_frame(1 + k), make_frame(2 + k)]
            recorder.append_batch(
                [7, 5],
                FrameBatch(
                    step=[frame.step for frame in frames],
                    time=np.array([frame.time for frame in frames]),
                    action=np.stack([frame.action for frame in frames]),
                    state={n: np.stack([frame.state[n] for frame in frames]) for n in frames[0].state},
                    reward=np.array([frame.reward for frame in frames]),
                    status=["running", f"s{k // 6}"],
                    obs={"policy": np.stack([frame.obs["policy"] for frame in frames])},
                    annotations=[words[k % 2], words[k // 6]],
                    language=["", "stop" if k > 6 else "go"],
                    images=[{}, {}],
                ),
            )
        recorder.commit(5, "success")
        recorder.commit(7, "success")
    assert (len(seen[7]), seen[7].first_step, len(seen[5]), seen[5].first_step) == (13, 0, 13, 1)
    for env, first in ((7, 0), (5, 1)):
        frames = [make_frame(first + k) for k in range(13)]
        assert np.array_equal(seen[env].time, [frame.time for frame in frames])
        assert np.array_equal(seen[env].reward, [frame.reward for frame in frames])
        for name in ("joint_pos", "body_pose"):
            assert np.array_equal(seen[env].state[name], [frame.state[name] for frame in frames])
        assert np.array_equal(seen[env].obs["policy"], [frame.obs["policy"] for frame in frames])
        actions = [np.zeros(2) if frame.action is None else frame.action for frame in frames]
        assert np.array_equal(seen[env].action, actions)
    assert seen[7].status == ((0, "running"),)
    assert seen[5].status == ((0, "running"), (1, "s0"), (7, "s1"))
    assert seen[7].annotations == tuple((1 + k, words[k % 2]) for k in range(12))
    assert seen[5].annotations == ((1, words[0]), (7, words[1]))
    assert seen[5].language == ((8, "stop"),)
    assert seen[7].language == ()


def test_annotations_may_hold_arrays_and_be_changed_in_place(tmp_path, writer, run_header, make_frame, monkeypatch):
    seen = []
    write = writer.write
    monkeypatch.setattr(writer, "write", lambda d, columns, s: seen.append(columns.annotations) or write(d, columns, s))
    words = {"at": np.zeros(2)}
    with Recorder(tmp_path, writer, run_header) as recorder:
        recorder.start(EpisodeHeader(env=0, episode=0, episode_seed=0))
        for step in range(1, 5):
            words["at"][0] = step // 2
            recorder.append(0, make_frame(step, annotations=words))
        recorder.commit(0, "success")
    assert seen == [((0, {"at": [0.0, 0.0]}), (1, {"at": [1.0, 0.0]}), (3, {"at": [2.0, 0.0]}))]


def test_the_digest_sees_every_bit():
    state = {"a": np.array([0.0, 1.0]), "b": np.zeros((2, 2))}
    digests = {
        state_digest(state),
        state_digest({**state, "a": np.array([-0.0, 1.0])}),
        state_digest({**state, "a": np.array([0.0, np.nextafter(1.0, 2.0)])}),
        state_digest({**state, "b": np.zeros(4)}),
        state_digest({"a": state["a"], "c": state["b"]}),
    }
    assert len(digests) == 5
    assert state_digest(dict(reversed(state.items()))) == state_digest(state)


@pytest.fixture
def world():
    return World(
        bodies=(Body("cube", BodyKind.FREE), Body("arm/base", BodyKind.STATIC), Body("arm/link", BodyKind.LINK, 1)),
        joints=(Joint("arm/hinge", 2, JointType.REVOLUTE, (0.0, 0.0, 1.0)),),
        actuators=(Actuator("arm/hinge", 0, ControlMode.POSITION, 10.0, 1.0),),
        cameras=(Camera("wrist", 2, (0.0, 0.0, 0.1), (0.0, 0.0, 0.0, 1.0), 45.0, 64, 48),),
    )


def test_layout_and_rows_of_a_world(world):
    fields = ("joint_pos", "body_pose", "control_position")
    layout = state_layout(world, fields, ["u"], {"policy": np.zeros(5, np.float32), "images/x": np.zeros((2, 2, 3))})
    assert layout.bodies == ("cube", "arm/base", "arm/link")
    assert layout.state == {"joint_pos": (1,), "body_pose": (3, 7), "control_position": (1,)}
    assert list(layout.obs) == ["policy"]
    arrays = {"joint_pos": np.arange(2.0).reshape(2, 1), "body_pose": np.arange(42.0).reshape(2, 3, 7)}
    state = State(lambda name: arrays[name].copy(), np.zeros(2))
    control = Control(*(np.full((2, 1), float(i)) for i in range(4)))
    rows = state_rows(state, 1, fields, control)
    assert rows["joint_pos"] == 1.0
    assert rows["body_pose"][0, 0] == 21.0
    assert rows["control_position"] == 0.0
    assert {name: row.shape for name, row in rows.items()} == layout.state
    with pytest.raises(RecordError, match="pass control="):
        state_rows(state, 1, fields)


def test_cameras_of_a_world(world):
    info = camera_info(world, world.cameras[0], every=2)
    assert (info.parent, info.width, info.height, info.fov, info.every) == ("arm/link", 64, 48, 45.0, 2)
    pose = np.concatenate([[1.0, 2.0, 3.0], xyzw_from_wxyz(np.array([1.0, 0, 0, 0]))])
    assert camera_info(world, world.cameras[0], 1, pose).pose == (1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0)


@pytest.mark.parametrize(
    ("dt", "fps", "every"), [(0.02, 25.0, 2), (0.02, 50.0, 1), (0.02, 100.0, 1), (0.05, 25.0, 1), (1 / 60, 20.0, 3)]
)
def test_image_interval(dt, fps, every):
    assert interval(dt, fps) == every

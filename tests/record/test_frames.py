import numpy as np
import pytest

from anysim.conventions import xyzw_from_wxyz
from anysim.engine.control import Control
from anysim.engine.state import State
from anysim.errors import RecordError
from anysim.managers.camera import interval
from anysim.model.world import Actuator, Body, BodyKind, Camera, ControlMode, Joint, JointType, World
from anysim.record.episode import Episode
from anysim.record.frame import state_digest, state_rows
from anysim.record.header import CameraInfo, EpisodeHeader, Header, camera_info, state_layout


class Sink:
    def __init__(self):
        self.frames = []

    def append(self, frame):
        self.frames.append(frame)


@pytest.fixture
def episode(run_header):
    cameras = {"front": CameraInfo(width=4, height=3, every=2)}
    header = Header(run_header, EpisodeHeader(env=3, episode=2, episode_seed=0, cameras=cameras))
    return Episode(header, Sink())


def image(step):
    return {"front": np.zeros((3, 4, 3), np.uint8)} if step % 2 == 0 else {}


def test_steps_follow_one_by_one(episode, make_frame):
    with pytest.raises(RecordError, match="env 3, episode 2: frame of step 2, but step 0 or 1 is next"):
        episode.append(make_frame(2))
    episode.append(make_frame(1))
    for wrong in (0, 1, 3):
        with pytest.raises(RecordError, match=f"frame of step {wrong}, but step 2 is next"):
            episode.append(make_frame(wrong))
    episode.append(make_frame(2, images=image(2)))
    assert episode.summary().steps == 2


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
    with pytest.raises(RecordError, match=message):
        episode.append(make_frame(1, **changes))
    assert episode.writer.frames == []


def test_images_belong_to_every_nth_step(episode, make_frame):
    assert episode.cameras_due(0) == ("front",)
    assert episode.cameras_due(1) == ()
    with pytest.raises(RecordError, match="images of none; due are front"):
        episode.append(make_frame(0))
    with pytest.raises(RecordError, match=r"camera 'front' has shape \(2, 4, 3\) of uint8; \(3, 4, 3\) of uint8"):
        episode.append(make_frame(0, images={"front": np.zeros((2, 4, 3), np.uint8)}))
    episode.append(make_frame(0, images=image(0)))
    episode.append(make_frame(1))
    assert episode.first_image == {"front": 0}


def test_images_among_the_observations_are_ignored(episode, make_frame):
    frame = make_frame(1)
    episode.append(frame._replace(obs={**frame.obs, "images/front": np.zeros((3, 4, 3), np.uint8)}))
    assert list(episode.writer.frames[0].obs) == ["policy"]


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

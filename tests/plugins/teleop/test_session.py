"""Sessions: what a device does is recorded as a run is; what does not succeed leaves nothing."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import anysim
from anysim.errors import RecordError, TaskError
from anysim.record.names import trajectories
from anysim.record.reader import open_trajectory
from anysim.record.replay import replay
from anysim.task.env import TaskEnv
from anysim_inspect.verify import verify
from anysim_recording.collector import EpisodeResult
from anysim_teleop.device import Button, DeviceInput, InputDevice, Moment
from anysim_teleop.drive import LEAD
from anysim_teleop.script import ScriptDevice
from anysim_teleop.session import DISCARDED, Session, Setup

PLAIN = ("record.cameras=[]",)
STILL = DeviceInput(np.zeros(6))


class Pressing(InputDevice):
    """Moves the tool, and does what a function of the moment says beside."""

    live = False

    def __init__(self, wish: Callable[[Moment], DeviceInput]) -> None:
        self.wish = wish
        self.begun = self.closed = 0
        self.lines: list[str] = []

    def begin(self) -> None:
        self.begun += 1

    def read(self, moment: Moment) -> DeviceInput:
        return self.wish(moment)

    def tell(self, line: str) -> None:
        self.lines.append(line)

    def close(self) -> None:
        self.closed += 1


def env_of(task: str = "pick_cube", *more: str, engine: str = "mujoco") -> TaskEnv:
    return anysim.make(task, engine=engine, num_envs=1, overrides=[*PLAIN, *more])


def play(
    out: Path, device: InputDevice, *more: str, episodes: int = 1, engine: str = "mujoco", seed: int = 0
) -> list[EpisodeResult]:
    with env_of("pick_cube", *more, engine=engine) as env:
        with Session(env, device, out, episodes, seed, Setup("test")) as session:
            return list(session.run())


def picked(tmp_path: Path, engine: str) -> None:
    script = Path(__file__).with_name("pick_cube.yaml")
    [result] = play(tmp_path, ScriptDevice(file=str(script)), engine=engine)
    assert result.status == "success"
    assert result.path is not None
    assert verify(result.path) == []
    manifest = open_trajectory(result.path).manifest
    assert {key: manifest.outcome[key] for key in ("source", "device", "tool", "resets")} == {
        "source": "teleop",
        "device": "test",
        "tool": "panda.tool",
        "resets": 0,
    }
    assert replay(result.path).identical


def test_a_scripted_pick_succeeds_and_replays_to_the_bit(tmp_path: Path) -> None:
    picked(tmp_path, "mujoco")


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pybullet", "sapien"])
def test_a_scripted_pick_succeeds_on_other_engines(engine: str, tmp_path: Path) -> None:
    picked(tmp_path, engine)


def test_equal_sessions_give_equal_manifests_but_for_the_clock(tmp_path: Path) -> None:
    script = tmp_path / "wave.yaml"
    script.write_text("moves: [{for: 0.2, linear: [0, 0, 0.1]}, {for: 0.2, angular: [0, 0, 0.5], frame: tool}]")
    manifests: list[dict[str, object]] = []
    for name in ("a", "b"):
        [result] = play(tmp_path / name, ScriptDevice(file=str(script)), "record.keep=all")
        assert result.status == "truncated"
        assert result.steps == 20
        manifests.append(open_trajectory(result.path).manifest.model_dump(exclude={"clock"}))
    assert manifests[0] == manifests[1]


def test_what_does_not_succeed_is_kept_where_all_is(tmp_path: Path) -> None:
    [result] = play(tmp_path / "few", Pressing(lambda moment: STILL), "task.horizon=4")
    assert (result.status, result.steps, result.path) == ("truncated", 4, None)
    [kept] = play(tmp_path / "all", Pressing(lambda moment: STILL), "task.horizon=4", "record.keep=all")
    assert trajectories(tmp_path / "few") == []
    assert trajectories(tmp_path / "all") == [kept.path]
    assert not (tmp_path / "few" / ".incoming").exists()


def ends_with(button: Button) -> Pressing:
    """Presses a button in the fourth control step of each episode but the last."""

    def wish(moment: Moment) -> DeviceInput:
        late = moment.time > 0.05 and moment.episode + 1 < moment.episodes
        return STILL._replace(buttons=(button,) if late else ())

    return Pressing(wish)


def test_a_discarded_episode_leaves_nothing_even_where_all_is_kept(tmp_path: Path) -> None:
    device = ends_with(Button.DISCARD)
    first, second = play(tmp_path, device, "task.horizon=6", "record.keep=all", episodes=2)
    assert (first.status, first.path) == (DISCARDED, None)
    assert second.status == "truncated"
    assert [path.name for path in trajectories(tmp_path)] == ["env_0000_episode_0001"]
    assert {path.name for path in tmp_path.iterdir()} == {"run.json", "episodes"}
    assert "discarded" in device.lines[0]
    assert device.closed >= 1


def test_a_reset_begins_the_same_episode_again(tmp_path: Path) -> None:
    device = Pressing(lambda moment: STILL)
    device.wish = lambda moment: STILL._replace(
        buttons=(Button.RESET,) if moment.time > 0.05 and device.begun < 3 else ()
    )
    [again] = play(tmp_path / "again", device, "task.horizon=6", "record.keep=all")
    [once] = play(tmp_path / "once", Pressing(lambda moment: STILL), "task.horizon=6", "record.keep=all")
    assert device.begun == 3
    assert again.outcome["resets"] == 2
    a, b = open_trajectory(again.path), open_trajectory(once.path)
    assert a.manifest.final_digest == b.manifest.final_digest
    assert replay(again.path).identical


def test_quitting_ends_the_session_with_whole_episodes_only(tmp_path: Path) -> None:
    def wish(moment: Moment) -> DeviceInput:
        return STILL._replace(buttons=(Button.QUIT,) if moment.episode == 1 and moment.time > 0.05 else ())

    results = play(tmp_path, Pressing(wish), "task.horizon=6", "record.keep=all", episodes=5)
    assert [result.episode for result in results] == [0]
    assert [path.name for path in trajectories(tmp_path)] == ["env_0000_episode_0000"]


def test_an_interrupted_session_leaves_whole_episodes_and_goes_on(tmp_path: Path) -> None:
    def wish(moment: Moment) -> DeviceInput:
        if moment.episode == 1 and moment.time > 0.05:
            raise KeyboardInterrupt
        return STILL

    short = ("task.horizon=6", "record.keep=all")
    device = Pressing(wish)
    with pytest.raises(KeyboardInterrupt):
        play(tmp_path / "a", device, *short, episodes=3)
    assert device.closed == 1
    assert [path.name for path in trajectories(tmp_path / "a")] == ["env_0000_episode_0000"]
    results = play(tmp_path / "a", Pressing(lambda moment: STILL), *short, episodes=3)
    assert [result.resumed for result in results] == [True, False, False]
    whole = play(tmp_path / "b", Pressing(lambda moment: STILL), *short, episodes=3)
    assert [r.episode_seed for r in results] == [r.episode_seed for r in whole]


def test_the_command_never_leads_the_tool_by_more_than_the_bound(tmp_path: Path) -> None:
    """Down into the table for as long as it takes: the arm presses, and follows at once when it is called back."""
    with env_of("pick_cube", "task.failure={}") as env:
        down = np.array([0, 0, -0.4, 0, 0, 0.0])
        arm: list[float] = []
        with Session(env, Pressing(lambda moment: STILL), tmp_path, 1, 0, Setup("test", speed=0.4)) as session:
            env.reset(seed=0)
            session.drives.begin()
            for _ in range(120):
                env.step(session.drives.act(DeviceInput(down), 0.4, 1.0))
                active = session.drives.active
                arm.append(float(np.linalg.norm(active.command[:3] - env.scene.frame(active.name).position[0])))
    assert max(arm[60:]) > 0.8 * LEAD, "it never pressed, so the bound was not tried"
    assert max(arm) <= LEAD + 0.4 * 0.02 + 0.01


def test_two_arms_take_turns_and_the_other_holds_still(tmp_path: Path) -> None:
    up = DeviceInput(np.array([0, 0, 0.2, 0, 0, 0]))
    with env_of("handover") as env:
        with Session(env, Pressing(lambda moment: STILL), tmp_path, 1, 0, Setup("test")) as session:
            drives = session.drives
            assert [arm.name for arm in drives.arms] == ["panda.tool", "partner.tool"]
            env.reset(seed=0)
            drives.begin()
            drives.switch()
            before = [env.scene.frame(arm.name).position[0].copy() for arm in drives.arms]
            for _ in range(40):
                env.step(drives.act(up, 0.2, 1.0))
            moved = [env.scene.frame(a.name).position[0] - b for a, b in zip(drives.arms, before, strict=True)]
    assert np.linalg.norm(moved[0]) < 0.01
    assert moved[1][2] > 0.1
    with env_of("handover") as env, pytest.raises(TaskError, match=r"no robot 'left'.*panda"):
        Session(env, Pressing(lambda moment: STILL), tmp_path / "x", 1, 0, Setup("test", robot="left"))


def test_arms_of_one_robot_have_their_own_joints_and_grippers(tmp_path: Path) -> None:
    robot = {"robot": "mobile_dual_panda", "actions": {"arm": "joint_position", "eef": "joint_position"}}
    watching = {"observations": {"policy": ["last_action"]}, "horizon": 100}
    spec = {"engine": "mujoco", "world": {"robots": {"robot": robot}}, "task": watching}
    close = DeviceInput(np.zeros(6), closed=True)
    with anysim.make(spec, num_envs=1) as env:
        with Session(env, Pressing(lambda moment: STILL), tmp_path, 1, 0, Setup("test")) as session:
            drives = session.drives
            left, right = drives.arms
            assert (left.name, right.name) == ("robot.left_tool", "robot.right_tool")
            assert not set(left.chain.joints.tolist()) & set(right.chain.joints.tolist())
            env.reset(seed=0)
            drives.begin()
            drives.switch()
            before = env.scene.state.joint_pos[0].copy()
            for _ in range(25):
                env.step(drives.act(close, 0.2, 1.0))
            assert (left.closed, right.closed) == (False, True)
            moved = np.abs(env.scene.state.joint_pos[0] - before) > 0.01
        closing = [joint.name for joint, much in zip(env.engine.world.joints, moved, strict=True) if much]
    fingers = [name for name in closing if "finger" in name]  # arms sag a little
    assert len(fingers) == 2
    assert all("right" in name for name in fingers), fingers


def test_controllers_that_take_no_joint_positions_are_named(tmp_path: Path) -> None:
    with env_of("pick_cube", "world.robots.panda.actions.arm=joint_effort") as env:
        with pytest.raises(TaskError, match=r"no arm that a device can drive.*joint_delta_position"):
            Session(env, Pressing(lambda moment: STILL), tmp_path, 1, 0, Setup("test"))


def test_a_directory_of_another_run_is_refused(tmp_path: Path) -> None:
    play(tmp_path, Pressing(lambda moment: STILL), "task.horizon=2")
    device = Pressing(lambda moment: STILL)
    with pytest.raises(RecordError, match="another run"):
        play(tmp_path, device, "task.horizon=3")
    assert device.closed == 1

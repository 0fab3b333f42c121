"""Cameras that fly by themselves: limits on every way, what they look at, steps in common, shake, and snapshots."""

from typing import Any

import numpy as np
import pytest

import anysim
from anysim.conventions import Array
from anysim.errors import AnysimError
from anysim.math import pose as P
from anysim.task.env import TaskEnv
from anysim_cameras.spline import Limits, through
from tests.plugins.cameras.test_motion import DT, flight
from tests.runtime.light import REAL

TICKS = 5
"""Physics steps of a control step."""
ENGINES = [pytest.param(name, marks=[] if name == "mujoco" else pytest.mark.slow) for name in REAL]
HOLD = {"controller": "camera_path", "params": {"waypoints": [[0, 0, 0]]}}


def flown(env: TaskEnv, steps: int, channel: int = 0) -> tuple[Array, Array]:
    """What a channel without an action is commanded in each tick of these control steps, (T, n, k) each."""
    controller = env.actions.slices[channel].controller
    nothing = np.zeros((env.num_envs, 0))
    places, rates = [], []
    for _ in range(steps):
        for tick in range(TICKS):
            command = controller.update(None) if tick else controller.apply(nothing, None)
            assert command.position is not None
            assert command.velocity is not None
            places.append(command.position.copy())
            rates.append(command.velocity.copy())
    return np.array(places), np.array(rates)


def test_a_thousand_moves_keep_their_limits_and_arrive() -> None:
    """Moves of millimetres to metres: sliding joints together, each turning joint by itself."""
    rng = np.random.default_rng(1)
    params = {"command": "pose", "speed": 1.2, "acceleration": 2.5, "rate": 1.5, "angular_acceleration": 4.0}
    motion = {"controller": "camera_motion", "params": params}
    with flight("null", 1000, motion, motion) as env:
        env.reset(seed=0)
        base, arm = (s.controller for s in env.actions.slices)
        scale = 10.0 ** rng.uniform(-3, 0, (1000, 1))
        places = rng.uniform(-1.5, 1.5, (1000, 3)) * scale
        turns = rng.uniform(-1, 1, (1000, 3)) * [3.1, 1.5, 3.1] * scale
        for controller, goal, groups in (
            (base, places, [Limits(np.arange(3), 1.2, 2.5)]),
            (arm, turns, [Limits(np.array([k]), 1.5, 4.0) for k in range(3)]),
        ):
            path = [np.zeros((1000, 3)), np.zeros((1000, 3))]
            for tick in range(1100):
                command = controller.update(None) if tick else controller.apply(goal, None)
                path.append(command.position)
            way = np.array([*path, path[-1]])
            velocity = np.diff(way, axis=0) / DT
            for one in groups:
                speed = P.norm(velocity[:, :, one.columns])
                push = P.norm(np.diff(velocity[:, :, one.columns], axis=0)) / DT
                assert speed.max() <= one.speed * (1 + 1e-9)
                assert push.max() <= one.acceleration * (1 + 1e-6)
                assert speed.max() > 0.99 * one.speed, "the limits are used"
                assert push.max() > 0.97 * one.acceleration
            assert np.abs(path[-1] - goal).max() < 1e-12


def test_two_hundred_splines_keep_their_limits_and_pass_through_their_waypoints() -> None:
    """The largest speed and acceleration of each are exactly one of the limits, never more, and nothing jumps."""
    rng = np.random.default_rng(2)
    limits = [Limits(np.arange(3), 1.0, 2.0), *(Limits(np.array([k]), 0.8, 2.5) for k in (3, 4, 5))]
    for _ in range(200):
        points = np.cumsum(rng.normal(size=(rng.integers(2, 9), 6)) * 10.0 ** rng.uniform(-2, 0), axis=0)
        way = through(points, limits)
        times = np.linspace(0.0, way.times[-1], 4001)
        stretch = np.clip(np.searchsorted(way.times, times, side="right") - 1, 0, len(way.cubics) - 1)
        t = (times - way.times[stretch])[:, None]
        a, b, c, d = np.moveaxis(way.cubics[stretch], 1, 0)
        place, velocity, push = a + t * (b + t * (c + t * d)), b + t * (2 * c + 3 * t * d), 2 * c + 6 * t * d
        used = [
            ratio
            for one in limits
            for ratio in (
                P.norm(velocity[:, one.columns]).max() / one.speed,
                P.norm(push[:, one.columns]).max() / one.acceleration,
            )
        ]
        assert max(used) <= 1 + 1e-9
        assert max(used) > 0.999
        assert np.abs(way.cubics[:, 0] - points[:-1]).max() < 1e-12
        assert np.abs(place[-1] - points[-1]).max() < 1e-9
        assert np.abs(velocity[[0, -1]]).max() < 1e-9, "at rest at both ends"
        step = np.diff(times)[0]
        assert np.abs(np.diff(place, axis=0) / step - (velocity[1:] + velocity[:-1]) / 2).max() < 0.02
        jerk = np.abs(6 * way.cubics[:, 3]).max()
        assert np.abs(np.diff(push, axis=0)).max() <= jerk * step * (1 + 1e-6), "no step of the acceleration"


def test_a_path_is_flown_within_its_limits_and_ends_at_its_last_waypoint() -> None:
    params = {"waypoints": [[1, 0, 0], [1, 1, 0.5], [0, 1, 0.5]], "speed": 0.8, "acceleration": 1.5, "delay": 0.2}
    turns = {"waypoints": [[0.5, 0.2, 0], [3.0, -0.3, 0.1]], "rate": 0.9, "angular_acceleration": 2.0}
    with flight(
        "null", 3, {"controller": "camera_path", "params": params}, {"controller": "camera_path", "params": turns}
    ) as env:
        env.reset(seed=0)
        assert env.action_dim == 0, "what flies by itself takes no action"
        places, rates = flown(env, 400)
        velocity = np.diff(places, axis=0) / DT
        assert P.norm(rates).max() <= 0.8 * (1 + 1e-9)
        assert P.norm(velocity).max() <= 0.8 * (1 + 1e-9)
        assert P.norm(np.diff(velocity, axis=0)).max() / DT <= 1.5 * (1 + 1e-6)
        assert not places[: round(0.2 / DT)].any(), "it waits"
        assert np.array_equal(places[-1], np.tile([0.0, 1.0, 0.5], (3, 1)))
        for point in params["waypoints"]:  # type: ignore[attr-defined]
            assert P.norm(places[:, 0] - point).min() < 0.8 * DT
        places, _ = flown(env, 400, channel=1)
        velocity = np.diff(places, axis=0) / DT
        assert np.abs(velocity).max() <= 0.9 * (1 + 1e-9)
        assert np.abs(np.diff(velocity, axis=0)).max() / DT <= 2.0 * (1 + 1e-6)


def _two(first: Any, second: Any) -> TaskEnv:
    """Two cameras that fly by themselves."""
    robot = {"robot": "flying_camera", "position": [0, 0, 1]}
    robots = {"left": {**robot, "actions": {"base": first}}, "right": {**robot, "actions": {"base": second}}}
    task = {"horizon": 1000, "observations": {"policy": [{"term": "joint_pos", "robot": "left"}]}}
    physics = {"dt": DT, "control_dt": 0.02}
    return anysim.make({"engine": "null", "physics": physics, "world": {"name": "two", "robots": robots}, "task": task})


def test_cameras_of_one_duration_are_in_step() -> None:
    def of(waypoints: Any, **more: Any) -> Any:
        return {"controller": "camera_path", "params": {"waypoints": waypoints, **more}}

    with _two(of([[2, 0, 0]], duration=4.0), of([[0, 0.3, 0], [0, 0.2, 0.4]], duration=4.0)) as env:
        env.reset(seed=0)
        left, right = flown(env, 210)[0][:, 0], flown(env, 210, channel=1)[0][:, 0]
        for places in (left, right):
            moving = np.flatnonzero(np.abs(np.diff(places, axis=0)).max(axis=1) > 0)
            assert (moving[-1] + 2) * DT == pytest.approx(4.0, abs=2 * DT)
    with _two(of([[2, 0, 0]], duration=1.0), HOLD) as env, pytest.raises(AnysimError, match=r"takes 3\.\d+ s"):
        env.reset(seed=0)


@pytest.mark.parametrize("engine", ENGINES)
def test_an_orbit_keeps_its_radius_and_its_eye_on_what_moves(engine: str) -> None:
    """Once round a ball that rolls: figures in docs/cameras.md are this test's."""
    base = {"controller": "camera_follow", "params": {"frame": "ball", "offset": [-1.5, 0, 0.8], "turn": 0.8}}
    arm = {"controller": "camera_gimbal", "params": {"look_at": "ball", "steered": False}}
    with flight(engine, 1, base, arm, position=[0.5, 0.5, 1.05]) as env:
        env.reset(seed=0)
        assert env.action_dim == 0, "what flies by itself takes no action"
        push = np.zeros((1, 1, 6))
        push[..., 0], push[..., 4] = 0.3, 0.3 / 0.25  # it rolls away
        env.engine.set_body_state(None, push, None, [env.engine.index.entity("ball").root])
        off, radius, azimuth = [], [], []
        for _ in range(400):
            env.step(np.zeros((1, 0)))
            frame, ball = env.scene.frame("cam.camera"), env.scene.frame("ball")
            way = (ball.position - frame.position)[0]
            ahead = P.rotate(frame.quaternion, np.array([[0.0, 0.0, 1.0]]))[0]
            off.append(np.degrees(np.arccos(np.clip(ahead @ way / np.linalg.norm(way), -1, 1))))
            radius.append(np.hypot(way[0], way[1]))
            azimuth.append(np.arctan2(way[1], way[0]))
        assert max(off[100:]) < 0.5
        assert np.abs(np.array(radius[100:]) - 1.5).max() < 0.02
        assert np.unwrap(azimuth)[-1] - azimuth[0] == pytest.approx(0.8 * 8.0, abs=0.3)
        assert not env.engine.get_state().fault.any()


@pytest.mark.parametrize(("aside", "yaw"), [(0.0, 0.0), (0.01, 2.0), (0.05, 0.0), (0.3, 0.0), (-0.3, 2.0)])
def test_no_flip_over_the_subject(aside: float, yaw: float) -> None:
    """Straight over a point at 1 m/s: the eye stays on it, no joint is quicker than its limits, the view levels."""
    rate, push = 3.0, 12.0
    subject = [1.5 * np.cos(yaw) - aside * np.sin(yaw), 1.5 * np.sin(yaw) + aside * np.cos(yaw), 0.0]
    base = {"controller": "camera_path", "params": {"waypoints": [[3, 0, 0]], "speed": 1.0, "acceleration": 2.0}}
    arm = {"controller": "camera_gimbal", "params": {"look_at": subject, "rate": rate, "acceleration": push}}
    with flight("mujoco", 1, base, arm, home={"pitch": 0.9}, yaw=yaw) as env:
        env.reset(seed=0)
        off, turned, rates, before = [], [], [], None
        for _ in range(220):
            env.step(np.zeros((1, 2)))
            frame = env.scene.frame("cam.camera")
            way = np.array(subject) - frame.position[0]
            ahead = P.rotate(frame.quaternion, np.array([[0.0, 0.0, 1.0]]))[0]
            off.append(np.degrees(np.arccos(np.clip(ahead @ way / np.linalg.norm(way), -1, 1))))
            if before is not None:
                turned.append(np.degrees(P.angle_between(before, frame.quaternion)[0]))
            before = frame.quaternion.copy()
            rates.append(env.actions.slices[1].controller.snapshot(np.array([0]))["velocity"][0])
        steps = np.abs(np.diff(rates, axis=0))
        assert np.abs(rates).max() <= rate * (1 + 1e-9)
        assert steps.max() <= push * 0.02 * (1 + 1e-9)
        assert max(off[25:]) < 2.0
        assert max(turned) < np.degrees(3 * rate * 0.02), "no flip from one frame to the next"
        right = P.rotate(before, np.array([[1.0, 0.0, 0.0]]))[0]
        down = P.rotate(before, np.array([[0.0, 1.0, 0.0]]))[0]
        assert abs(right[2]) < 0.01, "level again"
        assert down[2] < 0, "and the right way up"


def test_what_is_followed_may_jump() -> None:
    """A ball that is moved by 3 m at once: the camera catches up within its limits."""
    base = {"controller": "camera_follow", "params": {"frame": "ball", "speed": 1.5, "acceleration": 3.0}}
    with flight("null", 2, base, HOLD) as env:
        env.reset(seed=0)
        controller, root = env.actions.slices[0].controller, env.engine.index.entity("ball").root
        places = [controller.update(None).position.copy()]
        for step in range(1100):
            if step == 100:
                pose = env.engine.get_state().body_pose[:, [root]].copy()
                pose[..., :3] += [2.0, -2.0, 1.0]
                env.engine.set_body_state(pose, None, None, [root])
                env.actions._see()  # as before each update
            places.append(controller.update(None).position.copy())
        velocity = np.diff(places, axis=0) / DT
        assert P.norm(velocity).max() <= 1.5 * (1 + 1e-9)
        assert P.norm(np.diff(velocity, axis=0)).max() / DT <= 3.0 * (1 + 1e-6)
        assert P.norm(velocity).max() > 1.49
        assert np.abs(places[-1] - [2.0, -2.0, 1.0]).max() < 1e-3


def test_the_shake_is_of_its_size_and_of_its_episode() -> None:
    def of(**more: Any) -> Any:
        return {"controller": "camera_path", "params": {"waypoints": [[0, 0, 0]], **more}}

    with flight("null", 4, of(shake=0.01), of(shake=0.02, tremor=3.0)) as env:
        env.reset(seed=7)
        first, rates = flown(env, 1000)
        turns, _ = flown(env, 1000, channel=1)
        assert np.abs(first[0]).max() < 1e-7
        assert np.sqrt((first[250:] ** 2).mean()) == pytest.approx(0.01, rel=0.1)
        assert np.sqrt((turns[250:] ** 2).mean()) == pytest.approx(0.02, rel=0.1)
        speed = np.diff(first, axis=0) / DT
        assert np.abs(speed - (rates[1:] + rates[:-1]) / 2).max() < 1e-3, "the velocity is that of the place"
        assert all(not np.array_equal(first[:, 0], first[:, k]) for k in (1, 2, 3)), "each env has its own"
        env.reset(seed=7)
        assert np.array_equal(flown(env, 10)[0], first[: 10 * TICKS]), "the seed's"
        env.reset(seed=8)
        assert not np.array_equal(flown(env, 10)[0], first[: 10 * TICKS])
    with flight("null", 2, of(shake=0.01), of()) as fewer:
        fewer.reset(seed=7)
        assert np.array_equal(flown(fewer, 10)[0], first[: 10 * TICKS, :2]), "not of how many envs there are"


@pytest.mark.parametrize("engine", ENGINES)
def test_snapshots_hold_ways_under_way_bit_for_bit(engine: str) -> None:
    base = {"controller": "camera_follow", "params": {"frame": "ball", "turn": 1.0, "shake": 0.01}}
    arm = {"controller": "camera_gimbal", "params": {"look_at": "ball", "shake": 0.01}}
    way = {"controller": "camera_path", "params": {"waypoints": [[1, 1, 0], [0, 2, 0.5]], "shake": 0.01}}
    for kind, width in ((base, 2), (way, 2)):
        with flight(engine, 2, kind, arm) as env:
            env.reset(seed=0)
            actions = np.random.default_rng(0).uniform(-0.3, 0.3, (30, 2, width))
            for row in actions[:9]:
                env.step(row)
            kept = env.snapshot()
            first = [(env.step(row).obs["policy"], env.engine.camera_poses("eye")) for row in actions[9:]]
            env.reset(seed=5)
            env.reset_to(kept)
            for row, (seen, pose) in zip(actions[9:], first, strict=True):
                assert np.array_equal(env.step(row).obs["policy"], seen)
                assert np.array_equal(env.engine.camera_poses("eye"), pose)


@pytest.mark.parametrize(
    ("base", "words"),
    [
        ({"controller": "camera_path", "params": {"waypoints": [[0, 0]]}}, "3 numbers in each"),
        ({"controller": "camera_path", "params": {"waypoints": [[0, 0, 90]]}}, "beyond a joint's limits"),
        ({"controller": "camera_follow", "params": {"frame": "bal"}}, "frame: .*'bal'"),
    ],
)
def test_what_is_wrong_is_said(base: Any, words: str) -> None:
    with pytest.raises(AnysimError, match=words):
        flight("null", 1, base)


def test_following_needs_three_slides() -> None:
    with pytest.raises(AnysimError, match="three sliding joints"):
        flight("null", 1, HOLD, {"controller": "camera_follow", "params": {"frame": "ball"}})

"""Sensors of a world: their rate, delay, loss and streams, snapshots, recordings, and what is refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import anysim
from anysim.errors import AnysimError, SnapshotError
from anysim.managers.sensors import EVERY_SENSOR
from anysim.record.reader import open_trajectory
from anysim.record.replay import replay
from anysim.sensors.base import SensorField
from anysim.task.env import TaskEnv
from anysim.task.snapshot import EnvSnapshot
from anysim_inspect.cli.check import report_on
from anysim_recording.collector import Collector
from tests.schemas.test_every_key import Still

NOISY = {
    "position": {"white": 0.01, "bias": {"range": [-1.0, 1.0]}, "walk": 0.1, "noise": {"range": [-0.1, 0.1]}},
    "quaternion": {"white": 0.01},
}
TRACK = {"sensor": "tracking", "frame": "ball"}


def throwing(sensors: dict[str, Any], seen: str = "s", **more: Any) -> dict[str, Any]:
    """A ball on the ground, at a place of its own in each episode."""
    return {
        "engine": "mujoco",
        "world": {
            "objects": {"ball": {"source": {"sphere": 0.05}, "mass": {"range": [0.1, 0.9]}}},
            "layout": {"ball": {"on": "terrain", "x": {"range": [-0.4, 0.4]}, "y": 0.0}},
            "sensors": sensors,
        },
        "task": {"horizon": 30, "observations": {"policy": [{"term": "sensor", "of": seen}]}},
        **more,
    }


def made(num_envs: int = 1, seen: str = "s.position", **keys: Any) -> TaskEnv:
    return anysim.make(throwing({"s": {**TRACK, **keys}, "true": TRACK}, seen), num_envs=num_envs)


def go(env: TaskEnv, steps: int, mask: Any = None) -> list[np.ndarray]:
    """The observations of some steps, in which the ball is carried along."""
    rows = []
    for _ in range(steps):
        env.engine.set_body_state(twist=np.tile([[[1.0, 0.5, 0, 0, 0, 2.0]]], (env.num_envs, 1, 1)))
        rows.append(env.step(np.zeros((env.num_envs, 0)), mask).obs["policy"])
    return rows


def truth(env: TaskEnv, field: str = "position") -> np.ndarray:
    return env.sensors.reading("true", field)


def test_between_two_readings_the_last_one_holds_with_its_time() -> None:
    with made(rate=12.5) as env:
        env.reset(seed=0)
        for tick in range(1, 13):
            go(env, 1)
            fresh = np.array_equal(env.sensors.reading("s", "position"), truth(env))
            assert fresh == (tick % 4 == 0)
            assert env.sensors.reading("s", "time")[0] == pytest.approx(tick // 4 * 4 * 0.02)
            assert env.sensors.reading("s", "valid").tolist() == [True]


def test_a_delayed_sensor_shows_what_was_true_then() -> None:
    with made(4, delay={"choice": [0, 2, 5]}) as env:
        env.reset(seed=1)
        delays = np.array([env.streams.draws[i]["sensor/s/delay"] for i in range(4)], dtype=int)
        assert len(set(delays.tolist())) > 1
        past = [truth(env)]
        for tick in range(1, 12):
            go(env, 1)
            past.append(truth(env))
            then = np.maximum(tick - delays, 0)
            expected = np.array([past[when][i] for i, when in enumerate(then)])
            assert np.array_equal(env.sensors.reading("s", "position"), expected)
            assert env.sensors.reading("s", "time") == pytest.approx(then * 0.02)


def test_a_lost_reading_leaves_the_last_one_and_says_so() -> None:
    with made(8, dropout=0.3) as env:
        env.reset(seed=2)
        assert (env.sensors.reading("s", "valid") == 1.0).all(), "the first of an episode is never lost"
        held, lost = env.sensors.reading("s", "position"), 0
        for _ in range(29):
            go(env, 1)
            valid = env.sensors.reading("s", "valid") == 1.0
            expected = np.where(valid[:, None], truth(env), held)
            assert np.array_equal(env.sensors.reading("s", "position"), expected)
            held, lost = expected, lost + int((~valid).sum())
        assert 0.2 < lost / (8 * 29) < 0.4  # 0.3 +- 3.3 sigma


def test_a_quaternion_stays_one_under_noise() -> None:
    with made(noise={"quaternion": {"noise": {"normal": {"mean": 0.0, "std": 0.2}}}}) as env:
        env.reset(seed=0)
        go(env, 3)
        noisy, true = env.sensors.reading("s", "quaternion"), truth(env, "quaternion")
        assert np.linalg.norm(noisy, axis=1) == pytest.approx(1.0, abs=1e-12)
        assert 1e-3 < 1.0 - abs(float((noisy * true).sum())) < 0.2


def test_an_env_reads_the_same_whenever_the_others_are_reset() -> None:
    """Env 1 is reset alone, so that readings of both are due at different control steps."""
    keys = {"rate": 10, "delay": {"choice": [1, 2]}, "dropout": 0.2, "noise": NOISY}
    with made(2, **keys) as env:
        env.reset(seed=5)
        alone = [row[1] for row in (env.obs["policy"], *go(env, 14))]
        env.reset(seed=5)
        again = [env.obs["policy"][1], *(row[1] for row in go(env, 3))]
        env.reset(mask=np.array([True, False]))
        again += [row[1] for row in go(env, 11)]
    assert np.array_equal(alone, again)


def test_a_term_reads_a_field_or_all_of_them_and_is_late_and_noisy_beside() -> None:
    spec = throwing({"s": TRACK})
    spec["task"]["observations"]["policy"] += [{"term": "sensor", "of": "s.time", "delay": 1}]
    with anysim.make(spec) as env:
        env.reset(seed=0)
        rows = go(env, 2)
        assert rows[0].shape == (1, 3 + 4 + 3 + 3 + 1)
        assert [row[0, -1] for row in rows] == pytest.approx([0.0, 0.02])


# ---------------------------------------------------------------------- snapshots and recordings

IMPERFECT = {"rate": 25, "delay": {"choice": [1, 2]}, "dropout": 0.2, "noise": NOISY}
IMU = {"sensor": "imu", "frame": "ball", "noise": {"acceleration": {"walk": 0.1}}}
BOTH = {"s": {**TRACK, **IMPERFECT}, "imu": IMU}


@pytest.fixture(scope="module")
def both() -> Any:
    with anysim.make(throwing(BOTH), num_envs=3) as env:
        yield env


def readings(env: TaskEnv) -> dict[str, bytes]:
    return {name: rows.tobytes() for name, rows in env.sensor_rows(np.arange(env.num_envs)).items()}


def test_a_snapshot_goes_on_with_the_same_bits(both: TaskEnv, tmp_path: Path) -> None:
    both.reset(seed=3)
    go(both, 5)
    snapshot, now = both.snapshot(), readings(both)
    expected = [readings(both) for _ in range(12) if go(both, 1)]
    both.reset(seed=9)
    for one in (snapshot, EnvSnapshot.load(snapshot.save(tmp_path / "s.snapshot"))):
        both.reset_to(one)
        assert readings(both) == now
        assert [readings(both) for _ in range(12) if go(both, 1)] == expected


def test_a_snapshot_in_other_envs_reads_the_same(both: TaskEnv) -> None:
    both.reset(seed=3)
    go(both, 5)
    snapshot = both.snapshot()
    expected = [row for row in go(both, 8)]
    both.reset_to(snapshot.rows([2, 0, 1]))
    assert np.array_equal([row[[1, 2, 0]] for row in go(both, 8)], expected)


def test_a_counterfactual_has_the_same_noise(both: TaskEnv) -> None:
    """Another delay moves no draw: the other sensor reads the same bits. What follows a snapshot has its noise."""
    both.reset(seed=3)
    go(both, 4)
    snapshot = both.snapshot()
    expected = [readings(both) for _ in range(8) if go(both, 1)]
    both.reset(episode_seeds=both.streams.episode_seed.tolist(), overrides={"sensors.s.delay": 0})
    go(both, 4)
    other = [readings(both) for _ in range(8) if go(both, 1)]
    for one, two in zip(expected, other, strict=True):
        assert one["sensor_imu_acceleration"] == two["sensor_imu_acceleration"]
    assert expected[-1]["sensor_s_time"] != other[-1]["sensor_s_time"]
    both.reset_to(snapshot)
    assert [readings(both) for _ in range(8) if go(both, 1)] == expected


def test_a_forged_delay_is_refused(both: TaskEnv) -> None:
    both.reset(seed=0)
    snapshot = both.snapshot()
    sensors = {**snapshot.managers["sensors"], "s.delay": np.array([7, 1, 1])}
    forged = EnvSnapshot(
        snapshot.engine, {**snapshot.managers, "sensors": sensors}, snapshot.streams, snapshot.task, snapshot.spec_hash
    )
    with pytest.raises(SnapshotError, match=r"'s\.delay' is 7, which is not between 0 and 2"):
        both.reset_to(forged)


def recorded(spec: dict[str, Any], out: Path) -> list[Any]:
    with anysim.make({**spec, "record": {"keep": "all", **spec.get("record", {})}}, num_envs=2) as env:
        list(Collector(env, Still(env), out, 4, seed=1).run())
    return [open_trajectory(path) for path in sorted((out / "episodes").iterdir())]


def test_recordings_hold_the_readings_and_replay_to_the_bit(tmp_path: Path) -> None:
    readers = recorded(throwing(BOTH), tmp_path)
    assert len(readers) == 4
    states = readers[0].states
    assert {name for name in states if name.startswith("sensor_")} == {
        *(f"sensor_s_{key}" for key in ("position", "quaternion", "velocity", "angular_velocity", "time", "valid")),
        *(f"sensor_imu_{key}" for key in ("acceleration", "angular_velocity", "time", "valid")),
    }
    assert states["sensor_imu_acceleration"].shape == (30, 3)
    assert states["sensor_s_valid"].dtype == bool
    assert {bool(value) for reader in readers for value in reader.states["sensor_s_valid"]} == {True, False}
    assert len(np.unique(states["sensor_s_position"], axis=0)) > 5
    for path in sorted((tmp_path / "episodes").iterdir()):
        result = replay(path)
        assert result.identical
        assert result.drift.fields["sensor_s_position"].identical


def test_a_recording_whose_valid_is_a_number_still_replays_to_the_bit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as before:  # as it was recorded until 0.1
        before.setitem(EVERY_SENSOR, "valid", SensorField((), "1"))  # pyright: ignore[reportArgumentType]
        (reader, *_) = recorded(throwing(BOTH), tmp_path)
        assert reader.states["sensor_s_valid"].dtype == np.float64
    assert replay(reader.directory).identical


def test_one_more_sensor_changes_no_other_array(tmp_path: Path) -> None:
    one = recorded(throwing({"s": BOTH["s"]}), tmp_path / "one")
    two = recorded(throwing(BOTH), tmp_path / "two")
    none = throwing({}, "s")
    none["world"].pop("sensors")
    none["task"]["observations"] = {"policy": [{"term": "frame_pose", "frame": "ball"}]}
    bare = recorded(none, tmp_path / "none")
    for fewer, more in [*zip(one, two, strict=True), *zip(bare, one, strict=True)]:
        assert set(fewer.states) < set(more.states)
        for name, rows in fewer.states.items():
            assert rows.tobytes() == more.states[name].tobytes(), name
    for fewer, more in zip(one, two, strict=True):
        assert fewer.obs["policy"].tobytes() == more.obs["policy"].tobytes()


def test_a_record_can_leave_sensors_out(tmp_path: Path) -> None:
    (first, *_) = recorded(throwing(BOTH, record={"sensors": ["imu"]}), tmp_path)
    assert {name.split("_")[1] for name in first.states if name.startswith("sensor_")} == {"imu"}


# ---------------------------------------------------------------------- what is refused

WORLD = """
engine: mujoco
world:
  objects: {ball: {source: {sphere: 0.05}}}
  sensors:
    s: %s
"""


@pytest.mark.parametrize(
    ("text", "place", "words"),
    [
        ("{sensor: imou, frame: ball}", "6:17", "no sensor named 'imou' is installed; did you mean 'imu'?"),
        ("{sensor: imu, frame: bal}", "6:29", "there is no entity 'bal'; did you mean 'ball'?"),
        ("{sensor: imu, frame: ball, fram: x}", "6:35", "unknown key; did you mean 'frame'?"),
        ("{sensor: imu}", "6:8", "frame"),
        ("{sensor: imu, frame: ball, rate: 30}", "6:41", "choose 50 or 25 Hz"),
        ("{sensor: imu, frame: ball, rate: 200}", "6:41", "choose 50 Hz"),
        ("{sensor: imu, frame: ball, noise: {accel: {white: 1}}}", "6:50", "(fields: acceleration, angular_velocity)"),
        ("{sensor: imu, frame: ball, noise: {acceleration: {walk_time: 1}}}", "6:69", "no `walk` that could forget"),
        ("{sensor: imu, frame: ball, dropout: 2}", "6:44", "must be at most 1"),
        ("{frame: ball}", "6:8", "it has neither"),
        ("{sensor: imu, place: ball.imu}", "6:8", "give one of them"),
        ("ball.imu", "6:8", "no robot has a sensor 'ball.imu'"),
        ("{sensor: force_torque, frame: ball}", "6:8", "is on nothing that a joint carries"),
    ],
)
def test_a_wrong_declaration_is_told_with_its_place(text: str, place: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "world.yaml"
    path.write_text(WORLD % text)
    faults = report_on(str(path), engine=None, all_engines=False, overrides=[]).faults
    assert any(f"world.yaml:{place}: " in fault and words in fault for fault in faults), faults


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"record": {"sensors": ["t"]}}, r"there is no sensor 't' \(sensors: s\)"),
        ({"task": {"observations": {"policy": [{"term": "sensor", "of": "t"}]}}}, "there is no sensor 't'"),
        ({"task": {"observations": {"policy": [{"term": "sensor", "of": "s.pos"}]}}}, "no field 'pos'"),
    ],
)
def test_names_of_sensors_elsewhere_are_checked(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(AnysimError, match=words):
        anysim.make({**throwing({"s": TRACK}), **changes}).close()


def test_an_engine_without_what_a_sensor_needs_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    from anysim.engine.capability import Capability
    from anysim_sensors.motion.tracking import Tracking

    monkeypatch.setattr(Tracking, "needs", (Capability.RENDER_RGB,))
    with pytest.raises(AnysimError, match=r"null cannot run .*sensor 's' \(render: rgb\) at world\.sensors\.s"):
        anysim.make({**throwing({"s": TRACK}), "engine": "null"}).close()

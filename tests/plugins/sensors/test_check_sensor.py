"""The shipped checks of a sensor: ours pass, and sensors that are wrong in one way each are found."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from anysim import registry
from anysim.conventions import Array
from anysim.sensors.base import Sensor, SensorField
from anysim.task.scene import Frame, SceneView
from anysim.testing.sensors import check_sensor
from tests.plugins.sensors.test_force_torque import HOLDING

SENSORS: dict[str, Any] = {
    "imu": {"sensor": "imu", "frame": "panda.tool", "delay": {"choice": [1, 2]}},
    "wrist": {"sensor": "force_torque", "frame": "panda.panda_link7", "rate": 25},
    "joints": {"sensor": "joints", "robot": "panda", "noise": {"position": {"white": 1e-4, "walk": 1e-3}}},
    "tool": {"sensor": "tracking", "frame": "panda.tool", "relative_to": "cube", "dropout": 0.2},
    "finger": {"sensor": "contact", "of": "finger", "frame": "panda.tool"},
}
WORLD: dict[str, Any] = {
    "engine": "mujoco",
    "world": {
        "robots": {"panda": HOLDING},
        "objects": {"cube": {"source": {"box": [0.04, 0.04, 0.04]}}},
        "layout": {"cube": {"on": "terrain", "x": {"range": [0.4, 0.6]}, "y": 0.0}},
        "contact_sensors": {"finger": {"body": "panda.panda_leftfinger"}},
        "sensors": SENSORS,
    },
}


@pytest.mark.parametrize("name", list(SENSORS))
def test_ours_keep_their_promises(name: str) -> None:
    check_sensor(WORLD, name)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pybullet", "sapien"])
@pytest.mark.parametrize("name", list(SENSORS))
def test_ours_keep_them_on_other_engines(name: str, engine: str) -> None:
    check_sensor(WORLD, name, engine=engine)


class Height(Sensor):
    """Nothing is wrong with it."""

    def __init__(self, scene: SceneView, *, frame: Frame) -> None:
        super().__init__(scene.engine.num_envs)
        self.scene, self.frame = scene, frame
        self.fields = {"height": SensorField((), "m")}
        self.count = np.zeros(scene.engine.num_envs)

    def read(self, env_ids: Array) -> Mapping[str, Array]:
        return {"height": self.frame.position[:, 2] + self.more(env_ids)}

    def more(self, env_ids: Array) -> Any:
        return 0.0


class Hidden(Height):
    """It remembers what no snapshot holds, and begins an episode where the last one ended."""

    def more(self, env_ids: Array) -> Any:
        self.count[env_ids] += 1.0
        return self.count[env_ids]


class Unsaved(Hidden):
    """The same, and it does begin anew."""

    def reset(self, env_ids: Array) -> None:
        self.count[env_ids] = 0.0


class Mixing(Height):
    """Envs see each other."""

    def more(self, env_ids: Array) -> Any:
        return self.scene.state.body_pose[..., 0].mean()


class Dicing(Height):
    """It draws by itself."""

    def more(self, env_ids: Array) -> Any:
        return np.random.default_rng().normal()


class Pushing(Height):
    """It writes what it should look at."""

    def more(self, env_ids: Array) -> Any:
        cube = [self.scene.engine.index.body("cube")]
        self.scene.engine.set_body_state(twist=[[[0.1, 0, 0, 0, 0, 0]]], env_ids=env_ids[:1], bodies=cube)
        return 0.0


class Blind(Height):
    """It sees nothing, in a number that is none."""

    def more(self, env_ids: Array) -> Any:
        return np.inf


class Unitless(Height):
    def __init__(self, scene: SceneView, *, frame: Frame) -> None:
        super().__init__(scene, frame=frame)
        self.fields = {"height": SensorField((), "")}


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (Hidden, "the same episodes again"),
        (Unsaved, "keep what it remembers in `memory`"),
        (Mixing, "when it is alone"),
        (Dicing, "draw nothing but in `noise`"),
        (Pushing, "changes what happens"),
        (Blind, "is not finite"),
        (Unitless, "has no unit"),
    ],
)
def test_wrong_ones_are_found(wrong: type[Height], words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    real = registry.load
    kind = [Height]
    monkeypatch.setattr(registry, "load", lambda k, n: kind[0] if (k, n) == ("sensors", "tracking") else real(k, n))
    world = WORLD["world"] | {"sensors": {"height": {"sensor": "tracking", "frame": "cube"}}}
    check_sensor({**WORLD, "world": world}, "height")
    kind[0] = wrong
    with pytest.raises(AssertionError, match=words):
        check_sensor({**WORLD, "world": world}, "height")


def test_a_sensor_that_is_not_there_is_named() -> None:
    with pytest.raises(AssertionError, match=r"no sensor 'imou' \(sensors: imu, wrist"):
        check_sensor(WORLD, "imou")

"""Tactile sensors in worlds: sums against the engines' contacts, equal depths, promises, and refusals."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

import anysim
from anysim.conventions import Array
from anysim.engine.capability import Capabilities, Capability
from anysim.errors import AnysimError, CapabilityError
from anysim.math import pose as P
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from anysim.testing.kinematic import NullEngine
from anysim.testing.sensors import check_sensor
from anysim_tactile.surfaces import flat

ENGINES = ("mujoco", "pybullet", "sapien")
TOP = 0.02
PAD = {"sensor": "tactile_pad", "frame": "pad", "at": [0, 0, TOP], "size": [0.03, 0.024], "grid": [20, 24]}
PROBE = {
    "sensor": "tactile_probe",
    "frame": "pad",
    "at": [0, 0, TOP],
    "points": [[x, y, 0] for x in (-0.01, 0, 0.01) for y in (-0.008, 0, 0.008)],
    "normals": [[0, 0, 1]],
    "area": 8e-5,
}
TIP = {"sensor": "tactile_fingertip", "frame": "tip", "radius": 0.02, "grid": [24, 24]}
STRIP = {**TIP, "turn": [0, 0, 0.4], "length": 0.03}
BALL = {"sphere": 0.01}
BOX = {"box": [0.014, 0.01, 0.02]}


def spec(engine: str, on: dict[str, Any], things: dict[str, Any], layout: dict[str, Any], **sensors: Any) -> Any:
    return {
        "engine": engine,
        "physics": {"dt": 0.002, "control_dt": 0.01},
        "world": {
            "objects": {**on, **{name: {"source": source, "mass": 0.2} for name, source in things.items()}},
            "layout": layout,
            "sensors": sensors,
        },
        "task": {"horizon": 1000, "observations": {"policy": [{"term": "sensor", "of": next(iter(sensors))}]}},
    }


def block(engine: str, source: dict[str, Any], **sensors: Any) -> dict[str, Any]:
    """A thing on a block whose upper side is at 0.04 m."""
    pad = {"pad": {"source": {"box": [0.04, 0.04, 2 * TOP]}, "fixed": True, "friction": 0.8}}
    layout = {"pad": {"position": [0, 0, TOP]}, "thing": {"position": [0.001, -0.0005, 2 * TOP + 0.01]}}
    return spec(engine, pad, {"thing": source}, layout, **sensors)


def tip(engine: str, **sensors: Any) -> dict[str, Any]:
    """A plate that a fixed ball carries at its middle."""
    on = {"tip": {"source": {"sphere": 0.02}, "fixed": True, "friction": 1.0}}
    layout = {"tip": {"position": [0, 0, 0.1]}, "thing": {"position": [0, 0, 0.1225]}}
    return spec(engine, on, {"thing": {"box": [0.06, 0.06, 0.005]}}, layout, **sensors)


@contextmanager
def settled(
    world: dict[str, Any], steps: int, gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
) -> Iterator[TaskEnv]:
    world["physics"]["gravity"] = list(gravity)
    with anysim.make(world) as env:
        env.reset(seed=0)
        for _ in range(steps):
            env.step(np.zeros((1, env.action_dim)))
        yield env


def seen(env: TaskEnv, name: str) -> dict[str, Array]:
    assert env.sensors is not None
    return {key: env.sensors.reading(name, key)[0] for key in env.sensors.fields(name)}


def engines_wrench(env: TaskEnv, body: str, frame: Array) -> Array:
    """(6,) of the engine's contact points on a body, about and in the axes of a frame."""
    found, number = env.engine.contacts(), env.engine.index.body(body)
    sign = (found.body_b == number).astype(float) - (found.body_a == number)
    force = sign[:, None] * found.force
    moment = np.cross(found.position - frame[:3], force)
    return np.concatenate([P.rotate_inverse(frame[3:], rows.sum(axis=0)) for rows in (force, moment)])


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("thing", [BALL, BOX], ids=["ball", "box"])
def test_sums_are_the_engines_force_and_moment(engine: str, thing: dict[str, Any]) -> None:
    """Of a ball that is pushed aside, and of a box that friction holds, by all three sources and two forms."""
    require_engine(engine)
    forms = {
        "rays": PAD,
        "near": {**PAD, "source": "distance"},
        "points": {**PAD, "source": "contacts"},
        "turned": {**PAD, "turn": [0.0, 0.0, 0.7]},
        "probe": PROBE,
    }
    gravity, steps = ((1.5, -1.0, -9.81), 40) if thing is BOX else ((0.0, 0.0, -9.81), 20)
    with settled(block(engine, thing, **forms), steps, gravity) as env:
        for name, form in forms.items():
            turn = P.from_roll_pitch_yaw(np.array(form.get("turn", [0.0, 0.0, 0.0])))
            expected = engines_wrench(env, "pad", P.pose((0, 0, 2 * TOP), turn))
            reading = seen(env, name)
            assert -expected[2] == pytest.approx(0.2 * 9.81, rel=0.02)
            assert reading["force"] == pytest.approx(expected[:3], abs=1e-9)
            assert reading["moment"] == pytest.approx(expected[3:], abs=1e-9)
            assert reading["moment_error"] < 1e-9
            assert reading["pressure"].min() >= 0.0
            area = 8e-5 if name == "probe" else flat((0.03, 0.024), (20, 24)).area.reshape(20, 24)
            assert (reading["pressure"] * area).sum() == pytest.approx(-expected[2], abs=1e-9)
            assert reading["shear"].reshape(-1, 2).sum(axis=0) == pytest.approx(expected[:2], abs=1e-9)
            if thing is BOX:  # also on SAPIEN, whose library reports no friction
                assert np.linalg.norm(reading["shear"].reshape(-1, 2).sum(axis=0)) == pytest.approx(0.36, rel=0.05)


@pytest.mark.parametrize("engine", ENGINES)
def test_sums_of_a_curved_skin(engine: str) -> None:
    require_engine(engine)
    forms = {"tip": TIP, "strip": STRIP, "points": {**TIP, "source": "contacts"}}
    with settled(tip(engine, **forms), 30, (1.0, 0.5, -9.81)) as env:
        for name, form in forms.items():
            turn = P.from_roll_pitch_yaw(np.array(form.get("turn", [0.0, 0.0, 0.0])))
            expected, reading = engines_wrench(env, "tip", P.pose((0, 0, 0.1), turn)), seen(env, name)
            assert abs(expected[2]) > 1.5
            assert reading["force"] == pytest.approx(expected[:3], abs=1e-9)
            assert reading["moment"] == pytest.approx(expected[3:], abs=1e-9)
            assert reading["pressure"].min() >= 0.0
            assert reading["moment_error"] < 1e-9


def test_the_force_of_a_contact_sensor_is_the_same() -> None:
    for engine in ENGINES:
        require_engine(engine)
        world = block(engine, BALL, pad=PAD)
        world["world"]["contact_sensors"] = {"felt": {"body": "pad"}}
        with settled(world, 60) as env:
            assert seen(env, "pad")["force"] == pytest.approx(env.engine.get_state().contact_force[0, 0], abs=1e-6)


def test_what_is_beside_the_taxels_is_not_felt() -> None:
    with settled(block("mujoco", BALL, pad={**PAD, "at": [0.0, 0.0, 0.0], "turn": [3.14159, 0, 0]}), 20) as env:
        reading = seen(env, "pad")
    assert not reading["force"].any()
    assert not reading["pressure"].any()


@pytest.mark.parametrize("source", ["rays", "distance"])
def test_depths_are_equal_on_engines_for_equal_poses(source: str) -> None:
    """A box and a ball that are written into the skin, in poses that SAPIEN can have."""
    form = {**PAD, "source": source}
    ball = {**TIP, "source": source}
    poses: Array | None = None
    found: dict[str, list[Array]] = {}
    for engine in ("sapien", "mujoco", "pybullet"):
        require_engine(engine)
        world = block(engine, BOX, pad=form)
        world["world"]["objects"]["tip"] = {"source": {"sphere": 0.02}, "fixed": True}
        world["world"]["objects"]["plate"] = {"source": {"box": [0.06, 0.06, 0.005]}, "mass": 0.1}
        world["world"]["layout"] |= {"tip": {"position": [0.3, 0, 0.1]}, "plate": {"position": [0.3, 0, 0.1225]}}
        world["world"]["sensors"]["tip"] = ball
        with anysim.make(world) as env:
            env.reset(seed=0)
            if poses is None:
                poses = env.engine.get_state().body_pose.copy()
                turn = P.from_roll_pitch_yaw(np.array([0.05, 0.1, 0.3]))
                poses[0, env.engine.index.body("thing")] = P.pose((0.002, 0.001, 2 * TOP + 0.009), turn)
                poses[0, env.engine.index.body("plate")] = P.pose((0.3, 0, 0.1217), turn)
            free = [env.engine.index.body(name) for name in ("thing", "plate")]
            env.engine.set_body_state(pose=poses[:, free], bodies=free)
            poses = env.engine.get_state().body_pose.copy()
            assert env.sensors is not None
            env.scene.look(None)
            env.sensors.begin(np.array([0]))
            found[engine] = [seen(env, name)["depth"] for name in ("pad", "tip")]
    for engine in ("mujoco", "pybullet"):
        for ours, theirs in zip(found["sapien"], found[engine], strict=True):
            assert (ours > 0).sum() > 10
            assert np.abs(ours - theirs).max() < 1e-6


@pytest.mark.parametrize("name", ["pad", "probe", "tip"])
def test_promises(name: str) -> None:
    """Of sensors on a block with a ball that rolls, and of one with noise, delay and losses."""
    noise = {"pressure": {"white": 1.0, "bias": {"normal": {"mean": 0, "std": 100}}}}
    forms = {
        "pad": {**PAD, "grid": [8, 8], "image": [12, 16], "delay": {"choice": [0, 2]}, "dropout": 0.2, "noise": noise},
        "probe": PROBE,
        "tip": {**TIP, "frame": "pad", "grid": [6, 6], "image": [9, 9]},
    }
    world = block("mujoco", BALL, **{name: forms[name]})
    world["world"]["objects"]["thing"]["mass"] = {"range": [0.1, 0.3]}
    check_sensor(world, name)


def test_an_image_with_noise_stays_in_its_range() -> None:
    noise = {"image": {"noise": {"normal": {"mean": 0, "std": 400}}}}
    with settled(block("mujoco", BALL, pad={**PAD, "image": [6, 8], "noise": noise}), 1) as env:
        image = seen(env, "pad")["image"]
    assert image.dtype == np.uint8
    assert ((image == 0) | (image == 255)).mean() > 0.5


def test_refusals() -> None:
    with pytest.raises(AnysimError, match=r"there is no|is on no body"):
        anysim.make(block("mujoco", BALL, pad={**PAD, "frame": "terrain"}))
    with pytest.raises(AnysimError, match=r"there is no light 'gelsigth'; did you mean 'gelsight'"):
        anysim.make(block("mujoco", BALL, pad={**PAD, "light": "gelsigth"}))
    with pytest.raises(AnysimError, match="give one normal for all 9 points, or one for each; there are 2"):
        anysim.make(block("mujoco", BALL, probe={**PROBE, "normals": [[0, 0, 1]] * 2}))


def test_engines_that_report_no_contacts_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    every = NullEngine.capabilities.supported.items()
    without = Capabilities({key: one for key, one in every if key is not Capability.CONTACT_POINTS})
    monkeypatch.setattr(NullEngine, "capabilities", without)
    with pytest.raises(CapabilityError, match=r"sensor 'pad' \(contact points\) at world.sensors.pad"):
        anysim.make(block("null", BALL, pad=PAD))


def test_a_guess_is_called_uncalibrated() -> None:
    form = {**PAD, "image": [6, 8], "light": "uncalibrated_three_leds"}
    with settled(block("mujoco", BALL, pad=form), 1) as env:
        assert env.sensors is not None
        assert "uncalibrated" in env.sensors.fields("pad")["image"].axes

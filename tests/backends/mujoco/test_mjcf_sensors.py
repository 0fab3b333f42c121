"""Sensors of MJCF files: those of worlds read what MuJoCo reads; the others are named."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from anysim.api import load, make
from anysim.assets.catalogue import load_robot
from anysim.assets.model import Fate
from anysim.compile.world import compile_with_report
from anysim.math import pose as P
from anysim_mujoco.mjcf import coverage
from anysim_mujoco.mjcf.load import import_mjcf
from anysim_mujoco.mjcf.sensors import KINDS, tag_of
from anysim_robots.drafting.draft import draft
from anysim_schemas.robot_model import SolidSpec
from anysim_tactile.zone import meets

SCENE = """<mujoco model="felt"><option timestep="0.002" integrator="implicitfast" cone="elliptic"/><worldbody>
  <geom name="floor" type="plane" size="4 4 .1"/>
  <body name="crate" pos="0 0 0.099"><freejoint/><geom name="crate" type="box" size=".2 .15 .1" mass="3"/>
    <site name="sole" type="box" size=".3 .2 .01" pos="0 0 -.1"/>
      <site name="half" type="box" size=".1 .2 .01" pos=".2 0 -.1"/>
    <site name="lid" type="sphere" size=".05" pos="0 0 .1"/>
      <site name="rim" type="cylinder" size=".05 .2" pos=".2 .15 -.3"/>
    <site name="pin" type="capsule" size=".02 .05" pos="-.2 .15 -.2"/>
      <site name="egg" type="ellipsoid" size=".1 .1 .1"/></body>
  <body name="arm" pos="1 0 1.5"><joint name="swing" axis="0 1 0" damping="0.5" ref="0"/>
    <geom name="rod" type="capsule" fromto="0 0 0 0.3 0 0" size=".02" mass="1" contype="0" conaffinity="0"/>
    <site name="unit" pos=".1 .02 0" euler="0 30 20"/>
    <body name="wrist" pos=".3 0 0"><joint name="bend" axis="0 0 1" stiffness="3"/>
      <site name="eye" pos="0 0 -.03" euler="180 0 0"/>
      <geom name="hand" type="box" size=".05 .03 .02" pos=".05 .01 0" mass=".4" contype="0" conaffinity="0"/>
      <site name="flange" pos="0.01 0 0" euler="10 20 30"/>
      <body name="nail" pos=".1 0 0"><geom size=".01" mass=".1" contype="0" conaffinity="0"/><site name="tip"/>
      </body></body></body>
  </worldbody>
  <sensor><touch name="sole" site="sole"/><touch name="half" site="half"/><touch name="lid" site="lid"/>
      <touch name="rim" site="rim"/>
    <touch name="pin" site="pin"/><touch name="egg" site="egg"/>
    <accelerometer name="unit_acc" site="unit"/><gyro name="unit_gyro" site="unit"/>
    <force name="force" site="flange"/><torque name="torque" site="flange"/><force name="nail" site="tip"/>
    <rangefinder name="down" site="eye" cutoff="5"/>
    <framepos name="wrist_pos" objtype="xbody" objname="wrist"/>
    <framequat name="wrist_quat" objtype="xbody" objname="wrist"/>
    <framelinvel name="wrist_vel" objtype="xbody" objname="wrist"/>
    <frameangvel name="wrist_rate" objtype="xbody" objname="wrist"/>
    <framepos name="com" objtype="body" objname="wrist"/>
    <framepos name="seen" objtype="site" objname="tip" reftype="site" refname="unit"/>
    <jointpos name="angle" joint="swing"/><clock name="now"/><velocimeter site="unit"/>
  </sensor></mujoco>"""


ARM = """<mujoco><worldbody><body name="base"><geom name="block" size=".1" mass="5"/>
  <body name="link" pos="0 0 .3"><joint name="turn" axis="0 1 0" range="-1 1"/><geom name="rod" size=".05" mass="1"/>
    <site name="unit"/>
    <body name="wrist" pos="0 0 .3"><joint name="bend" axis="0 1 0" range="-1 1"/>
      <geom name="fist" size=".05" mass="1"/>
      <site name="wrist_site" euler="0 0 45"/><site name="pad" size=".1"/></body></body></body></worldbody>
  <sensor><accelerometer name="unit_acc" site="unit" noise="0.1"/><gyro name="unit_gyro" site="unit" cutoff="30"/>
    <force name="flange_force" site="wrist_site"/><torque name="flange_torque" site="wrist_site"/>
    <rangefinder name="ahead" site="unit"/><touch name="tip" site="pad"/><jointpos joint="turn"/></sensor></mujoco>"""


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("felt") / "felt.xml"
    made.write_text(SCENE)
    return made


def readings(model: mujoco.MjModel, values: np.ndarray) -> dict[str, np.ndarray]:
    """Those of MuJoCo by name."""
    places = [slice(a, a + n) for a, n in zip(model.sensor_adr, model.sensor_dim, strict=True)]
    return {model.sensor(s).name: values[place] for s, place in enumerate(places)}


def test_sensors_of_a_scene_read_what_mujoco_reads(file: Path) -> None:
    """A crate that comes to rest and an arm that swings: exact but for what a device averages, which is so to O(dt)."""
    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)
    run = {
        "engine": {"name": "mujoco", "options": {"constraints": "mujoco"}},
        "world": {"source": str(file)},
        "physics": {"control_dt": 0.002},
        "task": {"observations": {"policy": [{"term": "sensor", "of": "unit"}]}},
    }
    same = {
        ("wrist", "position"): "wrist_pos",
        ("wrist", "velocity"): "wrist_vel",
        ("wrist", "angular_velocity"): "wrist_rate",
        ("unit", "angular_velocity"): "unit_gyro",
        **{(zone, "force"): zone for zone in ("sole", "half", "lid", "rim", "pin")},
    }
    averages = {("unit", "acceleration"): "unit_acc", ("flange", "force"): "force", ("flange", "torque"): "torque"}
    far: dict[str, float] = {}
    pressed: set[str] = set()
    with make(run) as env:
        read = lambda name, field: env.sensors.reading(name, field)[0]  # noqa: E731
        env.reset(seed=0)
        mujoco.mj_forward(model, data)
        for _ in range(160):
            before = readings(model, data.sensordata.copy())
            mujoco.mj_step(model, data)
            mujoco.mj_forward(model, data)
            now = readings(model, data.sensordata)
            env.step([[]])
            for (name, field), key in same.items():
                far[key] = max(far.get(key, 0.0), float(np.abs(read(name, field) - now[key]).max()))
                pressed |= {key} if field == "force" and now[key][0] > 1 else set()
            for (name, field), key in averages.items():
                middle = 0.5 * (before[key] + now[key])
                far[key] = max(far.get(key, 0.0), float(np.abs(read(name, field) - middle).max()))
            far["down"] = max(far.get("down", 0.0), abs(float(read("down", "range")[0] - now["down"][0])))
            turn = P.angle_between(read("wrist", "quaternion"), now["wrist_quat"][[1, 2, 3, 0]])
            far["turn"] = max(far.get("turn", 0.0), float(turn))
    assert pressed == {"sole", "half", "rim", "pin"}
    assert {key: value for key, value in far.items() if key in same.values() and value > 1e-9} == {}
    assert far["turn"] < 1e-7
    assert far["down"] < 1e-6
    assert far["unit_acc"] < 0.03  # [m/s^2], of more than 10
    assert far["force"] < 0.15  # [N], of up to 15
    assert far["torque"] < 0.01


def test_what_no_sensor_reads_is_named(file: Path) -> None:
    run = load({"engine": "mujoco", "world": {"source": str(file)}})
    sensors = run.spec.world.sensors
    assert sensors is not None
    assert set(sensors) == {"sole", "half", "lid", "rim", "pin", "unit", "flange", "down", "wrist"}
    told = [text for world in (compile_with_report(run.spec).report.values()) for text in map(str, world)]
    told += [f"{where}: {text}" for _, where, text in run.spec.world.source.notes or ()]
    for words in (
        "a touch is left out: its zone is of type ellipsoid (1: egg)",
        "a force is left out: no joint is between its body and another",
        "a framepos is left out: it is of the inertial frame of a body",
        "a framepos is left out: it is seen from a frame of the file",
        "a velocimeter is left out: `tracking`",
        "on no body are left out (2: angle, now)",
    ):
        assert any(words in text for text in told), words


def test_every_sensor_of_mujoco_has_a_row() -> None:
    """By MuJoCo's own list, whose new ones need a decision."""
    model = mujoco.MjModel.from_xml_string("<mujoco><sensor><clock/></sensor></mujoco>")
    for kind in mujoco.mjtSensor.__members__.values():
        model.sensor_type[0] = int(kind)
        tag = tag_of(model, 0)
        row = coverage.sensor_row(tag)
        assert row is not None, tag
        assert (row.fate is Fate.LEFT_OUT) == (tag not in KINDS), tag


def test_a_draft_places_the_sensors_of_its_file(tmp_path: Path) -> None:
    """A catalogue's entry has them as places; the world reads them by name."""
    (tmp_path / "arm.xml").write_text(ARM)
    made = draft(tmp_path / "arm.xml")
    (tmp_path / "arm.yaml").write_text(made.text(tmp_path))
    sensors = load_robot(str(tmp_path / "arm.yaml")).spec.sensors
    assert {name: (one.kind, one.link) for name, one in sensors.items()} == {
        "unit_sensor": ("imu", "unit"),
        "flange": ("force_torque", "wrist_site"),
        "ahead": ("lidar", "unit"),
        "tip": ("touch", "pad"),
    }
    assert sensors["flange"].params == {"on": "link"}
    assert sensors["tip"].params == {"zone": {"sphere": 0.1}}
    world = {
        "robots": {"arm": {"robot": str(tmp_path / "arm.yaml"), "actions": {"arm": "joint_position"}}},
        "sensors": {name: f"arm.{name}" for name in sensors},
    }
    policy = [{"term": "sensor", "of": name} for name in sensors]
    with make({"engine": "mujoco", "world": world, "task": {"observations": {"policy": policy}}}) as env:
        env.reset(seed=0)
        assert env.sensors.reading("flange", "force").shape == (1, 3)
    notes = [str(note) for note in import_mjcf(tmp_path / "arm.xml", root=tmp_path).report]
    assert "sensors: `imu`: drafts and scenes have it, an asset has none (2: unit_acc, unit_gyro) (info)" in notes
    assert "sensors: `noise` is left out, as MuJoCo itself adds none; `noise` of a world's sensor has it" in str(notes)
    assert "sensors: readings of a gyro have no `cutoff` (1: unit_gyro) (dropped)" in notes


@pytest.mark.parametrize(
    ("zone", "kind", "size"),
    [
        ({"box": (0.4, 0.2, 0.6)}, mujoco.mjtGeom.mjGEOM_BOX, (0.2, 0.1, 0.3)),
        ({"sphere": 0.3}, mujoco.mjtGeom.mjGEOM_SPHERE, (0.3, 0, 0)),
        ({"cylinder": (0.2, 0.6)}, mujoco.mjtGeom.mjGEOM_CYLINDER, (0.2, 0.3, 0)),
        ({"capsule": (0.2, 0.6)}, mujoco.mjtGeom.mjGEOM_CAPSULE, (0.2, 0.3, 0)),
    ],
)
def test_zones_are_met_as_mujoco_has_it(zone: dict[str, object], kind: int, size: tuple[float, ...]) -> None:
    """Rays from in and out of each solid; some along its axes, some that start at its middle."""
    random = np.random.default_rng(0)
    start, along = random.uniform(-0.6, 0.6, (400, 3)), random.normal(size=(400, 3))
    along[:60] = np.eye(3)[np.arange(60) % 3] * np.where(np.arange(60) % 2, 1.0, -1.0)[:, None]
    start[60:80] = 0.0
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    theirs = [
        mujoco.mju_rayGeom(np.zeros(3), np.eye(3).ravel(), np.array(size), p, v, kind, None) >= 0
        for p, v in zip(start, along, strict=True)
    ]
    ours = meets(SolidSpec.model_validate(zone), start, along)
    assert 40 < sum(theirs) < 340
    assert ours.tolist() == theirs

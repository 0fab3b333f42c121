"""Forces at wrists and of contacts against statics, on each engine."""

from typing import Any

import numpy as np
import pytest

import anysim
from anysim.math import pose as P
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from tests.plugins.sensors.test_imu import ENGINES, TURNING, G

HOLDING = {"robot": "franka_panda", "actions": {"arm": "joint_delta_position", "eef": "gripper_binary"}}


def panda(engine: str, **world: Any) -> dict[str, Any]:
    """An arm that holds still, with a sensor at its wrist."""
    return {
        "engine": engine,
        "world": {
            "robots": {"panda": HOLDING},
            "sensors": {"wrist": {"sensor": "force_torque", "frame": "panda.panda_link7"}},
            **world,
        },
        "task": {"horizon": 5000, "observations": {"policy": [{"term": "sensor", "of": "wrist"}]}},
    }


def weight(env: TaskEnv, link: str) -> tuple[np.ndarray, np.ndarray]:
    """The weight (3,) [N] of a link and all beyond, and its torque [N m] about the link's frame, in its axes."""
    world, body = env.engine.world, env.engine.index.body(link)
    pose = env.engine.get_state().body_pose[0]
    force, torque = np.zeros(3), np.zeros(3)
    for one in world.carried_by(body):
        own = world.bodies[one].inertial
        pull = np.array([0, 0, -G * own.mass])
        centre = pose[one, :3] + P.rotate(pose[one, 3:], np.array(own.com))
        force, torque = force + pull, torque + np.cross(centre - pose[body, :3], pull)
    return P.rotate_inverse(pose[body, 3:], force), P.rotate_inverse(pose[body, 3:], torque)


@pytest.mark.parametrize("engine", ENGINES)
def test_at_rest_a_wrist_reads_the_weight_beyond_it(engine: str) -> None:
    require_engine(engine)
    with anysim.make(panda(engine)) as env:
        env.reset(seed=0)
        for _ in range(50):
            env.step(np.zeros((1, env.action_dim)))
        force, torque = weight(env, "panda.panda_link7")
        assert np.linalg.norm(force) > 8.0  # a flange and a hand of 1.5 kg
        assert env.sensors.reading("wrist", "force")[0] == pytest.approx(force, abs=0.02)
        assert env.sensors.reading("wrist", "torque")[0] == pytest.approx(torque, abs=0.005)


@pytest.mark.parametrize("engine", ENGINES)
def test_what_is_held_weighs_too(engine: str) -> None:
    """A cube between the fingers, lifted by the expert of the task: its weight is in the contacts alone."""
    require_engine(engine)
    from anysim.skills.runner import SkillPolicy

    mass = 0.4
    overrides = (
        f"world.objects.cube.mass={mass}",
        "world.sensors={wrist: {sensor: force_torque, frame: panda.panda_link7}}",
        "world.cameras=null",
        "record.cameras=[]",
        "task.hold=60",
    )
    with anysim.make("pick_cube", engine=engine, overrides=overrides) as env:
        policy = SkillPolicy(env)
        env.reset(seed=1)
        policy.begin(np.array([0]))
        pulls = []
        while env.running[0]:
            env.step(policy.act(np.array([0])))
            pose = env.engine.get_state().body_pose[0, env.engine.index.body("panda.panda_link7")]
            pulls.append(P.rotate(pose[3:], env.sensors.reading("wrist", "force")[0])[2])
        assert env.status[0] == "success"
        hand = float(np.linalg.norm(weight(env, "panda.panda_link7")[0]))
        assert -np.mean(pulls[-30:]) - hand == pytest.approx(mass * G, rel=0.02)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_joint_that_turns_feels_its_load_pulled_inwards(engine: str) -> None:
    """2 kg at 0.15 m, at 2 rad/s about the vertical: m w^2 r outwards at the axis, the weight, and its torque."""
    require_engine(engine)
    arm = {"robot": str(TURNING), "position": [0, 0, 1], "actions": {"arm": "joint_velocity"}}
    spec = panda(engine, robots={"arm": arm}, sensors={"wrist": "arm.wrist"})
    with anysim.make(spec) as env:
        env.reset(seed=0)
        for _ in range(100):
            env.step(np.full((1, 1), 2.0))
        outwards = 2.0 * 4.0 * 0.15
        assert env.sensors.reading("wrist", "force")[0] == pytest.approx([outwards, 0, -2 * G], abs=0.03)
        assert env.sensors.reading("wrist", "torque")[0] == pytest.approx([0, 0.15 * 2 * G, 0], abs=0.02)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_resting_box_is_carried_by_its_contacts(engine: str) -> None:
    require_engine(engine)
    spec = {
        "engine": engine,
        "world": {
            "objects": {"box": {"source": {"box": [0.1, 0.1, 0.1]}, "mass": 2.0}},
            "layout": {"box": {"on": "terrain", "x": 0.0, "y": 0.0, "yaw": 0.7}},
            "contact_sensors": {"felt": {"body": "box"}},
            "sensors": {
                "world": {"sensor": "contact", "of": "felt"},
                "own": {"sensor": "contact", "of": "felt", "frame": "box"},
            },
        },
        "task": {"observations": {"policy": [{"term": "sensor", "of": "world.force"}]}},
    }
    with anysim.make(spec) as env:
        env.reset(seed=0)
        for _ in range(100):
            env.step(np.zeros((1, 0)))
        force = env.sensors.reading("world", "force")
        assert force[0] == pytest.approx([0, 0, 2 * G], abs=0.02 * 2 * G)
        turn = env.engine.get_state().body_pose[:, 0, 3:]
        assert env.sensors.reading("own", "force") == pytest.approx(P.rotate_inverse(turn, force), abs=1e-12)

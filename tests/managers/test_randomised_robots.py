"""Robots, gravity, actions and observations that differ between episodes: drawn, read back, and felt."""

from typing import Any

import numpy as np
import pytest

import anysim
from anysim.api import check_engine, compile_world, load
from anysim.engine.factory import engine_class
from anysim.errors import CapabilityError, SpecError
from anysim.randomization.draw import noise_rows
from anysim.randomization.streams import Streams
from anysim.task.env import TaskEnv
from anysim.testing.kinematic import NullEngine
from anysim_inspect.draws import explain
from anysim_schemas.values import Choice, Normal, NormalParameters, Range
from tests.task.helpers import BLIND, arm, blocks

ENGINES = ("mujoco", "pybullet", "sapien")
SCALES = {
    "actuator.kp": "kp_scale", "actuator.kd": "kd_scale", "actuator.effort_limit": "effort_limit_scale",
    "joint.armature": "armature_scale", "body.mass": "mass_scale", "geom.friction": "link_friction_scale",
}  # fmt: skip
ROBOT = "world.robots.panda"
DELTA = "controller: joint_delta_position"
DYNAMICS = (
    f"{ROBOT}.dynamics={{" + ", ".join(f"{field}: {{range: [0.8, 1.25]}}" for field in SCALES.values()) + ","
    " damping_offset: {range: [0.1, 0.5]}, friction_offset: {range: [0.01, 0.1]},"
    " payload: {link: panda_link7, mass: {range: [0.1, 0.6]}}}"
)
TERMS = (
    "physics.gravity={range: [[0, 0, -10.5], [0, 0, -9]]}",
    f"{ROBOT}.position={{range: [[-0.15, -0.05, 0.4], [-0.05, 0.05, 0.4]]}}",
    f"{ROBOT}.yaw={{range: [-0.2, 0.2]}}",
    f"{ROBOT}.home.panda_joint1={{range: [-0.3, 0.3]}}",
    f"{ROBOT}.home_velocity.panda_joint2={{normal: {{mean: 0, std: 0.1}}}}",
    DYNAMICS,
    f"{ROBOT}.actions.arm={{{DELTA}, noise: {{range: [-0.1, 0.1]}}, delay: {{range: [0, 3]}}}}",
    "task.observations.policy.0={term: joint_pos, noise: {normal: {mean: 0, std: 0.01}}, bias: {range: [-0.1, 0.1]},"
    " delay: {range: [0, 2]}}",
    "world.lights.key.intensity={range: [0.2, 0.9]}",
    "world.scenery.background={choice: [red, blue]}",
    "world.cameras.front.fov={range: [30, 60]}",
    "world.cameras.front.exposure={range: [0.8, 1.2]}",
)
"""One of each kind."""


def drawn(env: TaskEnv, name: str) -> Any:
    return np.array([draws[name] for draws in env.streams.draws])


@pytest.mark.parametrize("engine", ENGINES)
def test_what_is_drawn_for_a_robot_is_what_the_engine_has(engine: str) -> None:
    with arm(3, *TERMS[:6], engine=engine) as env:
        world, index = env.engine.world, env.engine.index
        env.reset(seed=5)
        entity = index.entity("panda")
        links = [i for i in range(entity.body_start + 1, entity.body_stop)]
        joints = list(range(entity.joint_start, entity.joint_stop))
        hand = index.body("panda.panda_link7")
        for parameter, field in SCALES.items():
            scale = drawn(env, f"robot/panda/{field}")
            assert len(set(scale)) == 3
            if parameter.startswith("actuator"):
                which = [i for i, a in enumerate(world.actuators) if np.isfinite(a.effort_limit)]
            elif parameter.startswith("joint"):
                which = joints
            elif parameter.startswith("body"):
                which = [i for i in links if i != hand]
            else:
                which = [i for i in index.geoms_of(entity) if world.geoms[i].collides]
            things = getattr(world, parameter.split(".")[0].replace("body", "bodie") + "s")
            name = parameter.split(".")[1]
            built = np.array(
                [
                    t.inertial.mass
                    if name == "mass"
                    else t.surface.friction
                    if name == "friction"
                    else getattr(t, name)
                    for t in (things[i] for i in which)
                ]
            )
            middle = 0.5 * (0.8 + 1.25)  # the World has it already
            assert np.allclose(
                env.engine.get_parameters(parameter, indices=which), scale[:, None] / middle * built, rtol=1e-5
            )
        damping = np.array([world.joints[j].damping for j in joints]) - 0.3
        got = env.engine.get_parameters("joint.damping", indices=joints)
        assert np.allclose(got, damping + drawn(env, "robot/panda/damping_offset")[:, None], atol=1e-6)
        load = world.bodies[hand].inertial.mass - 0.35
        carried = load * drawn(env, "robot/panda/mass_scale") / middle + drawn(env, "robot/panda/payload")
        assert np.allclose(env.engine.get_parameters("body.mass", indices=[hand])[:, 0], carried, rtol=1e-5)
        assert np.allclose(env.engine.get_parameters("world.gravity")[:, 0], drawn(env, "physics/world/gravity"))
        state = env.engine.get_state()
        base = state.body_pose[:, entity.root]
        assert np.allclose(base[:, :3], drawn(env, "robot/panda/position"), atol=1e-6)
        assert np.allclose(2 * np.arctan2(base[:, 5], base[:, 6]), drawn(env, "robot/panda/yaw"), atol=1e-6)
        first, second = index.joint("panda.panda_joint1"), index.joint("panda.panda_joint2")
        noise = drawn(env, "robot/panda.panda_joint1/home_noise")
        assert np.allclose(state.joint_pos[:, first], drawn(env, "robot/panda/home/panda_joint1") + noise, atol=1e-6)
        assert np.allclose(state.joint_vel[:, second], drawn(env, "robot/panda/home_velocity/panda_joint2"), atol=1e-6)


@pytest.mark.parametrize("engine", ENGINES)
def test_things_fall_by_the_gravity_that_was_drawn(engine: str) -> None:
    spec = {
        "engine": engine,
        "physics": {"gravity": {"range": [[-1.0, 0.0, -12.0], [1.0, 0.0, -2.0]]}},
        "world": {"objects": {"ball": {"source": {"sphere": 0.1}}}, "layout": {"ball": {"position": [0, 0, 50.0]}}},
        "task": {"observations": {"policy": [{"term": "frame_pose", "frame": "ball"}]}},
    }
    with anysim.make(spec, num_envs=3) as env:
        env.reset(seed=1)
        gravity = drawn(env, "physics/world/gravity")
        assert np.allclose(env.engine.get_parameters("world.gravity")[:, 0], gravity, atol=1e-6)
        env.engine.step(100)
        speed = env.engine.get_state().body_twist[:, env.engine.index.body("ball"), :3]
        assert np.allclose(speed, gravity * 100 * 0.002, rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("engine", ENGINES)
def test_gains_set_the_time_constant_of_a_joint(engine: str) -> None:
    """A drive with much damping follows x' = kp / kd (x* - x): half the stiffness, twice the time."""
    gains = f"{ROBOT}.dynamics={{kp_scale: {{choice: [0.5, 1.0]}}}}"
    with arm(6, gains, f"{ROBOT}.home_noise=0.0", engine=engine) as env:
        env.reset(seed=3)
        joint = env.engine.index.joint("panda.panda_joint7")
        drive = env.engine.index.actuator("panda.panda_joint7")
        start = env.engine.get_state().joint_pos[:, joint].copy()
        env.engine.set_control(position=start[:, None] + 0.05, actuators=[drive])
        env.engine.step(25)
        left = 1 - (env.engine.get_state().joint_pos[:, joint] - start) / 0.05
        actuator, scale = env.engine.world.actuators[drive], drawn(env, "robot/panda/kp_scale")
        assert set(scale) == {0.5, 1.0}
        # the World has the first choice, half of the catalogue's stiffness
        rate = 2 * actuator.kp * scale / actuator.kd
        assert np.allclose(np.log(left), -rate * 25 * 0.002, rtol=0.06)


# ---------------------------------------------------------------------- actions


def targets(steps: int, *overrides: str, engine: str = "null") -> np.ndarray:
    """Drive targets (T + 1, A) of one env under a tape of actions."""
    with arm(1, f"{ROBOT}.home_noise=0.0", *overrides, engine=engine) as env:
        env.reset(seed=0)
        rng = np.random.default_rng(3)
        rows = [env.engine.control.position[0].copy()]
        for _ in range(steps):
            env.step(rng.uniform(-1, 1, (1, env.action_dim)))
            rows.append(env.engine.control.position[0].copy())
    return np.stack(rows)[:, :7]


@pytest.mark.parametrize("delay", [1, 3])
def test_a_delay_moves_the_response_by_whole_steps(delay: int) -> None:
    plain = targets(12)
    late = targets(12, f"{ROBOT}.actions.arm={{{DELTA}, params: {{scale: 0.06}}, delay: {delay}}}")
    assert np.array_equal(late[: delay + 1], np.repeat(plain[:1], delay + 1, axis=0))
    assert np.allclose(late[delay:], plain[: 13 - delay], rtol=0, atol=1e-15)


def test_whole_numbers_are_drawn_with_both_ends_equally_often() -> None:
    with arm(400, TERMS[6]) as env:
        env.reset(seed=0)
        counts = np.bincount(drawn(env, "robot/panda/arm/delay").astype(int), minlength=4)
    assert len(counts) == 4
    assert (np.abs(counts - 100) < 40).all()  # 4.6 standard deviations


@pytest.mark.parametrize(
    ("value", "mean", "std"),
    [
        (Normal[float](normal=NormalParameters[float](mean=0.5, std=0.2)), 0.5, 0.2),
        (Range[float](range=(-1.0, 2.0)), 0.5, 3 / np.sqrt(12)),
        (Choice[float](choice=(0.0, 1.0)), 0.5, 0.5),
    ],
    ids=["normal", "range", "choice"],
)
def test_noise_has_its_distribution_and_belongs_to_its_env_and_step(value: Any, mean: float, std: float) -> None:
    streams = Streams(4)
    streams.seed(9, np.arange(4))
    streams.begin(np.arange(4))
    ids, ticks = np.full(500, 2), np.arange(500)
    rows = noise_rows(value, "n", streams, ids, ticks, 4)
    assert abs(rows.mean() - mean) < 4 * std / np.sqrt(2000)
    assert abs(rows.std() - std) < 4 * std / np.sqrt(2 * 2000)
    assert abs(np.corrcoef(rows[:-1, 0], rows[1:, 0])[0, 1]) < 0.2
    assert np.array_equal(noise_rows(value, "n", streams, ids[7:8], ticks[7:8], 4)[0], rows[7])
    assert not np.array_equal(noise_rows(value, "n", streams, np.array([1]), ticks[7:8], 4)[0], rows[7])


def test_noise_stays_within_the_bounds_of_the_action_and_is_felt() -> None:
    tape = f"{ROBOT}.actions.arm={{{DELTA}, params: {{scale: 0.06}}, noise: {{range: [-3, 3]}}}}"
    moved = np.diff(targets(20, tape), axis=0)
    assert np.abs(moved).max() <= 0.06 + 1e-12
    assert not np.allclose(moved, np.diff(targets(20), axis=0))


# ---------------------------------------------------------------------- observations


def test_observations_are_late_biased_and_noisy_as_the_spec_says() -> None:
    noisy = (
        "task.observations={policy: [{term: joint_pos, delay: 2}],"
        " biased: [{term: joint_pos, bias: {range: [0.1, 0.2]}}],"
        " noisy: [{term: joint_pos, noise: {normal: {mean: 0, std: 0.05}}}], truth: [joint_pos]}"
    )
    seen: list[dict[str, np.ndarray]] = []
    with arm(2, noisy) as env:
        seen.append(env.reset(seed=1)[0])
        for _ in range(60):
            seen.append(env.step(np.ones((2, env.action_dim)) * 0.1).obs)
        bias = drawn(env, "task/observations.biased/joint_pos/bias")
    truth = np.stack([s["truth"] for s in seen])
    assert all(rows.dtype == np.float32 for rows in seen[-1].values())
    late = np.stack([s["policy"] for s in seen])
    assert np.array_equal(late[2:], truth[:-2])
    assert np.array_equal(late[:2], np.repeat(truth[:1], 2, axis=0))
    assert np.allclose(np.stack([s["biased"] for s in seen]) - truth, bias, atol=1e-6)
    assert ((bias >= 0.1) & (bias <= 0.2)).all()
    error = np.stack([s["noisy"] for s in seen]) - truth
    assert abs(error.std() - 0.05) < 0.005
    assert abs(error.mean()) < 0.005


@pytest.mark.parametrize("engine", ["null", "mujoco"])
def test_a_restored_env_goes_on_with_the_same_noise_and_delays(engine: str) -> None:
    with arm(3, *TERMS[:8], engine=engine) as env:
        env.reset(seed=4)
        act = np.random.default_rng(0).uniform(-1, 1, (12, 3, env.action_dim))
        for a in act[:5]:
            env.step(a)
        kept = env.snapshot()
        first = [env.step(a).obs["policy"] for a in act[5:]]
        env.reset()
        env.reset_to(kept)
        again = [env.step(a).obs["policy"] for a in act[5:]]
        assert np.array_equal(first, again)


def test_an_env_does_not_depend_on_their_number() -> None:
    runs = []
    for n in (1, 4):
        with arm(n, *TERMS[:8]) as env:
            env.reset(seed=4)
            rows = [env.step(np.full((n, env.action_dim), 0.3)).obs["policy"][0] for _ in range(6)]
            runs.append((rows, env.streams.draws[0]))
    assert np.array_equal(runs[0][0], runs[1][0])
    assert runs[0][1] == runs[1][1]


# ---------------------------------------------------------------------- streams, record, refusals


@pytest.mark.parametrize("term", TERMS, ids=lambda t: t.partition("=")[0])
def test_a_further_term_moves_no_other_draw(term: str) -> None:
    base = explain("pick_cube", seed=3, overrides=BLIND)
    more = explain("pick_cube", seed=3, overrides=[*BLIND, term])
    before, after = ({d.name: d.value for d in found.draws} for found in (base, more))
    assert {name: after[name] for name in before} == before
    added = [d for d in more.draws if d.name not in before]
    assert added
    key = term.partition("=")[0]
    assert all(d.path == key or d.path.startswith(f"{key}.") for d in added)


class Stiff(NullEngine):
    """An engine that fixes centres of mass at the build."""

    name = "stiff"
    parameters = NullEngine.parameters - {"body.com"}


def test_a_payload_beside_the_middle_is_refused_where_the_centre_of_mass_is_fixed() -> None:
    text = f"{ROBOT}.dynamics.payload={{link: panda_link7, mass: {{range: [0, 1]}}, position: [0, 0, 0.1]}}"
    loaded = load("pick_cube", overrides=[*BLIND, text])
    world = compile_world(loaded)
    with pytest.raises(CapabilityError, match=r"dynamics\.payload\.position.*stiff cannot change 'body\.com'"):
        check_engine(loaded, world, Stiff, "pick_cube")
    check_engine(loaded, world, engine_class("mujoco"), "pick_cube")


@pytest.mark.parametrize(
    ("override", "words"),
    [
        (f"{ROBOT}.dynamics.payload={{link: panda_link9, mass: 1.0}}", "payload.link: 'panda' has no link or tool"),
        (f"{ROBOT}.dynamics.payload={{link: panda_link0, mass: 1.0}}", "does not move"),
        (f"{ROBOT}.dynamics.damping_offset=-50.0", "must not be negative"),
        (f"{ROBOT}.home.panda_joint1={{range: [0, 9]}}", "9 is outside of the joint's limits"),
        (f"{ROBOT}.home_velocity.elbow=1.0", "has no joint 'elbow'"),
        (f"{ROBOT}.actions.arm.noise={{range: [0, 1], shared: x}}", "leave `shared` out"),
        ("task.images={top: {}}", "there is no camera 'top'"),
        ("task.images={front: {}}", "the camera gives no colours"),
    ],
)
def test_what_cannot_be_is_said_with_its_place(override: str, words: str) -> None:
    with pytest.raises(SpecError) as caught:
        arm(1, override)
    assert words in str(caught.value)


def test_constants_stay_in_the_world_and_nothing_is_drawn() -> None:
    with blocks(1) as plain, blocks(1, "physics.gravity=[0, 0, -1.62]") as moon:
        assert moon.engine.world.physics.gravity == (0, 0, -1.62)
        moon.reset(seed=0)
        plain.reset(seed=0)
        assert moon.streams.draws == plain.streams.draws


class Tape:
    """A policy that plays the same random actions in every env."""

    name = "tape"

    def __init__(self, env: TaskEnv) -> None:
        self.env = env

    def begin(self, env_ids: np.ndarray) -> None:
        del env_ids

    def act(self, env_ids: np.ndarray) -> np.ndarray:
        steps = self.env.scene.elapsed
        return np.stack([np.random.default_rng(int(k)).uniform(-1, 1, self.env.action_dim) for k in steps])

    def gave_up(self, env_ids: np.ndarray) -> np.ndarray:
        return np.zeros(len(env_ids), dtype=bool)

    def solved(self, env_ids: np.ndarray) -> np.ndarray:
        return np.zeros(len(env_ids), dtype=bool)

    def ended(self, env: int, success: bool) -> dict[str, Any]:
        del env, success
        return {}

    def describe(self, env: int) -> dict[str, Any]:
        del env
        return {}


@pytest.mark.parametrize("engine", ENGINES)
def test_a_record_says_what_was_drawn_and_is_replayed_to_the_bit(engine: str, tmp_path: Any) -> None:
    """Noise and delays of the actions come again from the episode's seed: the record has the actions as given."""
    pytest.importorskip("anysim_mcap")
    from anysim.record.manifest import read_manifest
    from anysim.record.replay import replay
    from anysim_recording.collector import Collector

    with arm(2, *TERMS, "task.horizon=6", "record.keep=all", engine=engine) as env:
        results = list(Collector(env, Tape(env), tmp_path, episodes=2, seed=1).run())
    for result in results:
        assert result.path is not None
        manifest = read_manifest(result.path)
        assert {"robot/panda/arm/delay", "robot/panda/kp_scale", "light/key/intensity"} <= manifest.drawn.keys()
        assert replay(result.path).identical


def test_every_axis_names_parameters_that_exist() -> None:
    from axes import AXES, can

    from anysim.engine.parameters import PARAMETERS

    assert {name for axis in AXES for name in axis.parameters} <= PARAMETERS.keys()
    payload = next(axis for axis in AXES if "body.com" in axis.parameters)
    assert [can(engine, payload) for engine in (engine_class("mujoco"), Stiff)] == ["yes", "-"]

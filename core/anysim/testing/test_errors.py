"""Misuse is an error that says what, what was expected and what exists; and nothing has changed after it."""

import numpy as np
import pytest

from anysim.engine.capability import Capability as C
from anysim.errors import AnysimError, CapabilityError, EngineError, NameLookupError
from anysim.testing import worlds
from anysim.testing.compare import assert_same, read
from anysim.testing.fixtures import skip_without, skip_without_parameter

NAN = float("nan")

MISUSE = {
    # name: (what is done, the error's type, what its message must say)
    "no-steps": (lambda e: e.step(0), EngineError, r"n_steps must be (at least|from) 1"),
    "steps-backwards": (lambda e: e.step(-3), EngineError, r"n_steps must be (at least|from) 1"),
    "env-too-high": (lambda e: e.step(env_ids=[2]), EngineError, r"env index 2 is out of range; there are 2"),
    "env-negative": (lambda e: e.reset([-1]), EngineError, r"env index -1 is out of range"),
    "env-twice": (lambda e: e.reset([1, 1]), EngineError, r"env indices repeat: \[1, 1\]"),
    "env-mask": (lambda e: e.reset(np.array([True, False])), EngineError, r"must be integers, got bool.*flatnonzero"),
    "env-fraction": (lambda e: e.reset([0.5]), EngineError, r"must be integers"),
    "joint-too-high": (
        lambda e: e.set_joint_state(0.0, joints=[2]),
        EngineError,
        r"joint index 2 is out of range; there are 2",
    ),
    "joint-shape": (
        lambda e: e.set_joint_state(np.zeros((2, 3))),
        EngineError,
        r"position must have shape \(2, 2\), got \(2, 3\)",
    ),
    "joint-nan": (lambda e: e.set_joint_state([NAN, 0.0]), EngineError, r"position holds a value that is not finite"),
    "velocity-inf": (
        lambda e: e.set_joint_state(velocity=[np.inf, 0.0]),
        EngineError,
        r"velocity holds a value that is not finite",
    ),
    "body-too-high": (
        lambda e: e.set_body_state(twist=np.zeros(6), bodies=[99]),
        EngineError,
        r"body index 99 is out of range",
    ),
    "pose-shape": (
        lambda e: e.set_body_state(pose=np.zeros((2, 2, 6))),
        EngineError,
        r"pose must have shape \(2, 2, 7\)",
    ),
    "pose-quaternion": (
        lambda e: e.set_body_state(pose=np.zeros(7)),
        EngineError,
        r"quaternion of length 0; xyzw of unit length",
    ),
    "twist-nan": (lambda e: e.set_body_state(twist=[NAN] * 6), EngineError, r"twist holds a value that is not finite"),
    "pose-of-a-link": (
        lambda e: e.set_body_state(pose=[0, 0, 0, 0, 0, 0, 1], bodies=[e.index.body("arm.elbow")]),
        EngineError,
        r"'arm.elbow' is moved by a joint; use set_joint_state",
    ),
    "twist-of-a-table": (
        lambda e: e.set_body_state(twist=np.zeros(6), bodies=[e.index.body("table")]),
        EngineError,
        r"'table' is fixed to the world and has no velocity",
    ),
    "control-shape": (
        lambda e: e.set_control(position=np.zeros((2, 5))),
        EngineError,
        r"position must have shape \(2, 2\), got \(2, 5\)",
    ),
    "control-nan": (
        lambda e: e.set_control(effort=[NAN, 0.0]),
        EngineError,
        r"effort holds a value that is not finite",
    ),
    "control-actuator": (
        lambda e: e.set_control(position=0.0, actuators=[7]),
        EngineError,
        r"actuator index 7 is out of range",
    ),
    "no-parameter": (
        lambda e: e.get_parameters("body.weight"),
        EngineError,
        r"no parameter 'body.weight' \(parameters: .*body\.mass",
    ),
    "no-joint-name": (
        lambda e: e.send_action({"elbw": 0.1}),
        EngineError,
        r"no driven joint 'elbw'; did you mean 'elbow'",
    ),
    "no-robot": (lambda e: e.get_observation("leg"), NameLookupError, r"no robot named 'leg' \(robots: arm\)"),
    "no-object": (lambda e: e.remove_object("bal"), AnysimError, r"no object 'bal'.*box, ball"),
    "remove-a-robot-as-object": (lambda e: e.remove_object("arm"), AnysimError, r"no object 'arm'"),
    "remove-no-robot": (lambda e: e.remove_robot("box"), AnysimError, r"no robot named 'box'"),
    "two-worlds": (lambda e: e.create_world(e.world), EngineError, r"has a world already"),
    "camera-pose": (
        lambda e: e.set_camera_pose("front", [0, 0, 0, 0, 0, 0, 1]),
        NameLookupError,
        r"no camera named 'front'",
    ),
}


@pytest.mark.parametrize("misuse", MISUSE.values(), ids=MISUSE.keys())
def test_misuse_is_an_error_and_changes_nothing(build, misuse):
    """Each misuse raises its error with its message; the state is as before and the future is that of a clean run."""
    act, kind, message = misuse
    engine, clean = build(worlds.scene(), 2), build(worlds.scene(), 2)
    for e in (engine, clean):
        e.set_control(position=0.3)
        e.step(5)
    before = read(engine)
    with pytest.raises(kind, match=message):
        act(engine)
    assert_same(read(engine), before, "right after the error")
    for e in (engine, clean):
        e.step(10)
    assert_same(read(engine), read(clean), "10 steps after the error")


def test_num_envs_must_be_positive(new_engine):
    """`num_envs` below 1 is an error, and the engine can still be used."""
    engine = new_engine()
    with pytest.raises(EngineError, match="num_envs must be at least 1, got 0"):
        engine.create_world(worlds.buildable(engine), 0)
    engine.create_world(worlds.buildable(engine), 1)


def test_unknown_options_are_refused(engine_class):
    """An option that the engine does not have is an error that lists what it has."""
    with pytest.raises(EngineError, match="no_such_option"):
        engine_class(no_such_option=1)


ABSENT = {
    C.WRENCHES: lambda e: e.apply_wrench(np.zeros(6), [e.index.body("box")]),
    C.RAYCAST: lambda e: e.raycast([[[0, 0, 5.0]]] * 2, [[[0, 0, -1.0]]] * 2),
    C.CONTACT_POINTS: lambda e: e.contacts(),
    C.RENDER_RGB: lambda e: e.render(),
    C.RENDER_DEPTH: lambda e: e.render(channels=("depth",)),
    C.RENDER_SEGMENTATION: lambda e: e.render(channels=("segmentation",)),
    C.SNAPSHOT_STATE: lambda e: e.snapshot(level="state"),
    C.SNAPSHOT_TRAJECTORY: lambda e: e.snapshot(level="trajectory"),
    C.CONTROL_VELOCITY: lambda e: e.set_control_mode("velocity"),
    C.CONTROL_EFFORT: lambda e: e.set_control_mode("effort"),
    C.PARAMETERS_PER_ENV: lambda e: e.get_parameters("body.mass"),
}


@pytest.mark.parametrize("capability", ABSENT, ids=str)
def test_declared_is_done_and_undeclared_is_refused(build, engine_class, capability):
    """What an engine declares it does without complaint; what it does not declare is a CapabilityError."""
    engine = build(worlds.scene(), 2)
    if capability in engine_class.capabilities:
        if capability is C.PARAMETERS_PER_ENV:
            skip_without_parameter(engine_class, "body.mass")
        ABSENT[capability](engine)
        engine.step()
        return
    before = read(engine)
    with pytest.raises(
        CapabilityError, match=str(capability) if capability is not C.PARAMETERS_PER_ENV else "cannot change"
    ):
        ABSENT[capability](engine)
    assert_same(read(engine), before, "after the refusal")


@pytest.mark.parametrize(
    "arguments",
    [{"channels": ("normals",)}, {"camera_name": "frnt"}, {"width": 100000}],
    ids=["channel", "camera", "size"],
)
def test_wrong_pictures_are_refused(build, engine_class, arguments):
    """A channel, camera or size that does not exist is an error that says what does."""
    if "channels" not in arguments:
        skip_without(engine_class, C.RENDER_RGB)
    engine = build(worlds.scene(), 1)
    with pytest.raises(AnysimError, match=r"channels: rgb, depth|no camera named 'frnt'|cannot be drawn|width must be"):
        engine.render(**{"camera_name": "default"} | arguments)


def test_a_zero_ray_is_refused(build, engine_class):
    """A ray without a direction is an error."""
    skip_without(engine_class, C.RAYCAST)
    with pytest.raises(EngineError, match="direction that is not zero"):
        build(worlds.scene()).raycast([[[0.0, 0.0, 5.0]]], [[[0.0, 0.0, 0.0]]])

"""The procedural gripper: where its fingers are, what it weighs, and what it refuses."""

import numpy as np
import pytest

from anysim.assets.procedural import build
from anysim.errors import SpecError
from anysim.model.world import Box, JointType, Mimic


def test_the_pads_meet_at_zero_and_are_the_stroke_apart_when_open() -> None:
    model = build("parallel_gripper", {"stroke": 0.1, "finger_length": 0.08, "palm_height": 0.05})
    assert [j.name for j in model.joints] == ["finger_left", "finger_right"]
    assert all(j.type is JointType.PRISMATIC and (j.lower, j.upper) == (0.0, 0.05) for j in model.joints)
    assert model.joints[1].mimic == Mimic(0, 1.0)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        joint = next(j for j in model.joints if j.name == f"finger_{side}")
        assert joint.axis == (0.0, sign, 0.0)
        pad = next(g for g in model.geoms if g.name == f"finger_{side}.pad")
        assert isinstance(pad.shape, Box)
        inner = pad.position[1] - sign * pad.shape.half_size[1]
        assert inner == pytest.approx(0.0, abs=1e-12), "closed at zero"
        top = model.bodies[pad.body].position[2] + pad.position[2] + pad.shape.half_size[2]
        assert top == pytest.approx(0.13), "the tips are the palm and a finger away from the mount"
        assert (pad.surface.priority, pad.surface.friction, pad.surface.torsional) == (1, 1.0, True)
    [tcp] = model.sites
    assert (tcp.name, tcp.position) == ("tcp", (0.0, 0.0, 0.115))


def test_open_fingers_stay_within_the_palm_and_touch_nothing() -> None:
    model = build("parallel_gripper", {})
    palm = next(g for g in model.geoms if g.name == "base.palm")
    assert isinstance(palm.shape, Box)
    for geom in model.geoms:
        if geom is palm:
            continue
        assert isinstance(geom.shape, Box)
        joint = next(j for j in model.joints if j.body == geom.body)
        where = np.array(model.bodies[geom.body].position) + geom.position + np.array(joint.axis) * joint.upper
        assert abs(where[1]) + geom.shape.half_size[1] <= palm.shape.half_size[1]
        assert where[2] - geom.shape.half_size[2] >= palm.position[2] + palm.shape.half_size[2] + 0.9e-3


def test_masses_follow_from_the_solids() -> None:
    model = build("parallel_gripper", {"finger_density": 2000.0, "pad_density": 1000.0})
    finger = model.bodies[1].inertial.mass
    assert finger == pytest.approx(2000.0 * 0.022 * 0.012 * 0.059 + 1000.0 * 0.022 * 0.004 * 0.03)
    assert model.bodies[2].inertial.mass == pytest.approx(finger)


def test_limits_are_those_given_and_what_does_not_fit_is_refused() -> None:
    joint = build("parallel_gripper", {"force": 40.0, "speed": 0.2}).joints[0]
    assert (joint.effort_limit, joint.velocity_limit, joint.limit_softness) == (40.0, 0.2, 0.004)
    with pytest.raises(SpecError) as caught:
        build("parallel_gripper", {"pad_length": 0.06})
    assert [str(i) for i in caught.value.issues] == [
        "params.pad_length: a pad of 0.06 m does not fit onto a finger of 0.06 m"
    ]

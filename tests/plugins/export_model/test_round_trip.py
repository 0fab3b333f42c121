"""Models that are written and read again: masses, inertias, frames and limits are those that were written."""

from math import isinf
from pathlib import Path

import numpy as np
import pytest

from anysim.assets.load import import_asset
from anysim.assets.model import ImportedModel
from anysim.conventions import Array
from anysim.kinematics import inertia
from anysim.model.world import JointType
from anysim_export_model.scene import scene_of_model
from anysim_export_model.write import write

LARGEST = 1e-9
"""[kg], [kg m^2], [m], [rad] and in a rotation matrix, relative to what is larger than one."""

FAST = ["panda_description/urdf/panda.urdf", "solo_description/robots/solo12.urdf"]
SLOW = [
    "a1_description/urdf/a1.urdf",
    "allegro_hand_description/urdf/allegro_left_hand.urdf",
    "allegro_hand_description/urdf/allegro_right_hand.urdf",
    "anymal_b_simple_description/robots/anymal.urdf",
    "anymal_c_simple_description/urdf/anymal.urdf",
    "b1_description/urdf/b1.urdf",
    "baxter_description/urdf/baxter.urdf",
    "bolt_description/robots/bolt.urdf",
    "centauro_description/urdf/centauro.urdf",
    "go1_description/urdf/go1.urdf",
    "go2_description/urdf/go2.urdf",
    "g1_description/urdf/g1_29dof_rev_1_0.urdf",
    "hyq_description/robots/hyq_no_sensors.urdf",
    "icub_description/robots/icub.urdf",
    "icub_description/robots/icub_reduced.urdf",
    "kinova_description/robots/kinova.urdf",
    "laikago_description/urdf/laikago.urdf",
    "panda_description/urdf/panda_collision.urdf",
    "pr2_description/urdf/pr2.urdf",
    "romeo_description/urdf/romeo.urdf",
    "simple_humanoid_description/urdf/simple_humanoid.urdf",
    "so_arm_description/urdf/so100.urdf",
    "so_arm_description/urdf/so101.urdf",
    "solo_description/robots/solo.urdf",
    "talos_data/robots/talos_reduced.urdf",
    "tiago_description/robots/tiago.urdf",
    "tiago_description/robots/tiago_dual.urdf",
    "ur_description/urdf/ur10_robot.urdf",
    "ur_description/urdf/ur3_robot.urdf",
    "ur_description/urdf/ur5_robot.urdf",
    "xarm_description/urdf/xarm7.urdf",
    "z1_description/urdf/z1.urdf",
]


def poses(model: ImportedModel, positions: Array) -> dict[str, Array]:
    """The frames (4, 4) of bodies and sites by name, at joint positions (J,)."""
    from anysim.math import pose as P

    def matrix(position: Array, quaternion: Array) -> Array:
        full = np.eye(4)
        full[:3, :3], full[:3, 3] = P.to_matrix(np.array(quaternion)), position
        return full

    found: list[Array] = []
    for index, body in enumerate(model.bodies):
        here = matrix(body.position, body.quaternion)
        if index:
            joint, at = model.joints[index - 1], positions[index - 1]
            axis, anchor = np.array(joint.axis), np.array(joint.anchor)
            if joint.type is JointType.REVOLUTE:
                turn = P.from_axis_angle(axis, np.array(at))
                moved = matrix(anchor - P.rotate(turn, anchor), turn)
            else:
                moved = matrix(axis * at, np.array([0.0, 0.0, 0.0, 1.0]))
            here = found[body.parent] @ here @ moved
        found.append(here)
    named = {body.name: pose for body, pose in zip(model.bodies, found, strict=True)}
    return named | {site.name: found[site.body] @ matrix(site.position, site.quaternion) for site in model.sites}


def inertias(model: ImportedModel) -> list[Array]:
    """Of each body its mass, centre and inertia about the frame's origin, all (13,), at zero in the world's axes."""
    frames, found = poses(model, np.zeros(len(model.joints))), []
    for body in model.bodies:
        frame, own = frames[body.name], body.inertial
        turned = frame[:3, :3] @ inertia.tensor(own) @ frame[:3, :3].T
        found.append(np.array([own.mass, *(frame[:3, :3] @ np.array(own.com) + frame[:3, 3]), *turned.ravel()]))
    return found


def difference(one: Array, other: Array) -> float:
    """The largest difference, relative where numbers are larger than one; infinities must be the same."""
    one, other = np.asarray(one, dtype=float), np.asarray(other, dtype=float)
    both = np.isfinite(one) & np.isfinite(other)
    assert (one[~both] == other[~both]).all(), f"{one[~both]} became {other[~both]}"
    one, other = one[both], other[both]
    return float((np.abs(one - other) / np.maximum(np.abs(one), 1.0)).max(initial=0.0))


def differences(one: ImportedModel, other: ImportedModel, *, velocities: bool = True) -> dict[str, float]:
    """What became of a model: the largest differences by kind."""
    assert [joint.name for joint in one.joints] == [joint.name for joint in other.joints]
    keys = ["lower", "upper", "effort_limit", "damping", "friction", "stiffness", "spring_rest"]
    keys += ["velocity_limit"] if velocities else ["armature", "limit_softness", "initial"]
    rng = np.random.default_rng(0)
    ends = [(max(j.lower, -3.0), min(j.upper, 3.0)) for j in one.joints]
    frames = 0.0
    for at in (np.zeros(len(ends)), np.array([rng.uniform(min(pair), max(pair)) for pair in ends])):
        before, after = poses(one, at), poses(other, at)
        before["world (body)"] = before.pop("world", before[one.bodies[0].name])  # as MJCF has to call it
        after.setdefault("world (body)", after.get("world", after[other.bodies[0].name]))
        assert before.keys() <= after.keys(), before.keys() - after.keys()
        frames = max([frames, *(difference(before[name], after[name]) for name in before)])
    limits = [
        difference([getattr(a, key)], [getattr(b, key)])
        for a, b in zip(one.joints, other.joints, strict=True)
        for key in keys
    ]
    mimics = [
        difference([0, *a.mimic[:3]] if a.mimic else [1], [0, *b.mimic[:3]] if b.mimic else [1])
        for a, b in zip(one.joints, other.joints, strict=True)
    ]
    return {
        "masses and inertias": max(map(difference, inertias(one), inertias(other))),
        "frames": frames,
        "joints": max([0.0, *limits]),
        "mimic": max([0.0, *mimics]),
    }


def round_trip(model: ImportedModel, kind: str, folder: Path) -> dict[str, float]:
    """The differences after a file of this format."""
    written = write(scene_of_model(model), kind, folder)
    again = import_asset(str(written.files[0]))
    assert len(again.bodies) == len(model.bodies)
    assert sum(g.collides for g in again.geoms) == sum(g.collides for g in model.geoms)
    told = {note.where for note in written.notes}
    if kind == "mjcf" and any(not isinf(joint.velocity_limit) for joint in model.joints):
        assert "velocity limit of a joint" in told
    if kind == "urdf" and any(joint.armature for joint in model.joints):
        assert "armature of a joint" in told
    return differences(model, again, velocities=kind == "urdf")


@pytest.mark.parametrize("file", [*FAST, *(pytest.param(file, marks=pytest.mark.slow) for file in SLOW)])
@pytest.mark.parametrize("kind", ["urdf", "mjcf"])
def test_a_robot_is_the_same_after_a_file(kind: str, file: str, tmp_path: Path) -> None:
    found = round_trip(import_asset(f"example-robot-data:{file}"), kind, tmp_path)
    assert max(found.values()) < LARGEST, found

"""Recorded and streamed motion: BVH files of two origins, functions, and bones of the avatar's own lengths."""

import numpy as np
import pytest

import anysim
from anysim.errors import AssetError, SpecError
from anysim.math import pose as P
from anysim_avatars.bodies import BONES, lengths
from anysim_avatars.motion import Motion, Stance, read_motion
from tests.plugins.avatars.people import avatars, joints, lived, run_of, wait

LIMBS = {
    "Hips": ("", (0, 90, 0)),
    "Spine": ("Hips", (0, 10, 0)),
    "Neck": ("Spine", (0, 45, 0)),
    "Head": ("Neck", (0, 8, 0)),
    **{
        f"{side}{name}": (f"{side}{up}" if up else root, tuple(x * (s if i == 0 else 1) for i, x in enumerate(offset)))
        for side, s in (("Left", 1), ("Right", -1))
        for name, up, root, offset in (
            ("Arm", "", "Spine", (18, 40, 0)),
            ("ForeArm", "Arm", "", (28, 0, 0)),
            ("Hand", "ForeArm", "", (25, 0, 0)),
            ("UpLeg", "", "Hips", (9, 0, 0)),
            ("Leg", "UpLeg", "", (0, -42, 0)),
            ("Foot", "Leg", "", (0, -41, 0)),
            ("Toe", "Foot", "", (0, -5, 14)),
        )
    },
}
ORDER: list[str] = []


def bvh(frames, prefix="", names=None):
    """A file of a person; `frames` maps joints to rotations (z, x, y) in degrees, or Hips' place as `at`, per frame."""
    names, ORDER[:] = names or {}, []

    def joint(name, depth):
        pad = "  " * depth
        up, offset = LIMBS[name]
        ORDER.append(name)
        channels = (
            "6 Xposition Yposition Zposition Zrotation Xrotation Yrotation"
            if not up
            else "3 Zrotation Xrotation Yrotation"
        )
        kids = [other for other, (parent, _) in LIMBS.items() if parent == name]
        body = [f"{pad}OFFSET {' '.join(map(str, offset if up else (0, 0, 0)))}", f"{pad}CHANNELS {channels}"]
        body += [line for kid in kids for line in joint(kid, depth + 1)]
        body += [] if kids else [f"{pad}End Site", f"{pad}{{", f"{pad}OFFSET 0 1 0", f"{pad}}}"]
        return [f"{pad}{'JOINT' if up else 'ROOT'} {prefix}{names.get(name, name)}", f"{pad}{{", *body, f"{pad}}}"]

    lines = ["HIERARCHY", *joint("Hips", 0), "MOTION", f"Frames: {len(frames)}", "Frame Time: 0.1"]
    for frame in frames:
        row = [*frame.get("at", (0, 90, 0))]
        for name in ORDER:
            row += frame.get(name, (0, 0, 0))
        lines.append(" ".join(map(str, row)))
    return "\n".join(lines)


def written(tmp_path, text):
    path = tmp_path / "one.bvh"
    path.write_text(text)
    return path


def direction(motion, frame, bone):
    return P.rotate(motion.rotation[frame, BONES.index(bone)], np.array([0.0, 0.0, 1.0]))


OTHERS = {"LeftArm": "lUpperArm", "LeftForeArm": "lLowerArm", "LeftLeg": "LeftKnee", "Hips": "pelvis"}


@pytest.mark.parametrize(("prefix", "names"), [("", {}), ("mixamorig:", {}), ("", OTHERS)])
def test_limbs_point_where_the_file_has_them(tmp_path, prefix, names):
    raised = {"LeftArm": (90, 0, 0), "RightForeArm": (0, 0, 90), "LeftUpLeg": (0, -90, 0), "at": (0, 90, 30)}
    motion = read_motion(written(tmp_path, bvh([{}, raised], prefix, names)))
    assert motion.seconds == pytest.approx(0.1)
    for bone, expected in {"left_upper_arm": (0, 1, 0), "right_thigh": (0, 0, -1), "torso": (0, 0, 1)}.items():
        np.testing.assert_allclose(direction(motion, 0, bone), expected, atol=1e-9)
    found = {
        "left_upper_arm": (0, 0, 1),
        "left_forearm": (0, 0, 1),
        "right_upper_arm": (0, -1, 0),
        "right_forearm": (1, 0, 0),
        "left_thigh": (1, 0, 0),
        "left_shin": (1, 0, 0),
    }
    for bone, expected in found.items():
        np.testing.assert_allclose(direction(motion, 1, bone), expected, atol=1e-9, err_msg=bone)
    np.testing.assert_allclose(motion.hips[1] - motion.hips[0], [30 / 83, 0, 0], atol=1e-9)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("nothing", "is no BVH file that can be read: it does not begin with HIERARCHY"),
        ("", "it ends too early"),
        (bvh([{}, {}]).replace("Frames: 2", "Frames: 3"), "3 frames of 57 numbers are announced, and 114 are there"),
        (bvh([{}, {}]).replace("LeftForeArm", "Tentacle"), "no joint for the left forearm .*tentacle"),
        (bvh([{}, {}]).replace("OFFSET 0 10 0", "OFFSET 0 ten 0"), "could not convert"),
    ],
    ids=["words", "empty", "short", "a limb", "numbers"],
)
def test_what_is_no_motion_of_a_person_is_refused(tmp_path, text, words):
    with pytest.raises(AssetError, match=words):
        read_motion(written(tmp_path, text))


def test_a_recording_is_played_with_the_bones_of_the_avatar(tmp_path):
    frames = [{"LeftArm": (9 * i, 0, 0)} for i in range(11)]
    file = written(tmp_path, bvh(frames))
    worst = 0.0
    run = run_of([{"clip": "raise"}, "idle"], motions={"raise": str(file)})
    for step, (_, family) in enumerate(lived(run, 90)):
        there, size = joints(family), dict(zip(BONES, lengths(family.people[0]), strict=True))
        gap = np.linalg.norm(there["left_forearm"] - there["left_upper_arm"])
        worst = max(worst, abs(gap - size["left_upper_arm"]))
        if step == 45:
            up = (there["left_hand"] - there["left_forearm"])[2] / size["left_forearm"]
            assert up == pytest.approx(np.sin(np.radians(0.9 * 90)), abs=0.05)
        assert family.facts(0)["ann"]["doing"] == ("raise" if step < 49 else "idle")
    assert worst < 1e-9
    with pytest.raises(SpecError, match=r"ann\.motions\.raise: .*is no BVH"):
        anysim.make(run_of(["raise"], motions={"raise": str(written(tmp_path, "x"))}))


def test_a_function_says_how_avatars_stand(tmp_path):
    motion = read_motion(written(tmp_path, bvh([{}, {}])))

    def tilted(time, number):
        still = motion(np.zeros_like(time), number)
        return Stance(still.hips + np.array([0, 0, 0.1]) * np.sin(time)[:, None], still.rotation)

    def heights(env, steps):
        found = []
        for _ in range(steps):
            wait(env)
            found.append(env.engine.get_state().body_pose[:, 0, 2].copy())
        return np.array(found)

    with anysim.make(run_of([], num_envs=2)) as env:
        env.reset(seed=0)
        avatars(env).provide(tilted)
        wait(env)
        before = env.snapshot()
        first = heights(env, 60)
        env.reset_to(before)
        np.testing.assert_array_equal(heights(env, 60), first)
        assert np.ptp(first[30:, 0]) > 0.02
        avatars(env).provide(None)
        assert np.ptp(heights(env, 60)[50:, 0]) < 0.01


def test_between_two_frames_it_goes_the_short_way():
    turn = P.from_axis_angle(np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0]))
    motion = Motion(np.zeros((2, 3)), np.stack([np.tile(turn[0], (15, 1)), -np.tile(turn[1], (15, 1))]), 0.5)
    stance = motion(np.array([0.25]), np.array([0]))
    assert P.angle_between(stance.rotation[0, 0], turn[0]) == pytest.approx(0.5, abs=1e-6)

"""Walking: feet that stand do not slip, bones keep their lengths, and walks end where they should."""

import numpy as np
import pytest

from anysim_avatars.bodies import BONES, lengths
from tests.plugins.avatars.people import after, joints, lived, run_of

PATHS = {
    "straight": [[3.0, 0.0]],
    "corner": [[1.5, 0.0], [1.5, 1.5]],
    "zigzag": [[1.0, 0.6], [2.0, -0.6], [3.0, 0.6]],
    "back": [[1.5, 0.0], [1.5, 0.5], [0.0, 0.5]],
    "behind": [[-2.0, 0.1]],
}
PAIRS = [("thigh", "shin"), ("upper_arm", "forearm"), ("forearm", "hand")]


def walked(path, speed, engine="null", steps=500):
    """Slip of standing feet, error of bones, stretch of legs, greatest speed of a joint, and the end of a walk."""
    slip = bone_error = stretch = speed_found = 0.0
    before, last = -1, None
    for env, family in lived(run_of([{"path": path, "speed": speed}], engine), steps):
        swing = int(family.memory["swing"][0, 0])
        names = [body.name for body in env.engine.world.bodies]
        feet = env.engine.get_state().body_pose[0, [names.index(f"ann.{side}_foot") for side in ("left", "right")]]
        if last is not None:
            slip = max([slip, *(np.abs(feet[i] - last[i]).max() for i in (0, 1) if i not in (swing, before))])
        before, last = swing, feet
        there, size = joints(family), dict(zip(BONES, lengths(family.people[0]), strict=True))
        for side in ("left", "right"):
            for upper, lower in PAIRS:
                found = np.linalg.norm(there[f"{side}_{lower}"] - there[f"{side}_{upper}"])
                bone_error = max(bone_error, abs(found - size[f"{side}_{upper}"]))
            ankle = family.memory["feet"][0, 0, 0 if side == "left" else 1, :3] + [0, 0, family.people[0].ankle]
            stretch = max(stretch, np.linalg.norm(ankle - there[f"{side}_thigh"]) / family.people[0].leg)
            shin = np.linalg.norm(ankle - there[f"{side}_shin"])
            bone_error = max(bone_error, abs(shin - size[f"{side}_shin"]))
        speed_found = max(speed_found, np.abs(family.memory["speeds"][0]).max())
    return slip, bone_error, stretch, speed_found, family.memory["pos"][0, 0].copy(), int(family.memory["swing"][0, 0])


@pytest.mark.parametrize("speed", [1.2, pytest.param(0.6, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, id=name, marks=[] if name in ("corner", "behind") else pytest.mark.slow)
        for name, path in PATHS.items()
    ],
)
def test_nothing_slips_or_stretches(path, speed):
    slip, bone_error, stretch, fastest, end, swing = walked(path, speed, steps=300 if speed > 1 else 500)
    assert slip < 1e-9
    assert bone_error < 1e-9
    assert stretch < 1.0
    assert fastest < 6.0
    assert np.hypot(*(end - path[-1])) < 2e-3
    assert swing == -1


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "sapien"])
def test_feet_of_bodies_do_not_slip(engine):
    slip, *_, end, _ = walked(PATHS["corner"], 1.2, engine)
    assert slip < 1e-6
    assert np.hypot(*(end - PATHS["corner"][-1])) < 2e-3


def test_a_body_follows_what_it_goes_to():
    ball = {
        "objects": {"ball": {"source": {"sphere": 0.1}, "fixed": True}},
        "layout": {"ball": {"position": [2, 1, 0.1]}},
    }
    with after(run_of([{"go_to": "ball", "near": 0.5}, "sit"], world=ball), 250) as (_, family):
        assert np.hypot(*(family.memory["pos"][0, 0] - [2, 1])) == pytest.approx(0.5, abs=0.05)
        assert family.facts(0)["ann"]["doing"] == "sit"


def test_turns_on_the_spot():
    with after(run_of([{"turn_to": 2.5}]), 200) as (_, family):
        assert family.memory["yaw"][0, 0] == pytest.approx(2.5, abs=0.02)
        assert family.memory["pos"][0, 0] == pytest.approx([0, 0])
        assert np.abs(family.memory["feet"][0, 0, :, 3] - 2.5).max() < 0.25


GROUNDS = {
    "waves": {"kind": "waves", "amplitude": 0.05, "wavelength": 1.5, "size": [8, 8], "platform": 0.4, "seed": 2},
    "tiles": {"kind": "tiles", "cell": 0.2, "tiles": {"columns": ["rough", "slopes"], "size": 6, "rows": 2}},
}


@pytest.mark.parametrize("kind", list(GROUNDS))
def test_feet_stand_on_the_ground_wherever_a_scene_is(kind):
    run = run_of([{"path": [[1.2, 0.4]], "speed": 0.8}], world={"terrain": GROUNDS[kind]}, num_envs=3)
    off, heights, stretch = [], [], 0.0
    for env, family in lived(run, 130):
        feet, swing = family.memory["feet"][:, 0], family.memory["swing"][:, 0]
        down = np.stack([swing != 0, swing != 1], axis=1)
        ground = env.engine.world.ground.heights_at(feet[..., :2])
        off.append(np.abs(feet[..., 2] - ground)[down].max())
        heights.append(ground[down])
        ankle = feet[..., :3] + np.array([0, 0, family.people[0].ankle])
        hips = family.state(np.arange(3)).points[:, [BONES.index("left_thigh"), BONES.index("right_thigh")]]
        stretch = max(stretch, (np.linalg.norm(ankle - hips, axis=-1) / family.people[0].leg).max())
        last = family.memory["pos"][:, 0] - env.scene.origin[:, :2]
    assert max(off) < 1e-9
    assert np.ptp(np.concatenate(heights)) > 0.02
    assert stretch < 1.0
    np.testing.assert_allclose(last, [[1.2, 0.4]] * 3, atol=3e-3)

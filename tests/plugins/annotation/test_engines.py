"""Channels from each engine's depth and segmentation, held against those by rays on the same poses."""

import numpy as np
import pytest

import anysim
from anysim.math import pose as P
from anysim.model.forward_kinematics import forward_kinematics
from anysim.testing.engines import require_drawing
from anysim_annotation.capture import Capture, Moment
from anysim_annotation.legend import Legend
from tests.tiers import ENGINES, often

SIZE = (128, 96)
NAMES = ("boxes_2d", "depth", "flow", "instance", "normals", "point_cloud", "semantic")
WORLD = ["num_envs=1", f"world.cameras.front.size={list(SIZE)}", f"world.cameras.wrist.size={list(SIZE)}"]


def two_moments(env: anysim.task.env.TaskEnv) -> list[Moment]:
    """Right after a reset, and with the cube pushed and the arm bent a little."""
    env.reset(seed=3)
    engine = env.engine
    first = engine.get_state()
    joints = first.joint_pos.copy()
    poses = first.body_pose.copy()
    cube = [b.name for b in engine.world.bodies].index("cube")
    joints[:, [0, 3]] += 0.03
    later = forward_kinematics(engine.world, poses, joints)
    later[0, cube, :3] += [0.012, -0.02, 0.0]
    later[0, cube, 3:] = P.multiply(P.from_axis_angle(np.array([0.0, 0.0, 1.0]), np.array(0.1)), poses[0, cube, 3:])
    ids = np.array([0])
    return [Moment(ids, np.array([k]), rows) for k, rows in enumerate((poses, later))]


@pytest.fixture(scope="module", params=often(["mujoco"], ENGINES))
def seen(request: pytest.FixtureRequest):
    """Labels of the second moment by both sources, by camera, and the world."""
    require_drawing(request.param)
    with anysim.make("pick_cube", engine=request.param, overrides=WORLD) as env:
        moments = two_moments(env)
        found = []
        for source in ("engine", "geometry"):
            capture = Capture(env, {"front": NAMES, "wrist": NAMES}, source)
            found.append([capture.take(moment) for moment in moments][1])
        yield *found, env.engine.world


@pytest.mark.parametrize("camera", ["front", "wrist"])
def test_an_engines_channels_are_those_of_rays(seen, camera: str) -> None:
    """Silhouettes are drawn a pixel wider or narrower; there alone they differ."""
    ours, theirs = (
        {n: {k: a[0] for k, a in lab.arrays.items()} for n, lab in part[camera].items()} for part in seen[:2]
    )
    same = ours["instance"]["instance"] == theirs["instance"]["instance"]
    assert same.mean() > 0.999
    assert (ours["semantic"]["semantic"] == theirs["semantic"]["semantic"]).mean() > 0.999
    depth, answer = ours["depth"]["depth"], theirs["depth"]["depth"]
    both = same & np.isfinite(depth) & np.isfinite(answer)
    off = np.abs(depth[both] - answer[both])
    assert np.median(off) < 5e-4
    assert np.percentile(off, 95) < 5e-3
    turned = (ours["normals"]["normals"] * theirs["normals"]["normals"]).sum(axis=-1)
    known = both & np.isfinite(turned)
    degrees = np.degrees(np.arccos(np.clip(turned[known], -1, 1)))
    assert known.sum() > 0.98 * both.sum()
    assert np.median(degrees) < 0.05
    assert np.percentile(degrees, 90) < 10
    flow = np.linalg.norm(ours["flow"]["flow"] - theirs["flow"]["flow"], axis=-1)
    known = both & np.isfinite(flow)
    assert known.sum() > 0.98 * both.sum()
    assert np.median(flow[known]) < 0.01
    assert np.percentile(flow[known], 98) < 0.01
    assert (ours["flow"]["occluded"] == theirs["flow"]["occluded"])[both].mean() > 0.99
    assert (~ours["flow"]["occluded"])[both].mean() > 0.8


def test_boxes_are_a_pixel_apart_and_points_a_millimetre(seen) -> None:
    ours, theirs, world = seen
    for camera in ("front", "wrist"):
        boxes = [{b["name"]: b for b in part[camera]["boxes_2d"].records[0]} for part in (ours, theirs)]
        assert boxes[0].keys() == boxes[1].keys()
        for name, box in boxes[0].items():
            answer = boxes[1][name]
            assert np.abs(np.subtract(box["box"], answer["box"])).max() <= 1, (camera, name)
            assert abs(box["occlusion"] - answer["occlusion"]) < 0.05
        clouds = [{k: a[0] for k, a in part[camera]["point_cloud"].arrays.items()} for part in (ours, theirs)]
        at = [{tuple(p): i for i, p in enumerate(c["pixel"].tolist())} for c in clouds]
        common = [(at[0][p], at[1][p]) for p in at[0] if p in at[1]]
        a, b = np.array(common).T
        alike = clouds[0]["instance"][a] == clouds[1]["instance"][b]
        apart = np.linalg.norm(clouds[0]["world"][a] - clouds[1]["world"][b], axis=1)[alike]
        assert len(apart) > 0.95 * len(clouds[1]["world"])
        assert np.median(apart) < 1e-3
    assert {thing.name for thing in Legend(world).things} == {"panda", "table", "cube"}

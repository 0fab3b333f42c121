"""Pictures of docs/annotate.md: what annotators say of one moment: `python scripts/annotation_pictures.py [ENGINE…]`.

A sheet for each engine that draws here, from the episode of `pick_cube` after some steps of its expert.
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

import anysim
from anysim.engine.factory import engine_class
from anysim.skills.runner import SkillPolicy
from anysim.testing.engines import drawing_trouble
from anysim_annotation.capture import Capture

OUT = Path(__file__).parents[1] / "docs" / "images"
SIZE, STEPS = (320, 240), 62
EDGES = ((0, 1), (0, 2), (0, 4), (1, 3), (1, 5), (2, 3), (2, 6), (3, 7), (4, 5), (4, 6), (5, 7), (6, 7))
NAMES = (
    "boxes_2d",
    "boxes_3d",
    "depth",
    "instance",
    "semantic",
    "normals",
    "flow",
    "point_cloud",
    "skeleton",
    "eef_waypoint",
)
PALETTE = np.array(
    [[40, 40, 48], [228, 87, 46], [46, 134, 171], [244, 211, 94], [106, 190, 120], [160, 100, 200]], np.uint8
)


def sheet(engine: str) -> Image.Image:
    """Eight pictures of the moment."""
    with anysim.make("pick_cube", engine=engine, overrides=[f"world.cameras.front.size={list(SIZE)}"]) as env:
        env.reset(seed=4)
        policy, ids = SkillPolicy(env), np.array([0])
        policy.begin(ids)
        capture = Capture(env, {"front": NAMES})
        for step in range(STEPS):
            env.step(policy.act(ids))
            if step % 2 or step == STEPS - 1:
                labels = capture.take()["front"]
        rgb = env.engine.render("front", channels=("rgb",))["rgb"][0]
    arrays = {f"{n}.{k}": rows[0] for n, one in labels.items() for k, rows in one.arrays.items()}
    records = {name: one.records[0] for name, one in labels.items()}
    boxes, space, robot = Image.fromarray(rgb), Image.fromarray(rgb), Image.fromarray(rgb)
    pen = ImageDraw.Draw(boxes)
    for box in records["boxes_2d"]:
        colour = tuple(PALETTE[box["id"]].tolist())
        left, top, right, bottom = box["box"]
        pen.rectangle((left, top, right - 1, bottom - 1), outline=colour)
        pen.text((left + 2, top + 1), f"{box['name']} {box['occlusion']:.2f}", fill=colour)
    pen = ImageDraw.Draw(space)
    for box in records["boxes_3d"]:
        pixels = [tuple(p) for p in np.asarray(box["pixels"]).tolist()]
        for a, b in EDGES:
            if np.isfinite([*pixels[a], *pixels[b]]).all():
                pen.line((pixels[a], pixels[b]), fill=tuple(PALETTE[box["id"]].tolist()), width=2)
    pen = ImageDraw.Draw(robot)
    for one in records["skeleton"]:
        pixels = [tuple(p) for p in np.asarray(one["pixels"]).tolist()]
        for number, parent in enumerate(one["parents"]):
            if parent >= 0:
                pen.line((pixels[parent], pixels[number]), fill=(46, 134, 171), width=3)
            pen.ellipse([c + d for d in (-3, 3) for c in pixels[number]], fill=(244, 211, 94))
    for one in records["eef_waypoint"]:
        pen.line([tuple(p) for p in np.asarray(one["trail"]).tolist()], fill=(228, 87, 46), width=3)
    depth = arrays["depth.depth"]
    near = np.clip((depth - 0.6) / 1.6, 0, 1)
    normals = np.nan_to_num(arrays["normals.normals"] * 0.5 + 0.5)
    flow, hidden = np.nan_to_num(arrays["flow.flow"]), arrays["flow.occluded"]
    moved = 0.5 + np.stack([flow[..., 0], flow[..., 1], np.zeros(depth.shape)], axis=-1) / 12
    moved[hidden] = 0
    tiles = {
        "boxes_2d: name, hidden share": np.array(boxes),
        "boxes_3d": np.array(space),
        "skeleton, eef_waypoint": np.array(robot),
        "depth: 0.6 to 2.2 m": np.repeat((255 * (1 - near)).astype(np.uint8)[..., None], 3, axis=-1),
        "instance": PALETTE[arrays["instance.instance"]],
        "normals, world": (255 * normals).astype(np.uint8),
        "flow; black: not seen before": (255 * np.clip(moved, 0, 1)).astype(np.uint8),
        "point_cloud from above": above(arrays),
    }
    wide, high = SIZE
    page = Image.new("RGB", (4 * wide, 2 * (high + 16)), (255, 255, 255))
    pen = ImageDraw.Draw(page)
    for number, (title, tile) in enumerate(tiles.items()):
        x, y = number % 4 * wide, number // 4 * (high + 16)
        pen.text((x + 4, y + 2), title, fill=(0, 0, 0))
        page.paste(Image.fromarray(tile), (x, y + 16))
    return page


def above(arrays: dict[str, np.ndarray]) -> np.ndarray:
    """Points seen from above, coloured by thing: 2 m by 1.5 m about the table."""
    image = np.full((SIZE[1], SIZE[0], 3), 255, np.uint8)
    points, things = arrays["point_cloud.world"], arrays["point_cloud.instance"]
    order = np.argsort(points[:, 2])
    u = ((points[order, 1] + 1.0) * SIZE[0] / 2).astype(int)
    v = ((points[order, 0] + 0.4) * SIZE[1] / 1.5).astype(int)
    inside = (u >= 0) & (v >= 0) & (u < SIZE[0]) & (v < SIZE[1])
    image[v[inside], u[inside]] = PALETTE[things[order][inside]]
    return image


def main() -> int:
    """Write the sheets of the engines that draw here."""
    for engine in sys.argv[1:] or ("mujoco", "pybullet", "sapien"):
        if trouble := drawing_trouble(engine_class(engine)):
            print(f"{engine}: {trouble}")
            continue
        path = OUT / f"annotate_{engine}.jpg"
        sheet(engine).save(path, quality=80)
        print(f"{path.name}: {path.stat().st_size / 1e3:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main())

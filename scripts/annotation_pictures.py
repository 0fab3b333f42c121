"""Pictures of docs/annotate.md: what annotators say of one moment: `python scripts/annotation_pictures.py [ENGINE…]`.

Two sheets for each engine that draws here, of the episode of `pick_cube` after some steps of its expert: what is said,
and beside what rays say of the same poses, with the differences.
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

import anysim
from anysim.engine.factory import engine_class
from anysim.skills.runner import SkillPolicy
from anysim.testing.engines import drawing_trouble
from anysim_annotation.api import Labels
from anysim_annotation.capture import Capture
from anysim_annotation.view import Source

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


def labelled(engine: str) -> tuple[np.ndarray, dict[Source, dict[str, Labels]]]:
    """A picture of the moment, and what is said of it by the engine's drawing and by rays."""
    with anysim.make("pick_cube", engine=engine, overrides=[f"world.cameras.front.size={list(SIZE)}"]) as env:
        env.reset(seed=4)
        policy, ids = SkillPolicy(env), np.array([0])
        policy.begin(ids)
        captures: dict[Source, Capture] = {
            "engine": Capture(env, {"front": NAMES}, "engine"),
            "geometry": Capture(env, {"front": NAMES}, "geometry"),
        }
        labels: dict[Source, dict[str, Labels]] = {}
        for step in range(STEPS):
            env.step(policy.act(ids))
            if step % 2 or step == STEPS - 1:
                for source, capture in captures.items():
                    labels[source] = capture.take()["front"]
        return env.engine.render("front", channels=("rgb",))["rgb"][0], labels


def sheet(rgb: np.ndarray, labels: dict[str, Labels]) -> Image.Image:
    """Eight pictures of the moment."""
    arrays = arrays_of(labels)
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
    shown = pictures(arrays)
    tiles = {
        "boxes_2d: name, hidden share": np.array(boxes),
        "boxes_3d": np.array(space),
        "skeleton, eef_waypoint": np.array(robot),
        **shown,
    }
    return laid_out(tiles, 4)


def laid_out(tiles: dict[str, np.ndarray], columns: int) -> Image.Image:
    """Pictures with their titles, row by row."""
    wide, high = SIZE
    page = Image.new("RGB", (columns * wide, -(-len(tiles) // columns) * (high + 16)), (255, 255, 255))
    pen = ImageDraw.Draw(page)
    for number, (title, tile) in enumerate(tiles.items()):
        x, y = number % columns * wide, number // columns * (high + 16)
        pen.text((x + 4, y + 2), title, fill=(0, 0, 0))
        page.paste(Image.fromarray(tile), (x, y + 16))
    return page


def arrays_of(labels: dict[str, Labels]) -> dict[str, np.ndarray]:
    """Arrays of the one env as `annotator.array`."""
    return {f"{n}.{k}": rows[0] for n, one in labels.items() for k, rows in one.arrays.items()}


def pictures(arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Arrays as pictures."""
    depth = arrays["depth.depth"]
    near = np.clip((depth - 0.6) / 1.6, 0, 1)
    normals = np.nan_to_num(arrays["normals.normals"] * 0.5 + 0.5)
    flow, hidden = np.nan_to_num(arrays["flow.flow"]), arrays["flow.occluded"]
    moved = 0.5 + np.stack([flow[..., 0], flow[..., 1], np.zeros(depth.shape)], axis=-1) / 12
    moved[hidden] = 0
    return {
        "depth: 0.6 to 2.2 m": np.repeat((255 * (1 - near)).astype(np.uint8)[..., None], 3, axis=-1),
        "instance": PALETTE[arrays["instance.instance"]],
        "normals, world": (255 * normals).astype(np.uint8),
        "flow; black: not seen before": (255 * np.clip(moved, 0, 1)).astype(np.uint8),
        "point_cloud from above": above(arrays),
    }


def compared(labels: dict[Source, dict[str, Labels]]) -> Image.Image:
    """What the engine's drawing gives, what rays give, and where they differ: black is equal."""
    drawn, rays = (arrays_of(labels[source]) for source in ("engine", "geometry"))
    one, two = pictures(drawn), pictures(rays)
    same = drawn["instance.instance"] == rays["instance.instance"]
    with np.errstate(invalid="ignore"):
        cosine = (drawn["normals.normals"] * rays["normals.normals"]).sum(axis=-1)
        off = {
            "depth": np.abs(drawn["depth.depth"] - rays["depth.depth"]) * 1e3,
            "normals": np.degrees(np.arccos(np.clip(cosine, -1, 1))),
            "flow": np.linalg.norm(drawn["flow.flow"] - rays["flow.flow"], axis=-1),
        }
    known = {name: gap[same & np.isfinite(gap)] for name, gap in off.items()}
    hidden = drawn["flow.occluded"] == rays["flow.occluded"]
    alike = 100 * hidden[np.isfinite(off["depth"])].mean()
    clouds = [
        dict(zip(map(tuple, found["point_cloud.pixel"].tolist()), found["point_cloud.world"], strict=True))
        for found in (drawn, rays)
    ]
    apart = [
        np.linalg.norm(clouds[0][p] - clouds[1][p]) for p in clouds[0].keys() & clouds[1].keys() if same[p[1], p[0]]
    ]
    boxes = [{b["name"]: np.array(b["box"]) for b in labels[s]["boxes_2d"].records[0]} for s in ("engine", "geometry")]
    edge = max(int(np.abs(boxes[0][name] - boxes[1][name]).max()) for name in boxes[1])

    def grey(gap: np.ndarray, full: float) -> np.ndarray:
        shade = (255 * np.clip(np.nan_to_num(gap, nan=full) / full, 0, 1)).astype(np.uint8)
        return np.repeat(shade[..., None], 3, axis=-1)

    depth, normals, flow = (known[name] for name in off)
    differ = {
        f"depth: median {np.median(depth):.3f} mm, 99 % {np.percentile(depth, 99):.1f}; white 5": grey(
            off["depth"], 5.0
        ),
        f"instance: {100 * same.mean():.2f} % equal, boxes {edge} px apart": grey(~same * 1.0, 1.0),
        f"normals: median {np.median(normals):.3f}, 95 % {np.percentile(normals, 95):.1f} deg; white 10": grey(
            off["normals"], 10.0
        ),
        f"flow: 98 % {np.percentile(flow, 98):.4f} px, hidden {alike:.2f} % equal": grey(
            np.where(hidden, off["flow"], 1.0), 1.0
        ),
        f"points: median {1e3 * np.median(apart):.3f} mm apart": np.abs(
            one["point_cloud from above"].astype(int) - two["point_cloud from above"]
        ).astype(np.uint8),
    }
    for title in differ:
        print(f"    {title}")
    rows = [("drawn", one), ("by rays", two)]
    tiles = {f"{what} {title}": tile for what, shown in rows for title, tile in shown.items()}
    return laid_out(tiles | differ, 5)


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
        rgb, labels = labelled(engine)
        pages = {
            f"annotate_{engine}.jpg": sheet(rgb, labels["engine"]),
            f"annotate_{engine}_rays.jpg": compared(labels),
        }
        for name, page in pages.items():
            page.save(OUT / name, quality=80)
            print(f"{name}: {(OUT / name).stat().st_size / 1e3:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main())

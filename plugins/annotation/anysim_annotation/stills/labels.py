"""Labels of one still image, as plain data: what it shows, where, and what it was drawn from."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim_annotation.api import Labels
from anysim_annotation.stills.masks import encoded, outlines, run_lengths
from anysim_annotation.stills.spec import Masks

ANNOTATORS = ("boxes_2d", "boxes_3d", "camera", "instance")
OCCLUDED = (0.1, 0.5)
"""Shares that are hidden from which on KITTI's field `occluded` is 1 and 2."""


def objects(
    labels: Mapping[str, Labels], row: int, least_pixels: int, ignore: Sequence[str] = (), masks: Masks = "rle"
) -> list[dict[str, Any]]:
    """The objects of an image, each with its mask; those of fewer pixels, or to be ignored, are none."""
    ids = labels["instance"].arrays["instance"][row]
    spaces = {box["id"]: box for box in labels["boxes_3d"].records[row]}
    camera = labels["camera"].records[row][0]
    found: list[dict[str, Any]] = []
    for box in labels["boxes_2d"].records[row]:
        if box["visible"] < least_pixels or {box["name"], box["label"]} & set(ignore):
            continue
        mask = ids == box["id"]
        left, top, right, bottom = box["box"]
        one = {
            "name": box["name"],
            "label": box["label"],
            "bbox": [left, top, right - left, bottom - top],
            "area": box["visible"],
            "occlusion": box["occlusion"],
            "mask": _kept(mask, masks),
        }
        if box["id"] in spaces:
            one |= _in_space(spaces[box["id"]], camera)
        found.append(one)
    return found


def _kept(mask: Array, masks: Masks) -> dict[str, Any] | list[list[int]]:
    lines = outlines(mask) if masks == "polygons" else None
    return {"size": list(mask.shape), "counts": encoded(run_lengths(mask))} if lines is None else lines


def _in_space(box: Mapping[str, Any], camera: Mapping[str, Any]) -> dict[str, Any]:
    """A box before the camera: size, pose, and the share of the image's box around it that is out of the image."""
    matrix = np.array(camera["extrinsics"])
    turn = P.to_matrix(np.array(box["pose"][3:]))
    size = np.array(box["size"])
    bottom = np.array(box["pose"][:3]) - turn[:, 2] * size[2] / 2
    ahead = matrix[:3, :3] @ turn[:, 0]
    pixels = np.asarray(box["pixels"], dtype=float)
    low, high = pixels.min(axis=0), pixels.max(axis=0)  # NaN where a corner is behind the camera
    limit = np.array([camera["width"], camera["height"]])
    shown = np.prod(np.clip(np.minimum(high, limit) - np.maximum(low, 0), 0, None))
    whole = np.prod(high - low)
    truncated = 1.0 - float(shown / whole) if np.isfinite(whole) and whole > 0 else 1.0
    return {
        "pose": list(map(float, box["pose"])),
        "size": size.tolist(),
        "location": (matrix[:3, :3] @ bottom + matrix[:3, 3]).tolist(),
        "rotation_y": float(np.arctan2(-ahead[2], ahead[0])),
        "truncated": min(max(truncated, 0.0), 1.0),
    }


def kitti_line(one: Mapping[str, Any]) -> str:
    """An object as a line of KITTI's label files; what is turned otherwise than about its height is so only in part."""
    left, top, width, height = one["bbox"]
    hidden = sum(one["occlusion"] >= share for share in OCCLUDED)
    if "location" in one:
        (length, wide, high), place, turn = one["size"], one["location"], one["rotation_y"]
        alpha = float(np.arctan2(np.sin(sight := turn - np.arctan2(place[0], place[2])), np.cos(sight)))
    else:  # KITTI's own words for unknown
        (length, wide, high), place, turn, alpha = (-1.0, -1.0, -1.0), (-1000.0,) * 3, -10.0, -10.0
    numbers = [left, top, left + width, top + height, high, wide, length, *place, turn]
    kind = "".join(letter if letter.isalnum() else "_" for letter in one["label"])
    head = f"{kind} {one.get('truncated', 0.0):.2f} {hidden} {alpha:.4f}"
    return f"{head} {' '.join(f'{number:.4f}' for number in numbers)}\n"


def kitti_camera(camera: Mapping[str, Any]) -> str:
    """The camera as a calibration file of KITTI's, with P2 alone."""
    rows = [value for row in np.array(camera["intrinsics"]) for value in (*row, 0.0)]
    return f"P2: {' '.join(f'{value:.9g}' for value in rows)}\n"


def coco(said: Sequence[Mapping[str, Any]], about: Sequence[str]) -> dict[str, Any]:
    """Images with objects, as COCO's file of instances has them; `about` are keys of an image that it takes along."""
    kinds = sorted({thing["label"] for one in said for thing in one["objects"]})
    images, annotations = list[dict[str, Any]](), list[dict[str, Any]]()
    for number, one in enumerate(said, 1):
        lens = one["camera"]
        images.append(
            {"id": number, "file_name": one["file"], "width": lens["width"], "height": lens["height"]}
            | {key: one[key] for key in about}
        )
        for thing in one["objects"]:
            label = {"id": len(annotations) + 1, "image_id": number, "iscrowd": 0}
            label |= {"category_id": kinds.index(thing["label"]) + 1, "segmentation": thing["mask"]}
            annotations.append(label | {key: thing[key] for key in ("bbox", "area", "name", "occlusion")})
    categories = [{"id": number, "name": kind} for number, kind in enumerate(kinds, 1)]
    return {"images": images, "annotations": annotations, "categories": categories}

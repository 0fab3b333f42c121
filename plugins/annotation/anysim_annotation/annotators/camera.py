"""Parameters of the camera: where it is, and its lens."""

from collections.abc import Mapping

from anysim.math import pose as P
from anysim_annotation.api import Annotator, Field, Labels, listed
from anysim_annotation.lens import intrinsics
from anysim_annotation.view import View


class CameraParameters(Annotator):
    """One record of each image. `intrinsics` takes points of the optical frame (x right, y down, z ahead) to pixels."""

    records: Mapping[str, Field] = {
        "width": Field((), "px"),
        "height": Field((), "px"),
        "fov": Field((), "degrees", "", "vertical"),
        "intrinsics": Field((3, 3), "px", "", "pixel coordinates from the image's upper left corner"),
        "pose": Field((7,), "m, xyzw", "", "of the optical frame, world frame"),
        "extrinsics": Field((4, 4), "m", "", "takes points of the world to the optical frame"),
        "near": Field((), "m"),
        "far": Field((), "m"),
    }

    def annotate(self, view: View) -> Labels:
        scene, rows = self.scene, list[list[dict[str, object]]]()
        for pose, fov in zip(view.pose, view.fov.tolist(), strict=True):
            turned = P.inverse(pose)
            matrix = [[*row, place] for row, place in zip(P.to_matrix(turned[3:]).tolist(), turned[:3], strict=True)]
            record = {"width": scene.width, "height": scene.height, "fov": fov, "near": scene.near, "far": scene.far}
            record["intrinsics"] = intrinsics(fov, scene.width, scene.height)
            record |= {"pose": pose, "extrinsics": [*matrix, [0.0, 0.0, 0.0, 1.0]]}
            rows.append([record])
        return listed(rows)

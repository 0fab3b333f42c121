"""The table of what of a recording goes where in a data set, from the exporters' own declarations, into the docs.

    python scripts/export_table.py [--check]

`--check` writes nothing and exits with 1 if the page has drifted from the code.
"""

import sys
from typing import Any

from generated import main

from anysim.record.header import ArrayLayout, StateLayout
from anysim.record.manifest import CameraEntry, FileEntry, Manifest, StreamEntry
from anysim_export.api import DataSet
from anysim_export.job import omitted
from anysim_export.parts import made
from anysim_export.streams import streams_of

FORMS = ("lerobot", "robomimic", "rlds-ready", "webdataset", "rerun", "foxglove", "coco")


def recording() -> Manifest:
    """A recording with a stream of each kind."""
    depth = {"kind": "image", "shape": (4, 6), "dtype": "float32", "unit": "m", "about": {"near": 0.01, "far": 10.0}}
    entities = {"kind": "image", "shape": (4, 6), "dtype": "uint16", "about": {"legend": [{"id": 1, "name": "cube"}]}}
    streams = {
        "camera/front/depth": depth,
        "camera/front/segmentation": entities,
        "annotation/front/boxes_2d": {"kind": "data"},
        "language/narration": {"kind": "text"},
    }
    names = ("front.mp4", "camera.mcap", "annotation.mcap", "language.mcap")
    layout = StateLayout(
        bodies=("cube",),
        joints=("arm.hinge",),
        action=("arm.hinge",),
        state={"body_pose": (1, 7), "joint_pos": (1,), "imu": (6,)},
        obs={"policy": ArrayLayout(shape=(3,)), "privileged": ArrayLayout(shape=(2,), dtype="float32")},
    )
    run: Any = {
        "task": "pick_cube",
        "seed": 0,
        "engine": "null",
        "engine_version": "",
        "world_hash": "",
        "control_dt": 0.02,
    }
    episode: Any = {
        "env": 0,
        "episode": 0,
        "episode_seed": 7,
        "status": "success",
        "steps": 4,
        "has_initial_frame": True,
    }
    return Manifest(
        **run,
        **episode,
        layout=layout,
        writer="mcap",
        final_digest="0" * 64,
        cameras={"front": CameraEntry(width=6, height=4, file="front.mp4", frames=5, fps=50.0)},
        streams={
            name: StreamEntry.model_validate(one | {"file": f"{name.split('/')[0]}.mcap", "rows": 5})
            for name, one in streams.items()
        },
        files={name: FileEntry(bytes=0, sha256="0" * 64) for name in names},
    )


def rows() -> str:
    """Streams as rows, forms as columns; what an option brings says so."""
    one = recording()
    names = {f"camera/front{rest}": f"camera/NAME{rest}" for rest in ("", "/depth", "/segmentation")}
    names |= {"annotation/front/boxes_2d": "annotation/NAME/boxes_2d", "state/imu": "state/SENSOR"}
    columns: list[dict[str, str]] = []
    for form in FORMS:
        exporter, options = made(form, {})
        data = DataSet([one], options)
        places = dict(exporter.places(data))
        for stream, option in omitted(form, exporter, data).items():
            if option:
                key, value = option.split("=")
                other, _ = made(form, {key: value == "true"})
                places[stream] = f"{other.places(data)[stream]} with `{option}`"
        columns.append(
            {stream: place.replace("front", "NAME").replace("imu", "SENSOR") for stream, place in places.items()}
        )
    lines = [f"| stream | {' | '.join(f'`{form}`' for form in FORMS)} |", f"|---|{'---|' * len(FORMS)}"]
    for stream in streams_of(one):
        cells = [column.get(stream, "—") for column in columns]
        lines.append(f"| `{names.get(stream, stream)}` | {' | '.join(cells)} |")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main(__doc__, "export-table", "export_table.py", ("docs/export.md",), rows))

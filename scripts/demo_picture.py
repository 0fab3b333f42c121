"""Draw what a run recorded: `python scripts/demo_picture.py RUN_DIRECTORY` writes `RUN_DIRECTORY/demo.png`.

One row for each camera of a trajectory, from the first image on the left to the last on the right.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

COLUMNS, TRAJECTORIES = 6, 4
PICTURE = "demo.png"


def spread(video: Path, count: int) -> list[Any]:
    """At most `count` images (H, W, 3) uint8 of a video, evenly spread, the first and the last among them."""
    import av
    import numpy as np

    with av.open(str(video)) as container:
        images = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    chosen = np.unique(np.linspace(0, len(images) - 1, min(count, len(images))).round().astype(int))
    return [images[i] for i in chosen]


def draw(videos: Sequence[Path], out: Path) -> None:
    """Write the picture."""
    from matplotlib.figure import Figure

    rows = [spread(video, COLUMNS) for video in videos]
    height, width = rows[0][0].shape[:2]
    figure = Figure(figsize=(2.0 * COLUMNS, (2.0 * height / width + 0.25) * len(rows)), layout="constrained")
    axes = figure.subplots(len(rows), COLUMNS, squeeze=False)
    for axis in axes.flat:
        axis.set_axis_off()
    for line, (video, images) in enumerate(zip(videos, rows, strict=True)):
        for column, image in enumerate(images):
            axes[line, column].imshow(image)
        env, episode = (int(number) for number in video.parent.name.removeprefix("env_").split("_episode_"))
        axes[line, 0].set_title(f"{video.stem} camera: env {env}, episode {episode}", fontsize=7, loc="left")
    figure.savefig(out, dpi=100)


def main() -> None:
    """Draw the run that the command line names."""
    parser = argparse.ArgumentParser(description="Draw what a run recorded.")
    parser.add_argument("run", type=Path, help="the directory of the run")
    parser.add_argument("--trajectories", type=int, default=TRAJECTORIES, help="how many of them are drawn")
    parser.add_argument("--out", type=Path, help=f"the picture; default RUN/{PICTURE}")
    arguments = parser.parse_args()
    run: Path = arguments.run
    recorded = sorted({video.parent for video in run.rglob("*.mp4")})
    if not recorded:
        sys.exit(f"{run} holds no video; record with a camera: record: {{writer: mcap, cameras: [front]}}")
    chosen = recorded[: arguments.trajectories]
    out: Path = arguments.out or run / PICTURE
    draw([video for folder in chosen for video in sorted(folder.glob("*.mp4"))], out)
    print(f"{out}: {len(chosen)} of {len(recorded)} trajectories")


if __name__ == "__main__":
    main()

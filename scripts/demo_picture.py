"""Draw what a run recorded: `python scripts/demo_picture.py RUN_DIRECTORY` writes `demo.png` and `demo.gif` into it.

The picture has one row for each camera of a trajectory, from the first image on the left to the last on the right; the
film shows several trajectories side by side, through the first camera of each. Says in words what each video shows.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

COLUMNS, TRAJECTORIES = 6, 4
PICTURE, FILM = "demo.png", "demo.gif"
FILM_BYTES = 1_000_000
"""What a page can carry: the film is drawn smaller until it fits."""

FILM_SIZES = ((320, 240, 256, 2), (280, 210, 256, 2), (240, 180, 128, 4), (160, 120, 64, 6), (80, 60, 32, 8))
"""Of a trajectory: width and height [px], colours, and every how many images one is shown; the first that fits."""


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
        axes[line, 0].set_title(words(video), fontsize=7, loc="left")
    figure.savefig(out, dpi=100)


def words(video: Path) -> str:
    """What a video shows: `pick_cube: world 1, episode 2: camera wrist`."""
    env, episode = (int(number) for number in video.parent.name.removeprefix("env_").split("_episode_"))
    run = json.loads((video.parents[2] / "run.json").read_text("utf-8"))
    return f"{run['task']}: world {env + 1}, episode {episode + 1}: camera {video.stem}"


def film(videos: Sequence[Path], out: Path) -> None:
    """Write several videos side by side as one GIF of less than `FILM_BYTES`; the last image of each stays."""
    import av
    import numpy as np
    from PIL import Image

    from anysim_parity.world_pictures import montage

    shown = []
    fps = 25.0
    for video in videos:
        with av.open(str(video)) as container:
            fps = float(container.streams.video[0].average_rate or fps)
            shown.append([frame.to_image() for frame in container.decode(video=0)])
    longest = max(map(len, shown))
    for width, height, colors, every in FILM_SIZES:
        pages = []
        for moment in [*range(0, longest, every), *[longest - 1] * 6]:
            now = [images[min(moment, len(images) - 1)].resize((width, height)) for images in shown]
            pages.append(Image.fromarray(montage(np.stack([np.asarray(image) for image in now]))))
        # one palette for all, which keeps colours that few pixels have: those of the goal and the cube
        palette = pages[0].quantize(colors, method=Image.Quantize.MAXCOVERAGE)
        pages = [one.quantize(palette=palette, dither=Image.Dither.NONE) for one in pages]
        pages[0].save(out, save_all=True, append_images=pages[1:], duration=round(1000 * every / fps), loop=0)
        if out.stat().st_size < FILM_BYTES:
            return
    out.unlink()
    sys.exit(f"{out} would be larger than {FILM_BYTES:,} bytes; choose fewer --trajectories")


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
    videos = [sorted(folder.glob("*.mp4")) for folder in chosen]
    draw([video for row in videos for video in row], out)
    film([row[0] for row in videos], out.with_name(FILM))
    print(f"{out}: {len(chosen)} of {len(recorded)} trajectories")
    print(f"{out.with_name(FILM)}: the same as a film")
    for row in videos:
        for video in row:
            print(f"{video}: {words(video)}")


if __name__ == "__main__":
    main()

"""Pictures of docs/cameras.md: events as flying cameras and one that stands film them: `scripts/flight_pictures.py`.

It collects one episode of each event of docs/examples/events.yaml on MuJoCo and takes frames of its videos.
"""

import tempfile
from pathlib import Path

import av
import numpy as np
from PIL import Image

import anysim
from anysim.skills.runner import SkillPolicy
from anysim_recording.collector import Collector

ROOT = Path(__file__).parents[1]
OUT = ROOT / "docs" / "images" / "flights.jpg"
CAMERAS, FRAMES = ("round", "near", "top"), 5
MOMENTS = {"drop": (0.0, 0.4), "pour": (0.0, 0.5), "collision": (0.55, 1.0)}
"""Shares of the videos between which the frames are."""


def row(folder: Path, camera: str, first: float, last: float) -> np.ndarray:
    """Frames (H, W, 3) of a video side by side."""
    with av.open(str(folder / f"{camera}.mp4")) as video:
        images = [frame.to_ndarray(format="rgb24") for frame in video.decode(video=0)]
    chosen = np.linspace(first * (len(images) - 1), last * (len(images) - 1), FRAMES).round().astype(int)
    return np.concatenate([images[k] for k in chosen], axis=1)


def main() -> None:
    """Write the sheet: a block of rows for each event, a row for each camera."""
    rows: list[np.ndarray] = []
    for event, span in MOMENTS.items():
        source, asked = ROOT / "docs" / "examples" / "events.yaml", [f"level={event}", "record.fps=50"]
        with tempfile.TemporaryDirectory() as folder, anysim.make(source, num_envs=1, overrides=asked) as env:
            for result in Collector(env, SkillPolicy(env), Path(folder), 1, 0).run():
                assert result.path is not None
                rows += [row(result.path, camera, *span) for camera in CAMERAS]
    Image.fromarray(np.concatenate(rows)).save(OUT, quality=70, optimize=True)


if __name__ == "__main__":
    main()

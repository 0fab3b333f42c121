"""The demo's picture is drawn from the videos of a run."""

import subprocess
import sys
from pathlib import Path

import demo_picture
import numpy as np
import pytest


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A run of two trajectories, each with a video of ten images that grow brighter."""
    import av

    (tmp_path / "run.json").write_text('{"task": "pick_cube"}')
    for name in ("env_0000_episode_0000", "env_0001_episode_0000"):
        folder = tmp_path / "episodes" / name
        folder.mkdir(parents=True)
        with av.open(str(folder / "front.mp4"), "w") as container:
            stream = container.add_stream("mpeg4", rate=10)
            stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
            for i in range(10):
                image = np.full((48, 64, 3), 25 * i, dtype=np.uint8)
                container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
            container.mux(stream.encode())
    return tmp_path


def test_images_are_spread_from_the_first_to_the_last(run: Path) -> None:
    images = demo_picture.spread(next(run.rglob("front.mp4")), 4)
    brightness = [float(image.mean()) for image in images]
    assert [image.shape for image in images] == [(48, 64, 3)] * 4
    assert brightness == sorted(brightness)
    assert brightness[0] < 10
    assert brightness[-1] > 215


def test_a_short_video_gives_what_it_has(run: Path) -> None:
    assert len(demo_picture.spread(next(run.rglob("front.mp4")), 50)) == 10


def test_the_program_writes_a_picture(run: Path) -> None:
    done = subprocess.run(
        [sys.executable, demo_picture.__file__, str(run)], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert "2 of 2 trajectories" in done.stdout
    assert (run / "demo.png").read_bytes().startswith(b"\x89PNG")
    assert "env_0001_episode_0000/front.mp4: pick_cube: world 2, episode 1: camera front" in done.stdout


def test_the_film_moves_to_the_end_and_is_small(run: Path) -> None:
    from PIL import Image

    demo_picture.film(sorted(run.rglob("front.mp4")), run / "demo.gif")
    assert (run / "demo.gif").stat().st_size < demo_picture.FILM_BYTES
    with Image.open(run / "demo.gif") as film:
        film.seek(film.n_frames - 1)
        last = np.asarray(film.convert("RGB"))
        film.seek(0)
        first = np.asarray(film.convert("RGB"))
    assert first[: first.shape[0] // 2, : first.shape[1] // 3].mean() < 40
    assert last[: last.shape[0] // 2, : last.shape[1] // 3].mean() > 200


def test_a_film_that_would_be_too_large_is_not_left(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(demo_picture, "FILM_BYTES", 10)
    with pytest.raises(SystemExit, match="fewer --trajectories"):
        demo_picture.film(sorted(run.rglob("front.mp4")), run / "demo.gif")
    assert not (run / "demo.gif").exists()


def test_a_run_without_videos_is_an_error_with_a_remedy(tmp_path: Path) -> None:
    command = [sys.executable, demo_picture.__file__, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 1
    assert "holds no video; record with a camera" in done.stderr

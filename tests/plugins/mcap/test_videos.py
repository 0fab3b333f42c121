from fractions import Fraction

import av
import numpy as np
import pytest

from anysim.errors import RecordError
from anysim.record.reader import open_trajectory
from anysim_inspect.verify import verify
from anysim_mcap.video import frame_rate


def test_frames_sizes_and_rates(tmp_path, record):
    final = record(tmp_path, steps=8)
    cameras = open_trajectory(final).manifest.cameras
    front, wrist = cameras["front"], cameras["wrist"]
    assert (front.file, front.frames, front.first_step, front.fps, front.every) == ("front.mp4", 5, 0, 25.0, 2)
    assert (wrist.file, wrist.frames, wrist.first_step, wrist.fps, wrist.every) == ("wrist.mp4", 9, 0, 50.0, 1)
    with av.open(str(final / "wrist.mp4")) as container:
        stream = container.streams.video[0]
        assert (stream.width, stream.height) == (32, 18)  # H.264 in yuv420p wants even sizes
        assert stream.average_rate == 50
        assert stream.frames == 9
        assert sum(1 for _ in container.decode(stream)) == 9


def test_images_come_back_at_their_steps_in_about_their_colours(tmp_path, record, sample):
    reader = open_trajectory(record(tmp_path, steps=8))
    for name, steps in (("front", range(0, 9, 2)), ("wrist", range(9))):
        camera = sample.CAMERAS[name]
        images = list(reader.images(name))
        assert [step for step, _ in images] == list(steps)
        for step, image in images:
            assert image.shape == (camera.height, camera.width, 3)
            wanted = sample.picture(camera.width, camera.height, step).astype(float)
            # away from the edge between the halves, where the chroma of two pixels is shared
            for columns in (slice(0, camera.width // 2 - 4), slice(camera.width // 2 + 4, None)):
                gap = np.abs(image[:, columns].astype(float) - wanted[:, columns])
                assert gap.mean() < 4
                assert gap.max() < 30


def test_the_first_image_may_come_later(tmp_path, record):
    reader = open_trajectory(record(tmp_path, first=1, steps=5))
    assert reader.manifest.cameras["front"].first_step == 2
    assert [step for step, _ in reader.images("front")] == [2, 4]


def test_an_unknown_camera(tmp_path, record):
    reader = open_trajectory(record(tmp_path))
    with pytest.raises(RecordError, match=r"no camera 'frnt'; did you mean 'front'\? \(cameras: front, wrist\)"):
        list(reader.images("frnt"))


def test_a_camera_that_took_no_image_makes_no_video(tmp_path, record):
    final = record(tmp_path, first=1, steps=1)
    assert list(open_trajectory(final).manifest.cameras) == ["wrist"]
    assert not (final / "front.mp4").exists()
    assert verify(final) == []


@pytest.mark.parametrize(
    ("dt", "every", "rate"),
    [(0.02, 2, Fraction(25)), (1 / 60, 1, Fraction(60)), (1 / 240, 8, Fraction(30)), (0.03, 1, Fraction(100, 3))],
)
def test_frame_rates_are_exact(dt, every, rate):
    assert frame_rate(dt, every) == rate

"""Videos that are made in the page: what a camera saw while time went on."""

from pathlib import Path

import anysim
from anysim.testing.engines import require_drawing
from anysim_mcap.video import images
from anysim_viewer.gate import Access
from anysim_viewer.live import LiveView
from anysim_viewer.page import Page
from tests.plugins.serving.helpers import SEEN


def test_a_video_holds_the_pictures_of_a_camera(tmp_path: Path) -> None:
    require_drawing("mujoco")
    page = Page(Access(token="token"), "seen")
    try:
        with anysim.make(SEEN, overrides=["task.horizon=100", "record.fps=25"]) as env:
            view = LiveView(page, env, 0, out=tmp_path)
            view.record()
            for _ in range(4):
                view.forward()
            view.record()
            view.record()  # another one, which is completed at the end
            view.close()
            first, second = sorted(tmp_path.glob("*/*.mp4"))
            every = max(1, round(1.0 / (25 * env.engine.world.physics.control_dt)))
            assert len(list(images(first, 32, 24))) == 1 + 4 // every
            assert len(list(images(second, 32, 24))) == 1
    finally:
        page.close()

"""The page in a real browser: it shows the scene, and what is pressed there happens here."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import anysim
from anysim_viewer.gate import Access
from anysim_viewer.live import LiveView
from anysim_viewer.page import Page
from tests.plugins.viewer.browser import CHROMIUM, Browser, chromium
from tests.task.helpers import BLOCKS

pytestmark = [pytest.mark.slow, pytest.mark.full, pytest.mark.skipif(not CHROMIUM, reason="Chromium is not installed")]


@contextmanager
def seen(folder: Path, play: bool = False) -> Iterator[tuple[Browser, LiveView, Page]]:
    """A browser on the page of blocks, while the loop runs on a thread."""
    page, stop = Page(Access(token="token"), "blocks"), threading.Event()
    try:
        with anysim.make(BLOCKS, num_envs=2) as env:
            view = LiveView(page, env, 3, play=play, out=folder)
            thread = threading.Thread(target=lambda: view.run(stop))
            thread.start()
            try:
                with chromium(folder / "profile") as browser:
                    browser.open(page.url)
                    browser.wait("(document.body?.innerText ?? '').includes('episode seed')")
                    yield browser, view, page
            finally:
                stop.set()
                page.ask(lambda: None)
                thread.join()
    finally:
        page.close()


def test_buttons_act_and_the_page_asks_nobody_else(tmp_path: Path) -> None:
    with seen(tmp_path) as (browser, view, page):
        browser.click("Step")
        browser.wait("document.body.innerText.includes('step 1 of 8')")
        browser.click("Play")
        browser.wait("[...document.querySelectorAll('button')].some(b => b.innerText.trim() == 'Pause')")
        browser.click("Pause")
        browser.click("Reset")
        browser.wait("document.body.innerText.includes('step 0 of 8')")
        assert view.env.scene.elapsed.tolist() == [0, 0]
        sizes = browser.run("[...document.querySelectorAll('canvas')].map(c => c.width * c.height)")
        assert max(sizes) > 100_000
        others = [
            url for url in browser.asked if not url.startswith((page.address, "data:", "blob:", "ws://127.0.0.1"))
        ]
        assert not others
        assert browser.run("location.href") == page.address  # without the token
        assert not browser.run("document.cookie")  # which scripts cannot read
        assert not browser.complaints


def test_a_gizmo_is_dragged_with_the_mouse(tmp_path: Path) -> None:
    with seen(tmp_path) as (browser, view, page):
        view.page.ask(lambda: setattr(view._mover.choice, "value", "goal goal"))
        before = view.env.scene.poses["goal"][0].copy()
        client = next(iter(page.server.get_clients().values()))
        # the middle of the gizmo on the screen, by the camera that the page tells
        for _ in range(40):
            x, y = _on_screen(client, before[:3])
            browser.drag((x, y), (x + 60.0, y - 40.0))
            if not np.allclose(view.env.scene.poses["goal"][0], before):
                break
        assert np.linalg.norm(view.env.scene.poses["goal"][0, :3] - before[:3]) > 0.01


def _on_screen(client: object, point: np.ndarray) -> tuple[float, float]:
    """Where a point of the scene is drawn in the page [px]."""
    from anysim.math import pose as P

    camera = client.camera
    turn = np.asarray(camera.wxyz)[[1, 2, 3, 0]]
    local = P.rotate_inverse(turn, point - np.asarray(camera.position))
    focal = camera.image_height / (2.0 * np.tan(camera.fov / 2.0))
    return (camera.image_width / 2 + focal * local[0] / local[2], camera.image_height / 2 + focal * local[1] / local[2])

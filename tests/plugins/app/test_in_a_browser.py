"""The local page in a real browser: from its first page to a view that a click has started."""

import tempfile
from pathlib import Path

import pytest

from anysim_app.page import serving_app
from tests.plugins.viewer.browser import CHROMIUM, chromium

pytestmark = [pytest.mark.slow, pytest.mark.full, pytest.mark.skipif(not CHROMIUM, reason="Chromium is not installed")]


def test_a_view_is_started_by_a_click_and_opened(tmp_path: Path) -> None:
    service, url = serving_app(tmp_path / "runs", 0)
    service.start()
    try:
        with tempfile.TemporaryDirectory() as profile, chromium(Path(profile)) as browser:
            browser.open(url)
            browser.wait("document.querySelectorAll('.card').length > 10")
            assert "token" not in browser.run("location.href")
            assert browser.run("document.cookie") == ""  # no script reads it
            browser.run("document.querySelector('a[href=\"/tasks/reach\"]').click()")
            browser.click("Look at it live")
            browser.wait("document.body?.innerText.includes('open the view')", 180)
            browser.run("location.href = document.querySelector('a[target=_blank]').href")
            browser.wait("document.body?.innerText.includes('acts: expert')", 120)
            assert not [
                asked for asked in browser.asked if not asked.startswith(("http://127.0.0.1:", "ws:", "data:", "blob:"))
            ]
            browser.open(f"{service.address}/programs")
            browser.wait("document.querySelector('td a') && (document.querySelector('td a').click() || true)")
            browser.click("Stop")
            browser.wait("/done|stopped/.test(document.body?.innerText)", 60)
    finally:
        service.stop()

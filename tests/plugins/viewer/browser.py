"""A headless Chromium, driven through its debugging protocol: pages, clicks, values, pictures."""

import base64
import json
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import Any
from urllib.request import urlopen

from websockets.sync.client import connect

CHROMIUM = next(
    (found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name))), ""
)
FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--no-first-run",
    "--disable-extensions",
    "--disable-background-networking",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--hide-scrollbars",
    "--mute-audio",
    "--remote-debugging-port=0",
)


class Browser:
    """One tab."""

    def __init__(self, socket: Any) -> None:
        self._socket, self._numbers = socket, count(1)
        self.asked: list[str] = []
        """Addresses that the page asked for."""
        self.complaints: list[str] = []
        """What the browser and the page's scripts complained of."""
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **params: Any) -> Any:
        """What the browser answers to a command."""
        number = next(self._numbers)
        self._socket.send(json.dumps({"id": number, "method": method, "params": params}))
        while True:
            told = json.loads(self._socket.recv(timeout=120))
            if told.get("method") in ("Network.requestWillBeSent", "Network.webSocketCreated"):
                params = told["params"]
                self.asked.append(params["url"] if "url" in params else params["request"]["url"])
            if told.get("method") == "Log.entryAdded" and told["params"]["entry"]["level"] == "error":
                self.complaints.append(told["params"]["entry"]["text"])
            if told.get("id") == number:
                if "error" in told:
                    raise RuntimeError(f"{method}: {told['error']}")
                return told["result"]

    def open(self, url: str) -> None:
        """Go to an address."""
        self.call("Page.navigate", url=url)

    def run(self, script: str) -> Any:
        """The value of an expression in the page."""
        found = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in found:
            raise RuntimeError(found["exceptionDetails"]["exception"].get("description"))
        return found["result"].get("value")

    def wait(self, script: str, seconds: float = 90.0) -> Any:
        """Wait until an expression is true in the page, and return its value."""
        end = time.monotonic() + seconds
        while not (value := self.run(script)):
            if time.monotonic() > end:
                raise TimeoutError(
                    f"{script}; the page says: {self.run('document.body.innerText')[:2000]}; {self.complaints}"
                )
            time.sleep(0.25)
        return value

    def click(self, words: str) -> None:
        """Press the button with these words."""
        self.wait(
            f"(() => {{ const b = [...document.querySelectorAll('button')].find(b => b.innerText.trim() == "
            f"{json.dumps(words)}); if (b) b.click(); return !!b; }})()",
            30,
        )

    def drag(self, start: tuple[float, float], end: tuple[float, float], steps: int = 12) -> None:
        """Drag with the mouse from one point of the page to another [px]."""
        self._mouse("mouseMoved", *start)
        time.sleep(0.5)
        self._mouse("mouseMoved", start[0] + 0.5, start[1])
        time.sleep(0.5)
        self._mouse("mousePressed", *start, button="left", clickCount=1)
        for k in range(1, steps + 1):
            x, y = (a + (b - a) * k / steps for a, b in zip(start, end, strict=True))
            self._mouse("mouseMoved", x, y, button="left")
            time.sleep(0.1)
        self._mouse("mouseReleased", *end, button="left", clickCount=1)

    def _mouse(self, kind: str, x: float, y: float, **more: Any) -> None:
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)

    def picture(self, path: Path, kind: str = "png") -> None:
        """Write what is seen."""
        more = {"quality": 85} if kind == "jpeg" else {}
        found = self.call("Page.captureScreenshot", format=kind, **more)
        path.write_bytes(base64.b64decode(found["data"]))


@contextmanager
def chromium(folder: Path, size: tuple[int, int] = (1280, 800)) -> Iterator[Browser]:
    """A browser with one tab, whose profile is in `folder`."""
    process = subprocess.Popen(
        [CHROMIUM, *FLAGS, f"--window-size={size[0]},{size[1]}", f"--user-data-dir={folder}", "about:blank"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        told, end = folder / "DevToolsActivePort", time.monotonic() + 60
        while not told.is_file() or not told.read_text().strip():
            if time.monotonic() > end:
                raise TimeoutError("Chromium did not start within a minute")
            time.sleep(0.1)
        port = told.read_text().split()[0]
        with urlopen(f"http://127.0.0.1:{port}/json", timeout=30) as answer:
            tab = next(tab for tab in json.load(answer) if tab["type"] == "page")
        with connect(tab["webSocketDebuggerUrl"], max_size=1 << 28, compression=None) as socket:
            yield Browser(socket)
    finally:
        process.terminate()
        process.wait(30)

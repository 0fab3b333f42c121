"""A person who looks at a page: a client that keeps what it was told, and presses and chooses."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from anysim_viewer.client import Client, connected
from anysim_viewer.view import View

PATIENCE = 40.0
"""[s] after which a test gives up."""


class Person:
    """Nodes of the scene and elements of the panel as a browser has them, by name and by label."""

    def __init__(self, client: Client) -> None:
        self.client = client
        self.nodes: dict[str, dict[str, Any]] = {}
        self.elements: dict[str, dict[str, Any]] = {}
        self.told: list[str] = []

    def look(self, seconds: float = 0.05) -> None:
        """Take in what comes within a moment."""
        for message in self.client.receive(seconds):
            kind = message["type"]
            if kind == "NotificationShowMessage":
                self.told.append(message["props"]["body"])
            elif kind == "GuiUpdateMessage":
                self.elements[message["uuid"]].update(message["updates"])
            elif kind.startswith("Gui") and "props" in message:
                self.elements[message["uuid"]] = {**message["props"], "value": message.get("value"), "kind": kind}
            elif kind == "RemoveSceneNodeMessage":
                gone = [name for name in self.nodes if f"{name}/".startswith(message["name"] + "/")]
                for name in gone:
                    del self.nodes[name]
            elif "name" in message and "props" in message:
                self.nodes[message["name"]] = dict(message["props"])
            elif "name" in message and message["name"] in self.nodes:
                node = self.nodes[message["name"]]
                node.update(message.get("updates", {}))
                node.update({key: message[key] for key in ("position", "wxyz", "visible") if key in message})

    def until(self, true: Callable[[], object]) -> None:
        """Look until something is true."""
        end = time.monotonic() + PATIENCE
        while not true():
            assert time.monotonic() < end, (
                sorted(self.nodes),
                [e.get("label") for e in self.elements.values()],
                self.told,
            )
            self.look()

    def find(self, label: str) -> str:
        """The element with a label, once it is there."""
        found: list[str] = []

        def there() -> bool:
            found[:] = [uuid for uuid, one in self.elements.items() if one.get("label") == label]
            return bool(found)

        self.until(there)
        return found[-1]

    def press(self, label: str) -> None:
        """Press a button."""
        self.client.send("GuiUpdateMessage", uuid=self.find(label), updates={"value": True})

    def choose(self, label: str, value: object) -> None:
        """Set the value of an element."""
        self.client.send("GuiUpdateMessage", uuid=self.find(label), updates={"value": value})

    def drag(self, position: tuple[float, float, float]) -> None:
        """Drag the gizmo, and hold it upright."""
        self.until(lambda: "/gizmo" in self.nodes)
        self.client.send(
            "TransformControlsUpdateMessage", name="/gizmo", wxyz=(1.0, 0.0, 0.0, 0.0), position=position, owner=""
        )

    @property
    def words(self) -> str:
        """What the texts of the panel say."""
        return "\n".join(str(one["_markdown"]) for one in self.elements.values() if one["kind"] == "GuiMarkdownMessage")


@contextmanager
def looking(view: View, url: str) -> Iterator[Person]:
    """A person, while the loop of a view runs on a thread."""
    stop = threading.Event()
    failed: list[BaseException] = []

    def run() -> None:
        try:
            view.run(stop)
        except BaseException as error:  # noqa: BLE001 - raised below
            failed.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        with connected(url) as client:
            yield Person(client)
    finally:
        stop.set()
        view.page.ask(lambda: None)
        thread.join()
    if failed:
        raise failed[0]

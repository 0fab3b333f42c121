"""A recording in memory, with a stream of each kind, of which one can be another one."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from export_table import recording

from anysim.conventions import Array
from anysim.record.reader import TrajectoryReader
from anysim.record.streams import StreamRow


class Made(TrajectoryReader):
    """Drawn numbers; `changed` names the stream that is drawn anew. Images are there at every second step."""

    def __init__(self, changed: str = "") -> None:
        manifest = recording()
        if changed == "collect/status":
            manifest = manifest.model_copy(update={"status": "failed"})
        super().__init__(Path("made"), manifest)
        self._changed = changed

    def _drawn(self, stream: str, *shape: int) -> Array:
        seed = [*stream.encode(), int(stream == self._changed)]
        return np.random.default_rng(seed).random(shape)

    def _word(self, stream: str) -> str:
        return f"{stream} {'changed' if stream == self._changed else ''}"

    @property
    def times(self) -> Array:
        return 0.02 * np.arange(1, 5)

    @property
    def actions(self) -> Array:
        return self._drawn("action", 4, 1)

    @property
    def states(self) -> Mapping[str, Array]:
        return {name: self._drawn(f"state/{name}", 5, *size)[1:] for name, size in self.manifest.layout.state.items()}

    @property
    def initial_state(self) -> Mapping[str, Array]:
        return {name: self._drawn(f"state/{name}", 5, *size)[0] for name, size in self.manifest.layout.state.items()}

    @property
    def obs(self) -> Mapping[str, Array]:
        return {name: rows[1:] for name, rows in self._observed().items()}

    @property
    def initial_obs(self) -> Mapping[str, Array]:
        return {name: rows[0] for name, rows in self._observed().items()}

    def _observed(self) -> dict[str, Array]:
        return {
            name: self._drawn(f"observation/{name}", 5, *one.shape).astype(one.dtype)
            for name, one in self.manifest.layout.obs.items()
        }

    @property
    def rewards(self) -> Array:
        return self._drawn("collect/reward", 4)

    @property
    def statuses(self) -> tuple[str, ...]:
        return ("running", "running", "running", self.manifest.status)

    @property
    def annotations(self) -> tuple[Mapping[str, Any], ...]:
        return tuple({"skill": self._word("annotation"), "phase": "down" if t < 2 else "up"} for t in range(4))

    @property
    def language(self) -> tuple[str, ...]:
        return (self._word("language"),) * 4

    def images(self, camera: str) -> Iterator[tuple[int, Array]]:
        for step in (0, 2, 4):
            yield step, (255 * self._drawn(f"camera/{camera}", 5, 4, 6, 3)[step]).astype(np.uint8)

    def rows(self, name: str) -> Iterator[StreamRow]:
        entry = self.manifest.streams.get(name)
        if entry is None:
            yield from super().rows(name)
        elif entry.kind == "image":
            scale = 1000.0 if entry.dtype == "uint16" else 3.0
            for step in (0, 2, 4):
                yield StreamRow(name, step, (scale * self._drawn(name, 5, 4, 6)[step]).astype(entry.dtype))
        else:
            word = self._word(name)
            yield StreamRow(name, 1, word if entry.kind == "text" else {"boxes": [word]})

    def faults(self) -> list[str]:
        return []

"""Imperfect observations: a term as a policy gets it, late, biased and noisy, as its spec says."""

from collections.abc import Callable, Mapping

import numpy as np

from anysim.conventions import Array
from anysim.engine.snapshots.row_checks import refuse_range
from anysim.randomization.draw import DelayLine, draw_rows, is_random, longest_delay, noise_rows, note_noise
from anysim.randomization.streams import Origin, Streams
from anysim.task.scene import SceneView
from anysim_schemas.task import ObservationTermSpec


class ObservedTerm:
    """One observed term. What is truth in it, and what is not, is drawn by streams of its own."""

    def __init__(
        self,
        term: Callable[[], Array],
        spec: ObservationTermSpec,
        name: str,
        source: str,
        scene: SceneView,
        streams: Streams,
    ) -> None:
        """`name` is that of its streams (`task/observations.policy/joint_pos`), `source` its path in the spec."""
        self._term, self._spec, self._name, self._source = term, spec, name, source
        self._scene, self._streams = scene, streams
        self._longest = longest_delay(spec.delay)
        self._line: DelayLine | None = None
        self._bias: Array | None = None

    @staticmethod
    def alters(spec: ObservationTermSpec) -> bool:
        """Whether a term is anything but the truth of this moment."""
        return spec.noise is not None or spec.bias is not None or spec.delay != 0

    def reset(self, env_ids: Array) -> None:
        """Draw the delay and the bias of new episodes; the scene must be looking at these rows."""
        size = self._size()
        if self._line is not None:
            delay = draw_rows(
                self._spec.delay, f"{self._name}/delay", self._streams, env_ids, source=f"{self._source}.delay"
            )
            self._line.reset(env_ids, delay.astype(np.int64))
        bias = self._spec.bias
        if self._bias is not None and bias is not None:
            name, once = f"{self._name}/bias", np.zeros(len(env_ids), dtype=np.int64)
            rows = noise_rows(bias, name, self._streams, env_ids, once, size)
            self._bias[env_ids] = rows
            if is_random(bias):
                for env, row in zip(env_ids.tolist(), rows.tolist(), strict=True):
                    self._streams.note(env, name, tuple(row), Origin(name, f"{self._source}.bias"))
        note_noise(self._spec.noise, f"{self._name}/noise", self._streams, env_ids, f"{self._source}.noise")

    def _size(self) -> int:
        """Make room at first use: only then it is known how many numbers the term has."""
        size, n = self._term().shape[1], len(self._scene.elapsed)
        if self._longest and self._line is None:
            self._line = DelayLine(n, size, self._longest)
        if self._spec.bias is not None and self._bias is None:
            self._bias = np.zeros((n, size))
        return size

    def __call__(self) -> Array:
        """Rows (n, D) for the envs at hand."""
        rows = np.asarray(self._term(), dtype=np.float64)
        ids, ticks = self._scene.env_ids, self._scene.elapsed[self._scene.rows]
        if self._line is not None:
            self._line.write(ids, ticks, rows)
            rows = self._line.read(ids, ticks)
        if self._bias is not None:
            rows = rows + self._bias[ids]
        if self._spec.noise is not None:
            rows = rows + noise_rows(self._spec.noise, f"{self._name}/noise", self._streams, ids, ticks, rows.shape[1])
        return rows

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        """Copies of what was seen in the last steps, and of what was drawn for the episode."""
        self._size()
        data: dict[str, Array] = {}
        if self._line is not None:
            data |= {"delay": self._line.delay[env_ids], "rows": self._line.rows[env_ids]}
        if self._bias is not None:
            data["bias"] = self._bias[env_ids]
        return {f"{self._name}.{key}": value for key, value in data.items()}

    def refuse_rows(self, data: Mapping[str, Array]) -> None:
        """Raise SnapshotError for a delay that the line has not."""
        if self._line is not None:
            refuse_range(f"{self._name}.delay", data[f"{self._name}.delay"], 0, self._line.rows.shape[1] - 1)

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        """Write what `snapshot` returned; the scene must be looking at these rows."""
        self._size()
        if self._line is not None:
            self._line.delay[env_ids] = data[f"{self._name}.delay"]
            self._line.rows[env_ids] = data[f"{self._name}.rows"]
        if self._bias is not None:
            self._bias[env_ids] = data[f"{self._name}.bias"]

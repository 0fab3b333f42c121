"""Imperfect observations: a term as a policy gets it, late, biased and noisy, as its spec says."""

from collections.abc import Callable, Mapping

import numpy as np

from anysim.conventions import Array
from anysim.engine.snapshots.row_checks import refuse_range
from anysim.randomization.draw import DelayLine, FieldNoise, draw_rows, longest_delay
from anysim.randomization.streams import Streams
from anysim.task.scene import SceneView
from anysim_schemas.sensors import SensorNoiseSpec
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
        self._noise: FieldNoise | None = None

    @staticmethod
    def alters(spec: ObservationTermSpec) -> bool:
        """Whether a term is anything but the truth of this moment."""
        return spec.noise is not None or spec.bias is not None or spec.delay != 0

    def reset(self, env_ids: Array) -> None:
        """Draw the delay and the bias of new episodes; the scene must be looking at these rows."""
        noise = self._room()
        if self._line is not None:
            delay = draw_rows(
                self._spec.delay, f"{self._name}/delay", self._streams, env_ids, source=f"{self._source}.delay"
            )
            self._line.reset(env_ids, delay.astype(np.int64))
        noise.reset(env_ids)

    def _room(self) -> FieldNoise:
        """Make room at first use: only then it is known how many numbers the term has."""
        if self._noise is None:
            size, spec = self._term().shape[1], SensorNoiseSpec(noise=self._spec.noise, bias=self._spec.bias)
            self._noise = FieldNoise(spec, self._name, self._source, self._streams, size, 1.0)
            if self._longest:
                self._line = DelayLine(len(self._scene.elapsed), size, self._longest)
        return self._noise

    def __call__(self) -> Array:
        """Rows (n, D) for the envs at hand."""
        rows = np.asarray(self._term(), dtype=np.float64)
        ids, ticks = self._scene.env_ids, self._scene.elapsed[self._scene.rows]
        if self._line is not None:
            self._line.write(ids, ticks, rows)
            rows = self._line.read(ids, ticks)
        return rows if self._noise is None else self._noise.added(rows, ids, ticks)

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        """Copies of what was seen in the last steps, and of what was drawn for the episode."""
        noise, data = self._room(), dict[str, Array]()
        if self._line is not None:
            data |= {"delay": self._line.delay[env_ids], "rows": self._line.rows[env_ids]}
        if self._spec.bias is not None:
            data["bias"] = noise.bias[env_ids]
        return {f"{self._name}.{key}": value for key, value in data.items()}

    def refuse_rows(self, data: Mapping[str, Array]) -> None:
        """Raise SnapshotError for a delay that the line has not."""
        if self._line is not None:
            refuse_range(f"{self._name}.delay", data[f"{self._name}.delay"], 0, self._line.rows.shape[1] - 1)

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        """Write what `snapshot` returned; the scene must be looking at these rows."""
        noise = self._room()
        if self._line is not None:
            self._line.delay[env_ids] = data[f"{self._name}.delay"]
            self._line.rows[env_ids] = data[f"{self._name}.rows"]
        if self._spec.bias is not None:
            noise.bias[env_ids] = data[f"{self._name}.bias"]

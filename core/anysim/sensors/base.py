"""The contract of a sensor: fields with units, one reading of many envs at a time, and what it remembers of the last.

When it is read, how late and noisy its readings are and which are lost is in the file: `anysim.managers.sensors`.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.capability import Capability


class SensorField(NamedTuple):
    """One field of a sensor.

    Attributes:
        shape: of one env's.
        unit: `m/s^2`; `xyzw` is that of quaternions (4,), whose noise is a rotation.
        axes: those that vectors are in, as `world` or the name of a frame.
        dtype: of what users get; readings are kept as float64.
    """

    shape: tuple[int, ...]
    unit: str
    axes: str = ""
    dtype: Literal["float64", "float32", "int32", "int8", "uint8", "bool"] = "float64"


class Sensor(ABC):
    """Made as `(scene, *, parameters)`; keyword-only arguments are the parameters in YAML, as those of a term.

    Attributes:
        needs: capabilities of the engine without which it reads nothing.
        fields: what a reading holds, by name.
        period: time between two readings [s], a whole number of control steps; known when it is first read.
        memory: what it keeps between readings, (N, …) by name: part of snapshots, and zero when an episode begins.
    """

    needs: ClassVar[tuple[Capability, ...]] = ()
    fields: Mapping[str, SensorField]
    period: float

    def __init__(self, num_envs: int) -> None:
        self._num_envs = num_envs
        self.memory: dict[str, Array] = {}

    def remember(self, name: str, *shape: int) -> Array:
        """A new array (N, *shape) of the memory, float64; write into it, do not replace it."""
        self.memory[name] = np.zeros((self._num_envs, *shape))
        return self.memory[name]

    @property
    def age(self) -> float:
        """How long before a reading that is of which it tells [s]: half a period where it tells of an average."""
        return 0.0

    def reset(self, env_ids: Array) -> None:
        """Episodes begin in these envs, which the scene looks at; their first reading follows at once."""

    @abstractmethod
    def read(self, env_ids: Array) -> Mapping[str, Array]:
        """The truth, (n, *shape) of each field, in these envs (n,), which the scene looks at."""

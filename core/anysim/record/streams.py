"""Streams: what a trajectory holds beside its numbers and videos, row by row; plugins of the kind `streams` make them.

A source makes the streams of a run. It is asked for those of an episode that is kept, before its env is reset, on the
thread that steps. What costs and needs no engine it hands over as parts, which the recorder's thread calls in order.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack
from typing import Any, NamedTuple

from anysim import registry
from anysim.plugin_parameters import checked, options_model, parameters
from anysim.record.columns import EpisodeColumns
from anysim.record.header import StreamInfo
from anysim.task.env import TaskEnv


class StreamRow(NamedTuple):
    """What a stream says at a control step: an array, text or plain data. The recorder fills in `time` [s]."""

    stream: str
    step: int
    value: Any
    time: float = 0.0


class StreamPart(NamedTuple):
    """Rows to come: `make` is called on the recorder's thread; `nbytes` of memory are held until then."""

    make: Callable[[], Iterable[StreamRow]]
    nbytes: int = 0


class StreamSource(ABC):
    """Made once for a run as `(env, *, options)`; keyword-only arguments are its entry under `record.streams`.

    Equal episodes give equal rows: no wall clock, and no random numbers but those of the env's streams. `streams` is
    what it makes, by name: `FAMILY/NAME…`, where no other source has the family, and no array of every trajectory.
    """

    streams: Mapping[str, StreamInfo]

    def begin(self, index: int) -> None:
        """An episode begins in an env, which was just reset; called by the thread that steps."""

    @abstractmethod
    def parts(self, index: int, columns: EpisodeColumns, status: str) -> Iterator[StreamPart]:
        """The streams of an episode that came out as `status`, in the order of steps; its env was not reset since."""

    def close(self) -> None:
        """The run is over, and the recorder's thread has ended."""


def make_sources(env: TaskEnv) -> dict[str, StreamSource]:
    """The sources that an env's `record.channels` (the source `cameras`) and `record.streams` ask for, by name.

    Raises:
        PluginError: one is not installed.
        SpecError: at an option, what is wrong with it.
    """
    record, sources = env.spec.record, dict[str, StreamSource]()
    with ExitStack() as undo:
        undo.callback(close_sources, sources)
        for name, given in ((record.streams or {}) | ({"cameras": {}} if record.channels else {})).items():
            made: Any = registry.load("streams", name)
            values = checked(options_model(made), given or {}, f"record.streams.{name}")
            with registry.using("streams", name):
                sources[name] = made(env, **{key: getattr(values, key) for key in parameters(made)})
        undo.pop_all()
    return sources


def close_sources(sources: Mapping[str, StreamSource]) -> None:
    """Close every one of them, also where another cannot be closed."""

    def close(name: str, source: StreamSource) -> None:
        with blame(name, source):
            source.close()

    with ExitStack() as stack:
        for name, source in sources.items():
            stack.callback(close, name, source)


def blame(name: str, source: StreamSource) -> registry.Blame:
    """Call the code of a source within it."""
    return registry.Blame(f"the streams '{name}'", registry.origin(source))

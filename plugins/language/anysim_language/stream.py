"""Language as streams of trajectories: the scene, the instruction and the narration of each episode that is kept.

All of it is worked out on the recorder's thread, from the recorded states and the episode's seed, as `anysim describe`
does of a committed trajectory.
"""

from collections.abc import Iterator

from anysim.api import blind_env, load
from anysim.record.columns import EpisodeColumns
from anysim.record.header import StreamInfo
from anysim.record.streams import StreamPart, StreamRow, StreamSource
from anysim.task.env import TaskEnv
from anysim_language.episode import ended
from anysim_language.instruction import instruction_text
from anysim_language.narration import narration
from anysim_language.scene_text import scene_text


class LanguageStream(StreamSource):
    """`language/scene` and `…/instruction` at the reset, `…/narration` with its `…/facts` at change points."""

    def __init__(self, env: TaskEnv, *, phrasing: int = 0) -> None:
        """`phrasing` chooses among wordings."""
        self._loaded = load(env.spec.to_dict() | {"num_envs": 1})
        self._blind = blind_env(self._loaded, env.engine.world, env.name)
        self._phrasing = phrasing
        self.streams = {
            "language/scene": StreamInfo(kind="text", words="L1: what there is"),
            "language/instruction": StreamInfo(kind="text", words="L2: what is to be done"),
            "language/narration": StreamInfo(kind="text", words="L3: what begins at a step"),
            "language/facts": StreamInfo(kind="data", words="what each sentence of the narration is made of"),
        }

    def parts(self, index: int, columns: EpisodeColumns, status: str) -> Iterator[StreamPart]:
        del index
        yield StreamPart(lambda: self._rows(columns, status))

    def _rows(self, columns: EpisodeColumns, status: str) -> Iterator[StreamRow]:
        episode, phrasing = ended(self._blind, self._loaded, columns, status), self._phrasing
        yield StreamRow("language/scene", 0, scene_text(episode, phrasing))
        yield StreamRow("language/instruction", 0, instruction_text(episode, phrasing))
        for sentence in narration(episode, phrasing):
            facts = sentence._asdict()
            step = facts.pop("step")
            yield StreamRow("language/narration", step, facts.pop("text"))
            yield StreamRow("language/facts", step, facts)

    def close(self) -> None:
        self._blind.close()

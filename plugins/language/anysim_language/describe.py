"""Descriptions: the three levels of language of a task's episode or of a recorded one, together."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from anysim_language.episode import Episode, begun, recorded
from anysim_language.instruction import instruction_text
from anysim_language.narration import Sentence, narration
from anysim_language.scene_text import scene_text


class Description(NamedTuple):
    """What there is (L1), what is to be done (L2), and what happened (L3), in words.

    Attributes:
        source: the task's name, or the trajectory's directory.
        episode_seed: the seed of the episode.
        vocabularies: what the words come from, as `distribution:name`.
        scene, instruction: texts.
        narration: what happened, sentence by sentence; empty for what has only begun.
    """

    source: str
    episode_seed: int
    vocabularies: tuple[str, ...]
    scene: str
    instruction: str
    narration: tuple[Sentence, ...]

    def as_data(self) -> dict[str, Any]:
        """Plain data."""
        return self._asdict() | {
            "vocabularies": list(self.vocabularies),
            "narration": [one._asdict() for one in self.narration],
        }


def described_task(
    task: str | Path, seed: int | None = None, phrasing: int = 0, overrides: Sequence[str] = ()
) -> Description:
    """The first episode of a task under a global seed, by default the file's; `phrasing` chooses among wordings."""
    return describe(str(task), begun(task, seed, overrides), phrasing)


def described_trajectory(trajectory: Path, phrasing: int = 0, base: Path | None = None) -> Description:
    """A recorded episode."""
    return describe(str(trajectory), recorded(trajectory, base), phrasing)


def describe(source: str, episode: Episode, phrasing: int = 0) -> Description:
    """An episode."""
    return Description(
        source,
        episode.seed,
        episode.vocabulary.sources,
        scene_text(episode, phrasing),
        instruction_text(episode, phrasing),
        tuple(narration(episode, phrasing)) if episode.reader is not None else (),
    )

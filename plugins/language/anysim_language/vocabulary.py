"""Vocabularies: words for things, deeds and events as data, each an entry point `anysim.vocabularies` with a file."""

from collections.abc import Mapping
from functools import cache
from importlib import util
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from pydantic import Field

from anysim import registry
from anysim.errors import PluginError
from anysim_schemas.base import Flag, Spec
from anysim_schemas.load import load

OURS = "english"
"""The vocabulary that comes with anysim; what others say of the same key wins over it."""

Word = Annotated[str, Field(min_length=1, max_length=200, pattern=r"^[^\n]*\S$")]
Phrasings = tuple[str, ...]
"""Templates that mean the same; a seed chooses among them."""


class ThingWords(Spec):
    """Words for a kind of thing."""

    noun: Word = Field(description="in the singular, without an article: `mug`")
    plural: Word | None = Field(default=None, description="the noun with an s where not given")
    about: str = Field(default="", description="one clause about what can be done with it")
    parts: dict[str, Word] = Field(default_factory=dict, description="its links, joints and affordances by local name")
    colour: Word | None = Field(default=None, description="where its looks tell none, as a texture does")
    material: Word | None = Field(default=None, description="an adjective, where the world tells no material")
    container: Flag = Field(default=False, description="whether things lie in it rather than on it")

    @property
    def several(self) -> str:
        """The plural."""
        return self.plural or f"{self.noun}s"


class SkillWords(Spec):
    """Words for a skill: clauses with the skill's parameters filled in."""

    do: Phrasings = Field(min_length=1, description="as an instruction: `put {{ the(object) }} {{ onto(target) }}`")
    doing: Phrasings = Field(min_length=1, description="of the robot that does it: `puts {{ the(object) }} …`")
    actors: dict[str, Word] = Field(
        default_factory=dict, description="the parameter that names who acts, by the part of the skill; else `robot`"
    )
    minor: Flag = Field(default=False, description="left out of an instruction that has other commands")


class VocabularySpec(Spec):
    """The content of a vocabulary's file; every section may be left out."""

    things: dict[str, ThingWords] = Field(
        default_factory=dict, description="by label, or `procedural:NAME`, or a shape such as `shape:cube`"
    )
    robots: dict[str, ThingWords] = Field(default_factory=dict, description="by name in the catalogue")
    materials: dict[str, Word] = Field(default_factory=dict, description="adjectives by material")
    parts: dict[str, Word] = Field(default_factory=dict, description="parts by the end of their name, of any thing")
    skills: dict[str, SkillWords] = Field(default_factory=dict, description="by name of the skill")
    tasks: dict[str, Phrasings] = Field(
        default_factory=dict, description="instructions by name of the task, where its skills' words do not make one"
    )
    phases: dict[str, str] = Field(default_factory=dict, description="what a robot does in a phase, by its name")
    scene: dict[str, Phrasings] = Field(default_factory=dict, description="sentences about a scene")
    events: dict[str, Phrasings] = Field(default_factory=dict, description="sentences about what happens")
    questions: dict[str, Phrasings] = Field(default_factory=dict, description="questions by family")
    changes: dict[str, Phrasings] = Field(default_factory=dict, description="clauses about what may be done otherwise")
    outcomes: dict[str, Word] = Field(default_factory=dict, description="clauses about what would come of it")


class Vocabulary(NamedTuple):
    """All words at hand, and the vocabularies that they come from as `distribution:name`."""

    words: VocabularySpec
    sources: tuple[str, ...]


def vocabulary() -> Vocabulary:
    """The words of all installed vocabularies together: those of others win over ours.

    Raises:
        PluginError: one has no file, or two others say different things of one key (lists both).
        SpecError: a file is not a vocabulary, with its line.
    """
    return _merged(tuple(registry.names("vocabularies")))


@cache
def _merged(names: tuple[str, ...]) -> Vocabulary:
    words: dict[str, dict[str, Any]] = {section: {} for section in VocabularySpec.model_fields}
    said_by: dict[tuple[str, str], str] = {}
    for name in sorted(names, key=lambda one: (one != OURS, one)):
        spec = load(VocabularySpec, vocabulary_file(name)).spec
        for section, known in words.items():
            entries: Mapping[str, Any] = getattr(spec, section)
            for key, value in entries.items():
                before = said_by.get((section, key), OURS)
                if before != OURS and known[key] != value:
                    raise PluginError(
                        f"the vocabularies '{before}' and '{name}' have different words for {section}.{key}; uninstall "
                        f"{registry.distribution('vocabularies', before)} or "
                        f"{registry.distribution('vocabularies', name)}, or have one of them leave it out"
                    )
                known[key], said_by[section, key] = value, name
    return Vocabulary(
        VocabularySpec(**words), tuple(f"{registry.distribution('vocabularies', name)}:{name}" for name in names)
    )


def vocabulary_file(name: str) -> Path:
    """The file NAME.yaml of the package that the entry point names. The package is found, not imported.

    Raises:
        PluginError: unknown (lists what is installed), or the package has no such file.
    """
    entry = registry.entry("vocabularies", name)
    with registry.using("vocabularies", name):
        spec = util.find_spec(entry.value)
    for folder in (spec.submodule_search_locations or []) if spec is not None else []:
        file = Path(folder) / f"{entry.name}.yaml"
        if file.is_file():
            return file
    raise PluginError(
        f"the vocabulary '{name}' should be in {entry.name}.yaml of the package {entry.value}, which has no such file"
    )

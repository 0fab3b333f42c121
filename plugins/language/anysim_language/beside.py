"""Words beside assets: `words.yaml` in the folder of an asset's file, of its builder or of its catalogue entry.

It is a vocabulary whose `things` go by the name of the builder or, without its ending, of the file, and whose `robots`
go by the name in the catalogue. Installed vocabularies win over it.
"""

from functools import cache
from importlib import util
from pathlib import Path

from anysim import registry
from anysim.assets.catalogue import load_robot
from anysim.assets.load import split_body
from anysim.assets.uri import locate
from anysim.errors import AssetError, PluginError
from anysim_language.vocabulary import ThingWords, VocabularySpec
from anysim_schemas.load import load
from anysim_schemas.object_source import PROCEDURAL

WORDS_FILE = "words.yaml"


def thing_words(source: str, base: Path | None) -> ThingWords | None:
    """The words beside the asset of a source; None where there are none.

    Args:
        source: of an entity: `procedural:NAME`, a URI of a file, or nothing.
        base: the folder that a relative path is relative to.

    Raises:
        SpecError: the file is no vocabulary, with its line.
    """
    if not source or source.startswith("room:"):
        return None
    if source.startswith(PROCEDURAL):
        name = source.removeprefix(PROCEDURAL)
        spec = util.find_spec(registry.entry("assets", name).value.partition(":")[0])
        folder = Path(spec.origin).parent if spec is not None and spec.origin else None
        return _vocabulary(folder).things.get(name.rpartition(":")[2])
    try:
        file = locate(split_body(source)[0], base=base).path
    except AssetError:  # a recording's, of which the folder of its file is not told
        return None
    return _vocabulary(file.parent).things.get(file.name.partition(".")[0])


def robot_words(model: str) -> ThingWords | None:
    """The words beside a catalogue entry, by its name; None where there are none."""
    try:
        folder = load_robot(model).file.parent
    except PluginError:  # a robot that is no entry of the catalogue
        return None
    return _vocabulary(folder).robots.get(Path(model.rpartition(":")[2]).stem)


@cache
def _vocabulary(folder: Path | None) -> VocabularySpec:
    file = folder / WORDS_FILE if folder is not None else None
    return load(VocabularySpec, file).spec if file is not None and file.is_file() else VocabularySpec()

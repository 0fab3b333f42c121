"""Places for the sensors that a source declares, as lines of a catalogue entry."""

import json
import re

from anysim.assets.model import ImportedModel
from anysim.assets.scene import free_name


def places(model: ImportedModel) -> list[str]:
    """The key `sensors` of a draft; no lines where the source has none. Names are such as no frame has."""
    lines, taken = [], {"tool", *model.frames}
    for hint in model.sensors:
        name = free_name(hint.name, hint.kind, ())
        name = name if name not in taken else free_name(f"{name}_sensor", hint.kind, taken)
        taken.add(name)
        params = f", params: {json.dumps(dict(hint.params))}" if hint.params else ""
        told = f"  # {', '.join(hint.sources)} of the file"
        lines.append(f"  {name}: {{kind: {hint.kind}, link: {quoted(hint.frame)}{params}}}{told}")
    return ["sensors:", *lines] if lines else []


def quoted(word: str) -> str:
    """A YAML scalar."""
    return word if re.fullmatch(r"[A-Za-z_/.][\w./-]*", word) and word.lower() not in _WORDS else f'"{word}"'


_WORDS = frozenset({"true", "false", "yes", "no", "on", "off", "null", "y", "n", "."})

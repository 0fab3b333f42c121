"""YAML documents made from the schema of a run, whole or hostile: a stream of them follows from a seed."""

import copy
import json
import math
import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import yaml

from anysim_schemas.jsonschema import json_schema
from anysim_schemas.run import RunSpec
from tests.task.helpers import BLOCKS

T = TypeVar("T")

HERE = Path(__file__).parent
DEEP = 20
"""Levels below which only the first of alternatives is taken: commands may hold commands without end."""
PARTS: dict[str, Any] = yaml.safe_load((HERE / "parts.yaml").read_text())
NAMES, TEXTS = PARTS["names"], [text for row in PARTS["texts"] for text in row]
HOSTILE: list[Any] = [value for row in PARTS["hostile"] for value in row]
HOSTILE += [*(2**power for power in (31, 63, 64, 70)), 10**250, "\ud800", "a" * 300, "b" * 5_000]
"""What is put where something else was."""
WHOLE = [BLOCKS, *PARTS["whole"]]
"""Documents without a fault, which reach what comes after the schema."""


@cache
def schema() -> dict[str, Any]:
    """The JSON Schema of a run."""
    return json_schema(RunSpec)


class Dice:
    """Draws of Python values from a numpy generator."""

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng(seed)

    def random(self) -> float:
        """Uniform in [0, 1)."""
        return float(self._rng.random())

    def choice(self, items: Sequence[T]) -> T:
        """One of several."""
        return items[int(self._rng.integers(len(items)))]

    def randint(self, low: int, high: int) -> int:
        """A whole number, both bounds included."""
        return int(self._rng.integers(low, high, endpoint=True))

    def uniform(self, low: float, high: float) -> float:
        """Uniform between two bounds."""
        return float(self._rng.uniform(low, high))


class Documents:
    """Draws documents, one after the other."""

    def __init__(self, seed: int) -> None:
        self.rng = Dice(seed)

    def text(self) -> tuple[str, str]:
        """A document, and how it was made."""
        rng = self.rng
        if rng.random() < 0.55:
            data, how = copy.deepcopy(rng.choice(WHOLE)), "whole"
        else:
            data, how = self.value({"$ref": "#"}, 0), "schema"
            data = data if isinstance(data, dict) else {}
            data["engine"] = "null" if rng.random() < 0.9 else data.get("engine")
        for _ in range(rng.choice((0, 1, 1, 1, 2, 3))):
            how += f" {self.mutate(data)}"
        text = written(data).lstrip("\n") + "\n"
        if rng.random() < 0.2:
            text, what = self.scratched(text)
            how += f" {what}"
        return text, how

    # ------------------------------------------------------------------ from the schema

    def value(self, node: dict[str, Any], depth: int) -> Any:
        """What a part of the schema allows, often."""
        rng = self.rng
        if "$ref" in node:
            name = node["$ref"].rpartition("/")[2]
            node = schema() if node["$ref"] == "#" else schema()["$defs"][name]
        for key in ("anyOf", "oneOf"):
            if key in node:
                return self.value(node[key][0] if depth > DEEP else rng.choice(node[key]), depth)
        if "enum" in node:
            return rng.choice(node["enum"])
        if "const" in node:
            return node["const"]
        kind = node.get("type", "object")
        kind = rng.choice(kind) if isinstance(kind, list) else kind
        made = {"object": self._mapping, "array": self._list, "number": self._number, "integer": self._whole}
        if kind in made:
            return made[kind](node, depth)
        if kind == "boolean":
            return rng.random() < 0.5
        return None if kind == "null" else rng.choice(TEXTS)

    def _mapping(self, node: dict[str, Any], depth: int) -> Any:
        rng, found = self.rng, {}
        share = 0.5 if depth < 2 else 0.2 if depth < 6 else 0.0
        for key, part in node.get("properties", {}).items():
            if key in node.get("required", ()) or rng.random() < share:
                found[key] = self.value(part, depth + 1)
        others = node.get("additionalProperties") or next(iter(node.get("patternProperties", {}).values()), None)
        if isinstance(others, dict):
            found |= {rng.choice(NAMES): self.value(others, depth + 1) for _ in range(rng.randint(0, 2))}
        return found

    def _list(self, node: dict[str, Any], depth: int) -> Any:
        first = node.get("prefixItems", [])
        count = len(first) or self.rng.randint(node.get("minItems", 0), 3)
        return [self.value(first[i] if i < len(first) else node.get("items", {}), depth + 1) for i in range(count)]

    def _number(self, node: dict[str, Any], _depth: int) -> float:
        low = node.get("minimum", node.get("exclusiveMinimum", -1.0))
        high = min(node.get("maximum", node.get("exclusiveMaximum", low + 2.0)), low + 2.0)
        return round(self.rng.uniform(low, high), 3)

    def _whole(self, node: dict[str, Any], _depth: int) -> int:
        low = node.get("minimum", node.get("exclusiveMinimum", -1))
        return self.rng.randint(low, min(node.get("maximum", low + 3), low + 3))

    # ------------------------------------------------------------------ what is wrong

    def mutate(self, data: Any) -> str:
        """Change one place; says which and how."""
        rng, path, holder = self.rng, [], data
        while True:
            keys = list(holder) if isinstance(holder, dict) else list(range(len(holder)))
            if not keys:
                return "nowhere"
            key: Any = rng.choice(keys)
            path.append(str(key))
            child = holder[key]
            if not isinstance(child, dict | list) or not child or rng.random() < 0.15:
                break
            holder = child
        how = rng.choice(("value", "value", "value", "value", "drop", "misspell", "copy", "deep", "swap", "extra"))
        if how == "value":
            holder[key] = copy.deepcopy(rng.choice(HOSTILE))
            how = f"value={str(holder[key])[:30]!r}"
        elif how == "drop":
            del holder[key]
        elif how == "misspell" and isinstance(holder, dict) and isinstance(key, str):
            holder[rng.choice((key + "s", key[:-1], key.upper(), "a.b", "", "x\0", "0", "é", "k" * 400))] = child
        elif how == "copy" and isinstance(holder, dict):
            holder[rng.choice(NAMES)] = copy.deepcopy(child)
        elif how == "deep":
            for _ in range(rng.choice((5, 90, 105, 120))):
                child = [child] if rng.random() < 0.5 else {"a": child}
            holder[key] = child
        elif how == "swap":
            other = rng.choice(keys)
            holder[key], holder[other] = holder[other], holder[key]
        elif how == "extra" and isinstance(holder, dict):
            holder[rng.choice((*NAMES, *schema()["properties"]))] = copy.deepcopy(rng.choice(HOSTILE))
        return f"{'.'.join(path)[:60]}:{how}"

    def scratched(self, text: str) -> tuple[str, str]:
        """The text with one thing changed that no data has."""
        rng = self.rng
        lines = text.splitlines() or [""]
        at = rng.randint(0, len(lines) - 1)
        place = rng.randint(0, len(text))
        how = rng.choice(("cut", "twice", "byte", "tab", "anchor", "self", "merge", "bomb", "tag", "extends", "second"))
        if how == "cut":
            text = text[:place]
        elif how == "twice":
            lines.insert(at, lines[at])
            text = "\n".join(lines)
        elif how == "byte":
            text = text[:place] + rng.choice("\0\x07\x85\u2028\ufeff\ufffe:{}[]&*!|>'\"%@`#-?,") + text[place:]
        elif how == "tab":
            text = text.replace("  ", "\t", 1)
        elif how == "tag":
            tags = ("!!python/object:os.system", "!!binary", "!!set", "!x", "!!int", "!!null", "!!timestamp")
            text = re.sub(r": ([^\n]+)", f": {rng.choice(tags)} \\1", text, count=1)
        elif how == "second":
            text += "\n---\n" + text
        else:
            first = f"_0: &x0 [{', '.join('x' * 9)}]"
            bomb = "\n".join([first, *(f"_{i}: &x{i} [{', '.join([f'*x{i - 1}'] * 9)}]" for i in range(1, 9))])
            extra = bomb if how == "bomb" else rng.choice(PARTS["heads"][how])
            text = extra + ("\n" if not extra.endswith("\n") else "") + text
        return text, how


def written(data: Any, indent: str = "") -> str:
    """Data as YAML in blocks, below `indent`; starts on the line of its key where it is no block."""
    if isinstance(data, dict) and data:
        return "".join(f"\n{indent}{_key(key)}:{written(child, indent + ' ')}" for key, child in data.items())
    if isinstance(data, list) and any(isinstance(item, dict | list) and item for item in data):
        return "".join(f"\n{indent}-{written(item, indent + ' ')}" for item in data)
    if isinstance(data, list):
        return f" [{', '.join(map(_scalar, data))}]"
    return f" {_scalar(data)}"


def _key(key: str) -> str:
    return key if key.isidentifier() and key.isascii() else json.dumps(key)


def _scalar(value: Any) -> str:
    if isinstance(value, float) and not math.isfinite(value):
        return ".nan" if math.isnan(value) else ".inf" if value > 0 else "-.inf"
    return json.dumps(value)

"""JSON Schemas of the files that people write, so that editors complete and check them.

`python -m anysim_schemas.jsonschema [--check] DIR` writes `run.schema.json`, `robot.schema.json`,
`proposal.schema.json` and `benchmark.schema.json`.

A schema sees one file, and a file may be only a part: it may extend another, be extended, or be given with others. So
where files are merged nothing is required, and null (which removes what is inherited) is allowed everywhere. Items of
lists are never merged: there a schema asks for all that the spec asks for.
"""

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema
from pydantic_core import core_schema

from anysim_schemas.base import Spec
from anysim_schemas.benchmark import BenchmarkSpec
from anysim_schemas.proposals import Proposals
from anysim_schemas.robot_model import RobotModelSpec
from anysim_schemas.run import RunSpec

SCHEMAS: Mapping[str, type[BaseModel]] = {
    "run.schema.json": RunSpec,
    "robot.schema.json": RobotModelSpec,
    "proposal.schema.json": Proposals,
    "benchmark.schema.json": BenchmarkSpec,
}
"""The files that are generated, and the roots they describe."""

DIALECT = "https://json-schema.org/draft/2020-12/schema"
EXTENDS: dict[str, Any] = {
    "description": "the file that this one changes, relative to this one, or `scheme:name`; or a list of them",
    "anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}, {"type": "null"}],
}

_REF = "#/$defs/"
_Schema = dict[str, Any]


class _Generator(GenerateJsonSchema):
    """Leaves out the titles that only repeat the key, and adds the strings that are short for a mapping."""

    def model_schema(self, schema: core_schema.ModelSchema) -> _Schema:
        mapping, model = super().model_schema(schema), schema["cls"]
        if not issubclass(model, Spec) or model.from_text("name") is None:
            return mapping
        text = {"type": "string", "description": f"short for the mapping: {model.text_means()}"}
        return {"anyOf": [text, mapping]}

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False


def json_schema(model: type[BaseModel]) -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of the files whose root is `model`."""
    schema = model.model_json_schema(schema_generator=_Generator)
    schema = cast("_Schema", _renamed(schema, _short_names(cast("_Schema", schema.get("$defs", {})))))
    _close_patterns(schema)
    _open_to_merging(schema, cast("dict[str, _Schema]", schema.get("$defs", {})), set())
    schema["properties"] = {"extends": EXTENDS, **schema["properties"]}
    schema["patternProperties"] = {"^_": {"description": "private: a place for anchors, dropped when the file is read"}}
    return {"$schema": DIALECT, **schema}


def render(model: type[BaseModel]) -> str:
    """The text of the generated file."""
    return json.dumps(json_schema(model), indent=1, ensure_ascii=False) + "\n"


def _short_names(definitions: Mapping[str, _Schema]) -> dict[str, str]:
    """Definitions by the names of their classes; pydantic spells out the arguments of generic ones."""
    return {name: str(_titled(schema).get("title", name)) for name, schema in definitions.items()}


def _titled(schema: _Schema) -> _Schema:
    return next((branch for branch in schema.get("anyOf", ()) if "title" in branch), schema)


def _renamed(value: object, names: Mapping[str, str]) -> object:
    """The schema with other names for its definitions."""
    if isinstance(value, list):
        return [_renamed(item, names) for item in cast("list[object]", value)]
    if isinstance(value, float) and value.is_integer():
        return int(value)  # pydantic's versions differ in how they write a limit of zero
    if not isinstance(value, dict):
        return value
    renamed: _Schema = {}
    for key, child in cast("_Schema", value).items():
        if key == "$ref":
            renamed[key] = _REF + names[str(child).removeprefix(_REF)]
        elif key == "$defs":
            renamed[key] = {names[name]: _renamed(schema, names) for name, schema in child.items()}
        else:
            renamed[key] = _renamed(child, names)
    return renamed


def _close_patterns(value: object) -> None:
    """A mapping whose keys follow a pattern has no other keys."""
    if isinstance(value, list):
        for item in cast("list[object]", value):
            _close_patterns(item)
    elif isinstance(value, dict):
        schema = cast("_Schema", value)
        if "patternProperties" in schema:
            schema.setdefault("additionalProperties", False)
        for child in schema.values():
            _close_patterns(child)


def _open_to_merging(schema: _Schema, definitions: Mapping[str, _Schema], seen: set[str]) -> None:
    """Nothing is required and null is allowed in every mapping that is reached without going through a list."""
    if "$ref" in schema:
        name = str(schema["$ref"]).removeprefix(_REF)
        if name not in seen:
            seen.add(name)
            _open_to_merging(definitions[name], definitions, seen)
    if "oneOf" in schema:  # a part of a value may fit several of its forms
        schema.pop("discriminator", None)
        schema["anyOf"] = schema.pop("oneOf")
    for branch in schema.get("anyOf", ()):
        _open_to_merging(branch, definitions, seen)
    schema.pop("required", None)
    for group in ("properties", "patternProperties"):
        for key, child in schema.get(group, {}).items():
            _open_to_merging(child, definitions, seen)
            schema[group][key] = _or_null(child)
    if isinstance(schema.get("additionalProperties"), dict):
        _open_to_merging(schema["additionalProperties"], definitions, seen)
        schema["additionalProperties"] = _or_null(schema["additionalProperties"])


def _or_null(schema: _Schema) -> _Schema:
    """The schema, or null."""
    null: _Schema = {"type": "null"}
    if "anyOf" in schema:
        return schema if null in schema["anyOf"] else {**schema, "anyOf": [*schema["anyOf"], null]}
    if "$ref" in schema:
        rest = {key: value for key, value in schema.items() if key != "$ref"}
        return {"anyOf": [{"$ref": schema["$ref"]}, null], **rest}
    if "enum" in schema or "const" in schema:
        choices = [*schema.get("enum", [schema.get("const")]), None]
        rest = {key: value for key, value in schema.items() if key not in ("type", "const")}
        return {**rest, "enum": choices}
    return {**schema, "type": [schema["type"], "null"]} if isinstance(schema.get("type"), str) else schema


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the schemas, or with `--check` say which differ from what is written; the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m anysim_schemas.jsonschema", description="Generate the JSON Schemas."
    )
    parser.add_argument("directory", type=Path, metavar="DIR", help="where the schemas are kept")
    parser.add_argument("--check", action="store_true", help="write nothing; name the files that differ")
    options = parser.parse_args(arguments)
    folder: Path = options.directory
    drifted = False
    for name, model in SCHEMAS.items():
        path, text = folder / name, render(model)
        if not options.check:
            folder.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        elif not path.is_file() or path.read_text(encoding="utf-8") != text:
            drifted = True
            sys.stderr.write(f"{path} differs from the specs; run python -m anysim_schemas.jsonschema {folder}\n")
    return int(drifted)


if __name__ == "__main__":
    raise SystemExit(main())

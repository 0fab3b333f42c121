"""The generated JSON Schemas: up to date, and of one mind with the loader."""

import json
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from anysim_schemas.jsonschema import SCHEMAS, json_schema, main
from anysim_schemas.load import load, load_run
from anysim_schemas.robot_model import RobotModelSpec
from anysim_schemas.run import RunSpec
from anysim_schemas.yaml import parse

HERE = Path(__file__).parent
WRITTEN = HERE.parents[1] / "schemas" / "json"
VALIDATORS = {model: Draft202012Validator(json_schema(model)) for model in SCHEMAS.values()}


def plain(text):
    node = parse(text, "f.yaml", [])
    return None if node is None else node.plain()


def root_of(text):
    return RobotModelSpec if text.startswith("# robot") else RunSpec


def complaints(text):
    return list(VALIDATORS[root_of(text)].iter_errors(plain(text)))


def test_the_written_schemas_are_up_to_date(capsys):
    assert main(["--check", str(WRITTEN)]) == 0, capsys.readouterr().err


def test_drift_is_noticed(tmp_path, capsys):
    assert main([str(tmp_path)]) == 0
    assert main(["--check", str(tmp_path)]) == 0
    (tmp_path / "run.schema.json").write_text("{}")
    (tmp_path / "robot.schema.json").unlink()
    capsys.readouterr()
    assert main(["--check", str(tmp_path)]) == 1
    said = capsys.readouterr().err
    assert "run.schema.json differs" in said
    assert "robot.schema.json differs" in said


@pytest.mark.parametrize("name", SCHEMAS)
def test_the_schemas_are_schemas(name):
    schema = json.loads((WRITTEN / name).read_text(encoding="utf-8"))
    Draft202012Validator.check_schema(schema)
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert all(len(definition) < 40 for definition in schema["$defs"])


@pytest.mark.parametrize("path", sorted((HERE / "good").glob("*.yaml")), ids=lambda path: path.stem)
def test_what_loads_is_valid(path):
    text = path.read_text(encoding="utf-8")
    load(root_of(text), path)
    assert complaints(text) == []


SHORT = """
extends: [a.yaml, scheme:b]
_private: {anything: [1]}
engine: mujoco
world:
  terrain: none
  robots: {r: {robot: x, home: {j: 1}, actions: {arm: pd, eef: {controller: grip, params: {x: 1}}}}}
  objects:
    a: {source: package:a.urdf}
    b: {source: {box: [1, 1, 1]}, mass: {choice: [1, 2]}, color: {range: [[0, 0, 0], [1, 1, 1]]}}
    c:
  cameras: {c: {from: [1, 1, 1], look_at: [0, 0, 0]}}
task:
  observations: {policy: [q, {term: dq, scale: 2}]}
  success: {near: , far: {x: 1}, other: somewhere}
record: null
"""


def test_shorthands_are_valid():
    assert complaints(SHORT) == []
    data = {key: value for key, value in plain(SHORT).items() if key not in ("extends", "_private")}
    data["world"]["objects"].pop("c")
    data.pop("record")
    assert load_run(data).spec.engine.name == "mujoco"


@pytest.mark.parametrize(
    "text",
    [
        *("sede: 1", "seed: one", "seed: -1", "num_envs: 0", "num_envs: true", "engine: 3", "engine: {nam: x}"),
        *("physics: {dt: 0}", "physics: {gravity: [0, 0]}", "physics: {friction_cone: round}", "[]", "world: []"),
        *("world: {terrain: {kind: moon}}", "world: {objects: {'a b': {}}}", "world: {cameras: {c: {fov: 400}}}"),
        "world: {objects: {a: {mass: {rang: [1, 2]}}}}",
        "world: {objects: {a: {mass: {range: [1]}}}}",
        "world: {objects: {a: {mass: {range: [a, b]}}}}",
        "world: {objects: {a: {mass: {range: [-1, 1]}}}}",
        "world: {objects: {a: {color: [0, 0, 2]}}}",
        "world: {objects: {a: {source: {box: [1, 1]}}}}",
        "world: {layout: {a: {x: near}}}",
        "task: {observations: {policy: [{scale: 1}]}}",
        "task: {rewards: {r: {weight: much}}}",
        "task: {events: {e: {when: later}}}",
        *("extends: 3", "record: {fps: 0}", "# robot\ncategory: armm", "# robot\nsurfaces: [{friction: 1}]"),
    ],
)
def test_what_is_wrong_in_one_file_is_invalid(text):
    assert complaints(text)


SEEN_WHOLE = {
    "alias_of_a_fault", "bad_enum", "bad_name", "bad_value", "color_of_wrong_type", "extends_not_text",
    "fov_too_wide", "key_of_the_layout", "list_at_the_top", "misplaced_key", "negative_mass", "python_tag",
    "range_lower_above_upper", "robot_catalogue", "unknown_key", "wrong_length", "wrong_plugin_parameter",
    "wrong_type",
}  # fmt: skip


@pytest.mark.parametrize("path", sorted((HERE / "broken").glob("*.yaml")), ids=lambda path: path.stem)
def test_broken_files_are_invalid_where_one_file_can_tell(path):
    text = path.read_text(encoding="utf-8")
    if plain(text) is not None:
        assert bool(complaints(text)) == (path.stem in SEEN_WHOLE)


def test_editors_see_what_a_key_is_for():
    schema = json_schema(RunSpec)
    assert "physics time step" in schema["$defs"]["PhysicsSpec"]["properties"]["dt"]["description"]
    assert "from" in schema["$defs"]["CameraSpec"]["properties"]
    assert "from_" not in schema["$defs"]["CameraSpec"]["properties"]
    assert schema["$defs"]["ObservationTermSpec"]["anyOf"][0]["description"] == "short for the mapping: {term: NAME}"

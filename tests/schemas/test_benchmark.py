"""Benchmark protocols: short forms, and faults with their places."""

from pathlib import Path

import pytest

from anysim_schemas.benchmark import BenchmarkSpec
from anysim_schemas.errors import SpecError
from anysim_schemas.load import load

TEXT = """name: small
tasks: {reach: {}, cubes: {task: pick_cube, level: L1}}
engines: {mujoco: {}, fine: {engine: mujoco}}
policies:
  zero: zero
  cloned: {policy: "clone:file=a.onnx", trained_on: fine}
reference: {engine: mujoco, policy: zero}
"""


def loaded(tmp_path: Path, text: str = TEXT) -> BenchmarkSpec:
    path = tmp_path / "p.yaml"
    path.write_text(text)
    return load(BenchmarkSpec, path).spec


def test_keys_are_names_where_none_is_given(tmp_path: Path) -> None:
    spec = loaded(tmp_path)
    assert [task.task for task in spec.tasks.values()] == ["reach", "pick_cube"]
    assert [engine.engine for engine in spec.engines.values()] == ["mujoco", "mujoco"]
    assert [policy.policy for policy in spec.policies.values()] == ["zero", "clone:file=a.onnx"]
    assert (spec.seeds.split, spec.seeds.episodes, spec.modality, spec.privileged) == ("test", 100, ("policy",), False)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("level: L1", "levl: L1", "p.yaml:2:45: tasks.cubes.levl: unknown key; did you mean 'level'?"),
        ("trained_on: fine", "trained_on: coarse", "p.yaml:6:53: policies.cloned.trained_on: there is no engine"),
        ("trained_on: fine", "privileged: true", "policies.cloned.privileged: this benchmark lets no policy see"),
        (
            "policy: zero}",
            "policy: one}",
            "p.yaml:7:37: reference.policy: there is no policy 'one' here; there are zero",
        ),
        ("reference:", "modality: [privileged]\nreference:", "p.yaml:7:11: modality: `privileged` is no modality"),
        ("reference:", "seeds: {split: tset}\nreference:", "p.yaml:7:16: seeds.split"),
    ],
)
def test_a_fault_has_its_place(tmp_path: Path, old: str, new: str, said: str) -> None:
    with pytest.raises(SpecError) as found:
        loaded(tmp_path, TEXT.replace(old, new))
    assert said in str(found.value)
